// The server's binary messages: bricks of voxels, scans, what apps draw, and the surfaces of a world.

const BRICKS = 1;
const SCAN = 2;
const DRAWING = 3;
const SURFACES = 4;
/** Bytes of one plane of a brick: 8 × 8 × 8 bits. */
const PLANE = 64;
/** Planes of a brick, in the order of their bits. */
const PLANES = 3;

/** The message in a buffer, or null if it is of a kind that this page does not know; throws if it is cut or overlong. */
export function readBinary(buffer) {
    const view = new DataView(buffer);
    if (view.byteLength === 0) throw new Error("a binary message without a byte");
    switch (view.getUint8(0)) {
        case BRICKS:
            return readBricks(view);
        case SCAN:
            return readScan(view);
        case DRAWING:
            return readDrawing(view);
        case SURFACES:
            return readSurfaces(view);
        default:
            return null;
    }
}

/** `{resolution, bricks: [{x, y, z, planes: [known, occupied, frontier]}]}`; a plane is 64 bytes, or null if it is empty. */
function readBricks(view) {
    if (view.byteLength < 12) throw new Error(`bricks in ${view.byteLength} bytes`);
    // 0.1 m in 32 bits is a little more than 0.1: the seven digits that they hold are what was meant.
    const resolution = Number(view.getFloat32(4, true).toPrecision(7));
    const count = view.getUint32(8, true);
    if (!(resolution > 0) || !Number.isFinite(resolution)) throw new Error(`bricks of voxels of ${resolution} m`);
    const bricks = [];
    let at = 12;
    for (let i = 0; i < count; i++) {
        if (at + 8 > view.byteLength) throw new Error(`bricks end after ${i} of ${count}`);
        const [x, y, z] = [0, 2, 4].map(offset => view.getInt16(at + offset, true));
        const present = view.getUint8(at + 6);
        if (present >> PLANES) throw new Error(`brick ${i} of ${count} has planes ${present}`);
        at += 8;
        const planes = [null, null, null];
        for (let plane = 0; plane < PLANES; plane++) {
            if (!((present >> plane) & 1)) continue;
            if (at + PLANE > view.byteLength) throw new Error(`bricks end in ${i} of ${count}`);
            planes[plane] = new Uint8Array(view.buffer, at, PLANE);
            at += PLANE;
        }
        bricks.push({ x, y, z, planes });
    }
    if (at !== view.byteLength) throw new Error(`${view.byteLength - at} bytes after ${count} bricks`);
    return { type: "bricks", resolution, bricks };
}

/** `{points}`: x, y, z of each point in turn (m, world). */
function readScan(view) {
    const count = view.byteLength >= 24 ? view.getUint32(4, true) : -1;
    if (view.byteLength !== 24 + 6 * count) throw new Error(`a scan of ${count} points in ${view.byteLength} bytes`);
    const [x, y, z, step] = new Float32Array(view.buffer, 8, 4);
    const camera = [x, y, z];
    const steps = new Int16Array(view.buffer, 24, 3 * count);
    return { type: "scan", points: Float32Array.from(steps, (steps, i) => camera[i % 3] + steps * step) };
}

/** Places that a kind of primitive has, if that is settled, and the numbers that are said of it. */
const KINDS = {
    points: { numbers: ["size"] },
    lines: { numbers: ["width"] },
    triangles: { numbers: [] },
    voxels: { numbers: ["edge"] },
    text: { numbers: ["size"], places: 1 },
    image: { numbers: ["columns"], places: 3 },
};

/** `{app, name, frame, primitives: [{kind, at, colours, …}]}`: `at` has x, y, z of each place, `colours` four bytes each. */
function readDrawing(view) {
    const words = view.byteLength >= 8 ? view.getUint32(4, true) : Infinity;
    if (8 + words > view.byteLength) throw new Error(`a drawing of ${words} bytes of words in ${view.byteLength}`);
    const drawing = JSON.parse(new TextDecoder().decode(new Uint8Array(view.buffer, 8, words)));
    const { app, name, frame, primitives } = drawing;
    if (![app, name].every(text => typeof text === "string") || !["world", "robot"].includes(frame))
        throw new Error("a drawing without app, name or frame");
    let at = 8 + 4 * Math.ceil(words / 4);
    const take = (Numbers, count) => {
        const bytes = count * Numbers.BYTES_PER_ELEMENT;
        if (!Number.isSafeInteger(count) || count < 0 || at + bytes > view.byteLength)
            throw new Error(`${app}'s drawing ${name} ends before its numbers`);
        at += bytes;
        return new Numbers(view.buffer, at - bytes, count);
    };
    drawing.primitives = primitives.map(one => {
        const kind = Object.hasOwn(KINDS, one.kind) ? KINDS[one.kind] : null;
        if (!kind?.numbers.every(number => one[number] > 0) || one.places !== (kind.places ?? one.places))
            throw new Error(`${app}'s drawing ${name} has a primitive that is none: ${one.kind}`);
        return { ...one, at: take(Float32Array, 3 * one.places), colours: take(Uint8Array, 4 * one.colours) };
    });
    if (at !== view.byteLength) throw new Error(`${view.byteLength - at} bytes after ${app}'s drawing ${name}`);
    return { ...drawing, type: "drawing" };
}

/** `{corners, triangles}`: x, y, z of each corner (m, world), and the numbers of three corners a triangle. */
function readSurfaces(view) {
    const [corners, triangles] = view.byteLength >= 12 ? [4, 8].map(at => view.getUint32(at, true)) : [-1, -1];
    if (view.byteLength !== 12 * (1 + corners + triangles))
        throw new Error(`surfaces of ${corners} corners and ${triangles} triangles in ${view.byteLength} bytes`);
    const surfaces = {
        type: "surfaces",
        corners: new Float32Array(view.buffer, 12, 3 * corners),
        triangles: new Uint32Array(view.buffer, 12 * (1 + corners), 3 * triangles),
    };
    if (surfaces.triangles.some(corner => corner >= corners)) throw new Error(`surfaces with a corner beyond ${corners}`);
    return surfaces;
}
