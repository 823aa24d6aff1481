// The page's mesh and its binary messages, against the plainest way to say the same. Needs only Node.

import assert from "node:assert/strict";
import { test } from "node:test";

import { Camera } from "../../apps/view/page/camera.js";
import { dot, facing, frustum, sees, subtract } from "../../apps/view/page/vectors.js";
import { readBinary } from "../../apps/view/page/binary.js";
import { check } from "../../apps/view/page/messages.js";
import { faces, freeRows, rowsWithout, section } from "../../apps/view/page/mesh.js";
import { mistake } from "../../apps/view/page/parameters.js";
import { Voxels } from "../../apps/view/page/voxels.js";
import { bricksMessage, scanMessage } from "./building.mjs";

/** Numbers from 0 to 1, the same for the same seed. */
function random(seed) {
    return () => (seed = (Math.imul(seed ^ (seed >>> 15), 0x2c1b3c6d) + 0x9e3779b9) | 0) / 2 ** 32 + 0.5;
}

function buffer(bytes) {
    return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
}

/** A map of bricks around the origin, in which voxels are known and occupied at random, with these shares. */
function someMap(seed, known, occupied) {
    const next = random(seed);
    const voxels = new Voxels();
    const bricks = [];
    for (let x = -5; x < 5; x++)
        for (let y = -5; y < 5; y++)
            for (let z = -2; z < 2; z++) {
                if (next() < 0.3) continue;
                const planes = [0, 1, 2].map(() => new Uint8Array(64));
                // Some bricks are full, so that long runs are among the rows.
                const solid = next() < 0.3;
                for (let bit = 0; bit < 512; bit++) {
                    const set = plane => (planes[plane][bit >> 3] |= 1 << (bit & 7));
                    if (!solid && next() > known) continue;
                    set(0);
                    if (solid || next() < occupied) set(1);
                    else if (next() < 0.2) set(2);
                }
                bricks.push({ x, y, z, planes });
            }
    voxels.take(readBinary(buffer(bricksMessage(0.1, bricks))));
    return voxels;
}

const STEPS = [
    [-1, 0, 0],
    [1, 0, 0],
    [0, -1, 0],
    [0, 1, 0],
    [0, 0, -1],
    [0, 0, 1],
];

/** The faces that rectangles are made of, each as `face x y z` of its voxel; a face that is there twice is an error. */
function unpacked(chunk, words) {
    const found = new Set();
    for (const word of words) {
        const bits = (at, many) => (word >>> at) & ((1 << many) - 1);
        const face = bits(15, 3),
            axis = face >> 1;
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        for (let i = 0; i <= bits(18, 5); i++)
            for (let j = 0; j <= bits(23, 5); j++) {
                const at = [32 * chunk.x + bits(0, 5), 32 * chunk.y + bits(5, 5), 32 * chunk.z + bits(10, 5)];
                at[u] += i;
                at[v] += j;
                const name = `${face} ${at.join(" ")}`;
                assert(!found.has(name), `${name} is drawn twice`);
                found.add(name);
            }
    }
    return found;
}

function expected(voxels, chunk, is, outside) {
    const all = new Set();
    for (let z = 0; z < 32; z++)
        for (let y = 0; y < 32; y++)
            for (let x = 0; x < 32; x++) {
                const at = [32 * chunk.x + x, 32 * chunk.y + y, 32 * chunk.z + z];
                if (!is(...at)) continue;
                STEPS.forEach((step, face) => {
                    if (outside(...at.map((value, axis) => value + step[axis]))) all.add(`${face} ${at.join(" ")}`);
                });
            }
    return all;
}

for (const [known, occupied] of [
    [0.9, 0.5],
    [0.5, 0.1],
    [1, 0.98],
    [0.05, 0.5],
]) {
    test(`rectangles cover each face once, where ${known} is known and ${occupied} of it occupied`, () => {
        for (let seed = 1; seed <= 2; seed++) {
            const voxels = someMap(seed, known, occupied);
            const has =
                plane =>
                (...at) =>
                    voxels.has(plane, ...at);
            const isFree = (...at) => voxels.has("known", ...at) && !voxels.has("occupied", ...at);
            assert([...voxels.chunks()].length > 8);
            for (const chunk of voxels.chunks()) {
                const open = unpacked(chunk, faces(voxels, chunk, "occupied", freeRows).words);
                assert.deepEqual(open, expected(voxels, chunk, has("occupied"), isFree));
                const { words, ends } = faces(voxels, chunk, "occupied", freeRows);
                words.forEach((word, i) =>
                    assert.equal(
                        ends.findIndex(end => i < end),
                        (word >>> 15) & 7,
                    ),
                );
                const closed = unpacked(chunk, faces(voxels, chunk, "occupied", rowsWithout("occupied")).words);
                assert.deepEqual(
                    closed,
                    expected(voxels, chunk, has("occupied"), (...at) => !voxels.has("occupied", ...at)),
                );
                const cut = unpacked(chunk, section(chunk.occupied, 5));
                const layer = (x, y, z) => z === 32 * chunk.z + 5 && voxels.has("occupied", x, y, z);
                assert.deepEqual(
                    cut,
                    new Set([...expected(voxels, chunk, layer, () => true)].filter(name => name.startsWith("5 "))),
                );
            }
        }
    });
}

