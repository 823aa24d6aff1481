// The true world, as a ghost: its surfaces, seen through from their backs, with the edges at which they turn.

import { Quads, Vertices, floats } from "./gl.js";
import { cross, dot, length, scale, subtract } from "./vectors.js";

const ALPHA = 0.16;
const EDGE_ALPHA = 0.55;
/** Two faces whose normals have a smaller cosine make an edge. */
const FLAT = 0.85;

export class Ghost {
    /** What of which surfaces is on the card. */
    #of = null;
    #faces = null;
    #lines = null;
    #clip = null;

    constructor(scene, world) {
        Object.assign(this, { scene, world });
    }

    /** Nothing is on the card. */
    restart() {
        this.#of = this.#faces = this.#lines = null;
    }

    draw(colours) {
        const { scene, world } = this;
        const { surfaces, clip } = world;
        if (this.#of !== surfaces) this.#put(surfaces);
        if (surfaces === null) return;
        if (this.#clip !== clip) this.#cut(clip);
        const { gl, canvas } = scene;
        gl.enable(gl.BLEND);
        gl.depthMask(false);
        // A wall is seen from the free side only: from without one looks through it, into the room.
        scene.use("SURFACES", { paint: [...colours.ghost, ALPHA], clip: clip ?? 1e9 });
        this.#faces.draw(gl.TRIANGLES, surfaces.triangles.length);
        const pixels = [canvas.width / 2, canvas.height / 2];
        const width = (1.2 * scene.pixelRatio) / 2;
        scene.use("LINES", { pixels, width, dash: 0, bias: 1e-4, paint: [...colours.ghost, EDGE_ALPHA] });
        gl.disable(gl.CULL_FACE);
        this.#lines.draw();
        gl.enable(gl.CULL_FACE);
        gl.depthMask(true);
        gl.disable(gl.BLEND);
    }

    #put(surfaces) {
        [this.#faces, this.#lines].forEach(vertices => vertices?.free());
        this.#of = surfaces;
        this.#faces = this.#lines = null;
        if (surfaces === null) return;
        const { gl, indices } = this.scene;
        this.#faces = new Vertices(gl, floats(3));
        const corners = new Float32Array(3 * surfaces.triangles.length);
        surfaces.triangles.forEach((corner, i) => corners.set(pointOf(surfaces, corner), 3 * i));
        this.#faces.set(corners);
        this.#lines = new Quads(gl, indices, floats(3, 3), 6);
        this.edges = edgesOf(surfaces);
        this.#cut(this.world.clip);
    }

    #cut(clip) {
        this.#clip = clip;
        this.#lines.set(new Float32Array(below(this.edges, clip ?? Infinity).flat(2)));
    }
}

const pointOf = ({ corners }, corner) => [corners[3 * corner], corners[3 * corner + 1], corners[3 * corner + 2]];

/** Segments `[from, to]` along which surfaces turn, or end. */
export function edgesOf(surfaces) {
    const { corners, triangles } = surfaces;
    const count = corners.length / 3;
    /** The normal of the first face at an edge, or null once the edge is known to be none, or put down. */
    const open = new Map();
    const edges = [];
    for (let i = 0; i < triangles.length; i += 3) {
        const numbers = [triangles[i], triangles[i + 1], triangles[i + 2]];
        const [a, b, c] = numbers.map(corner => pointOf(surfaces, corner));
        const across = cross(subtract(b, a), subtract(c, a));
        const normal = scale(across, 1 / (length(across) || 1));
        for (let side = 0; side < 3; side++) {
            const ends = [numbers[side], numbers[(side + 1) % 3]].sort((one, other) => one - other);
            const key = ends[0] * count + ends[1];
            if (!open.has(key)) open.set(key, { ends, normal });
            else if (open.get(key) !== null) {
                if (dot(open.get(key).normal, normal) < FLAT) edges.push(ends);
                open.set(key, null);
            }
        }
    }
    for (const edge of open.values()) if (edge !== null) edges.push(edge.ends);
    return edges.map(ends => ends.map(corner => pointOf(surfaces, corner)));
}

/** What of segments is not above a height. */
export function below(segments, height) {
    const cut = (from, to) => {
        const share = (height - from[2]) / (to[2] - from[2]);
        return from.map((value, axis) => value + share * (to[axis] - value));
    };
    return segments.flatMap(([from, to]) => {
        if (from[2] > height && to[2] > height) return [];
        if (from[2] > height) return [[cut(to, from), to]];
        return [[from, to[2] > height ? cut(from, to) : to]];
    });
}

/** Where surfaces go through a height, or through their middle if it is null: segments of points of the plan. */
export function sectionOf(surfaces, height) {
    const { corners, triangles } = surfaces;
    if (height === null) {
        let [low, high] = [Infinity, -Infinity];
        for (let i = 2; i < corners.length; i += 3) [low, high] = [Math.min(low, corners[i]), Math.max(high, corners[i])];
        height = (low + high) / 2;
    }
    const segments = [];
    for (let i = 0; i < triangles.length; i += 3) {
        const points = [];
        for (let side = 0; side < 3; side++) {
            const [from, to] = [triangles[i + side], triangles[i + ((side + 1) % 3)]].map(n => pointOf(surfaces, n));
            if (from[2] > height === to[2] > height) continue;
            const share = (height - from[2]) / (to[2] - from[2]);
            points.push([0, 1].map(axis => from[axis] + share * (to[axis] - from[axis])));
        }
        if (points.length === 2) segments.push(points);
    }
    return segments;
}
