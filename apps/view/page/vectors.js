// Points, quaternions (x, y, z, w) and 4 × 4 matrices (column by column, as WebGL has them).

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = a => Math.hypot(a[0], a[1], a[2]);

/** `v` turned by the quaternion `q`. */
export function rotate(q, v) {
    const t = scale(cross(q, v), 2);
    return add(add(v, scale(t, q[3])), cross(q, t));
}

/** What takes a view's coordinates (looking along -z) to clip space. */
export function perspective(fovY, aspect, near, far) {
    const f = 1 / Math.tan(fovY / 2);
    const depth = far - near;
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, -(far + near) / depth, -1, 0, 0, (-2 * far * near) / depth, 0];
}

/** What takes the world's coordinates to those of an eye with these axes. */
export function viewFrom(eye, right, up, back) {
    return [
        right[0],
        up[0],
        back[0],
        0,
        right[1],
        up[1],
        back[1],
        0,
        right[2],
        up[2],
        back[2],
        0,
        -dot(right, eye),
        -dot(up, eye),
        -dot(back, eye),
        1,
    ];
}

export function multiply(a, b) {
    const product = new Float32Array(16);
    for (let column = 0; column < 4; column++) {
        for (let row = 0; row < 4; row++) {
            let sum = 0;
            for (let k = 0; k < 4; k++) sum += a[row + 4 * k] * b[k + 4 * column];
            product[row + 4 * column] = sum;
        }
    }
    return product;
}

/** The six planes (a, b, c, d with a x + b y + c z + d >= 0 inside) that bound what a projection sees. */
export function frustum(m) {
    const row = i => [m[i], m[i + 4], m[i + 8], m[i + 12]];
    const w = row(3);
    return [0, 1, 2].flatMap(i => [1, -1].map(sign => row(i).map((value, k) => w[k] + sign * value)));
}

/** Whether a box may be seen: it is not wholly beyond one of the planes. */
export function sees(planes, low, high) {
    return planes.every(
        ([a, b, c, d]) =>
            a * (a > 0 ? high[0] : low[0]) + b * (b > 0 ? high[1] : low[1]) + c * (c > 0 ? high[2] : low[2]) + d >= 0,
    );
}

/** Which of the faces -x, +x, -y, … of cells in a cube may be turned to an eye: there are never all of them, but from within. */
export function facing(middle, half, eye) {
    return middle.flatMap((value, axis) => [eye[axis] < value + half, eye[axis] > value - half]);
}