test("a wall is one rectangle a chunk", () => {
    const voxels = new Voxels();
    const bricks = [];
    for (let y = 0; y < 4; y++)
        for (let z = 0; z < 4; z++) {
            const planes = [new Uint8Array(64).fill(0b110), new Uint8Array(64).fill(0b100), new Uint8Array(64)];
            bricks.push({ x: 0, y, z, planes });
        }
    voxels.take({ resolution: 0.1, bricks });
    assert.equal(faces(voxels, voxels.chunk(0, 0, 0), "occupied", freeRows).words.length, 1);
});

test("counts, layers and heights are those of a map that is taken apart and put together again", () => {
    const voxels = someMap(3, 0.8, 0.3);
    const count = plane => {
        let sum = 0;
        for (const chunk of voxels.chunks())
            for (const row of chunk[plane]) for (let bits = row; bits !== 0; bits &= bits - 1) sum += 1;
        return sum;
    };
    for (const plane of ["known", "occupied", "frontier"]) assert.equal(voxels[plane], count(plane));
    assert.equal(
        [...voxels.layers.values()].reduce((sum, layer) => sum + layer),
        voxels.occupied,
    );
    const [low, high] = voxels.heights();
    assert(low >= -1.6 && high <= 1.6 && low < high);
    const empty = [...voxels.chunks()].flatMap(({ x, y, z }) =>
        Array.from({ length: 64 }, (_, i) => ({
            x: 4 * x + (i & 3),
            y: 4 * y + ((i >> 2) & 3),
            z: 4 * z + (i >> 4),
            planes: [null, null, null],
        })),
    );
    voxels.take({ resolution: 0.1, bricks: empty });
    assert.deepEqual([voxels.known, voxels.occupied, voxels.frontier, voxels.heights()], [0, 0, 0, null]);
});

test("a brick has its neighbours drawn anew, and voxels of another size are another map", () => {
    const voxels = new Voxels();
    const full = { planes: [new Uint8Array(64).fill(255), new Uint8Array(64).fill(255), null] };
    voxels.take({
        resolution: 0.1,
        bricks: [
            { x: 3, y: 1, z: 1, ...full },
            { x: 4, y: 1, z: 1, ...full },
        ],
    });
    const changed = [];
    let cleared = 0;
    voxels.watch({ changed: chunk => changed.push(chunk.x), cleared: () => cleared++ });
    voxels.take({ resolution: 0.1, bricks: [{ x: 4, y: 1, z: 1, ...full }] });
    assert.deepEqual(changed.sort(), [0, 1]);
    voxels.take({ resolution: 0.2, bricks: [{ x: 0, y: 0, z: 0, ...full }] });
    assert.deepEqual([cleared, voxels.occupied], [1, 512]);
});

test("no face that is turned to the eye is left out, and no box that it sees", () => {
    const next = random(5);
    const camera = new Camera(() => {});
    for (let i = 0; i < 300; i++) {
        camera.move({
            yaw: 7 * next(),
            pitch: 3 * next() - 1.5,
            distance: 1 + 20 * next(),
            target: [next(), next(), next()],
        });
        const eye = camera.eye();
        const middle = [0, 1, 2].map(() => 20 * next() - 10);
        const half = 0.2 + 3 * next();
        const turned = facing(middle, half, eye);
        const matrix = camera.matrix(1.5);
        const seen = sees(
            frustum(matrix),
            middle.map(value => value - half),
            middle.map(value => value + half),
        );
        for (let j = 0; j < 30; j++) {
            const point = middle.map(value => value + half * (2 * next() - 1));
            STEPS.forEach((normal, face) => {
                if (dot(normal, subtract(eye, point)) > 0) assert(turned[face], `face ${face} of ${point} from ${eye}`);
            });
            const [x, y, z, w] = [0, 1, 2, 3].map(
                row =>
                    dot(
                        matrix.filter((_, k) => k % 4 === row),
                        point,
                    ) + matrix[12 + row],
            );
            if ([x, y, z].every(value => Math.abs(value) <= w)) assert(seen, `${point} from ${eye}`);
        }
    }
});

