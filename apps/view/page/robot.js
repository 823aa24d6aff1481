// What a robot looks like: a dart along its x axis, and its camera's frustum, as plain points of the world.

import { add, cross, dot, length, rotate, scale, subtract } from "./vectors.js";

const LIGHT = [0.3, 0.2, 0.93];
/** Corners of the dart, in its own frame, and the triangles between them. */
const DART = {
    corners: [
        [1, 0, 0],
        [-0.6, 0.55, 0],
        [-0.6, -0.55, 0],
        [-0.35, 0, 0.4],
        [-0.35, 0, -0.25],
    ],
    triangles: [
        [0, 1, 3],
        [0, 3, 2],
        [3, 1, 2],
        [0, 4, 1],
        [0, 2, 4],
        [4, 2, 1],
    ],
};

/** The dart of a size (m): x, y, z and shade of each corner of its triangles. */
export function dart({ position, quaternion }, size) {
    const corners = DART.corners.map(corner => place(position, quaternion, scale(corner, size)));
    return new Float32Array(
        DART.triangles.flatMap(triangle => {
            const [a, b, c] = triangle.map(corner => corners[corner]);
            const normal = cross(subtract(b, a), subtract(c, a));
            const shade = 0.72 + (0.28 * dot(normal, LIGHT)) / (length(normal) || 1);
            return [a, b, c].flatMap(corner => [...corner, shade]);
        }),
    );
}

/** How long the frustum of a camera is drawn that sees as far as there is anything (m). */
const ENDLESS_M = 1;

/**
 * The four far corners of what the camera sees, from the lower right against the clock as it looks, and its eye. Of a fan of more than
 * half a turn they lie behind it.
 */
export function frustumOf({ position, quaternion, camera }) {
    const half = camera.horizontal / 2;
    const high = Math.tan(camera.vertical / 2) * Math.cos(half);
    const far = [
        [-1, -1],
        [-1, 1],
        [1, 1],
        [1, -1],
    ].map(([y, z]) => {
        const ray = [Math.cos(half), y * Math.sin(half), z * high];
        return place(position, quaternion, scale(ray, (camera.range ?? ENDLESS_M) / length(ray)));
    });
    return { eye: position, far };
}

function place(position, quaternion, point) {
    return add(position, rotate(quaternion, point));
}