test("a binary message that is cut or too long is none", () => {
    const brick = {
        x: -3,
        y: 2,
        z: 1,
        planes: [new Uint8Array(64).fill(1), new Uint8Array(64), new Uint8Array(64).fill(2)],
    };
    const good = bricksMessage(0.1, [brick, brick]);
    assert.equal(readBinary(buffer(good)).bricks.length, 2);
    assert.equal(readBinary(buffer(good)).bricks[1].planes[1], null);
    for (let length = 0; length < good.length; length++)
        assert.throws(() => readBinary(buffer(good.subarray(0, length))), Error);
    assert.throws(() => readBinary(buffer(Buffer.concat([good, Buffer.alloc(1)]))), /1 bytes after 2 bricks/);
    const scan = scanMessage(Float32Array.of(1, 2, 3));
    readBinary(buffer(scan)).points.forEach((part, i) => assert(Math.abs(part - (i + 1)) < 1e-4, `${part}`));
    assert.throws(() => readBinary(buffer(scan.subarray(0, 29))), /a scan of 1 points in 29 bytes/);
    assert.equal(readBinary(buffer(Buffer.of(9, 1, 2))), null);
    const many = Buffer.from(good);
    many.writeUInt32LE(0xffffffff, 8);
    assert.throws(() => readBinary(buffer(many)), /bricks end after 2 of 4294967295/);
});

test("a text message is what its type says, or is refused with the place of the mistake", () => {
    assert.equal(check({ type: "of later versions", x: 1 }), null);
    assert.equal(check({ type: "frame", number: 3, more: 1 }).number, 3);
    assert.throws(() => check([]), /the message should be an object/);
    assert.throws(() => check({}), /the message\.type should be a text/);
    assert.throws(() => check({ type: "frame", number: -1 }), /frame\.number should be a whole number from 0/);
    assert.throws(
        () =>
            check({
                type: "way",
                from: 0,
                points: [
                    [1, 2, 3],
                    [1, 2],
                ],
            }),
        /way\.points\[1\] should be 3 numbers/,
    );
    assert.throws(
        () => check({ type: "apps", rows: [{ name: "a", state: 3 }] }),
        /apps\.rows\[0\]\.state should be a text/,
    );
});

test("a parameter's mistake is said before it is sent", () => {
    const number = { name: "Speed", kind: "number", unit: "m", min: 0.1, max: 5 };
    const none = (parameter, ...texts) => texts.forEach(text => assert.equal(mistake(parameter, text), null, text));
    none(number, "", "0.5", "5", "2 m", "1e-1", "90 cm");
    assert.match(mistake(number, "fast"), /a number/);
    assert.match(mistake(number, "6"), /at most 5 m/);
    assert.match(mistake(number, "0 m"), /at least 0\.1 m/);
    assert.match(mistake({ kind: "number" }, "1 m"), /without a unit/);
    none({ kind: "point", unit: "m" }, "1; 2; 0.5", "1 m; -2 m; 0");
    assert.match(mistake({ kind: "point", unit: "m" }, "1; 2"), /three numbers/);
    assert.match(mistake({ kind: "integer", min: 1 }, "1.5"), /whole/);
    assert.match(mistake({ kind: "integer", min: 1 }, "0"), /at least 1/);
    assert.match(mistake({ kind: "choice", choices: ["A", "B"] }, "C"), /one of A, B/);
    assert.match(mistake({ kind: "flag" }, "yes"), /true or false/);
    none({ kind: "text" }, "anything; at all");
});

test("a map that is too large is shown as far as there is room, and that is said", () => {
    const voxels = new Voxels();
    const planes = [null, Uint8Array.from({ length: 64 }, (_, i) => Number(i === 0)), null];
    const bricks = Array.from({ length: (1 << 14) + 3 }, (_, i) => ({
        x: 4 * (i & 127),
        y: 4 * (i >> 7),
        z: 0,
        planes,
    }));
    assert.throws(() => voxels.take({ resolution: 0.1, bricks }), /3 bricks have no place/);
    assert.equal(voxels.occupied, 1 << 14);
    assert.deepEqual(voxels.bounds().low, [0, 0, 0]);
    voxels.take({ resolution: 0.1, bricks: bricks.slice(0, 1) });
    assert.equal(voxels.occupied, 1 << 14);
});
