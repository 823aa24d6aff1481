// The faces of a chunk's voxels, as few rectangles as a greedy sweep finds, each in one 32-bit word.
//
// A word holds x, y, z of the rectangle's first voxel (5 bits each), its face (3 bits: -x, +x, -y, +y, -z, +z), and how many
// voxels more than one it is long along the two axes that follow its own in the circle x, y, z (5 bits each).

import { SIDE } from "./voxels.js";

const ROWS = SIDE * SIDE;
const ALL = new Uint32Array(ROWS).fill(0xffffffff);
const NONE = new Uint32Array(ROWS);
/** Faces of the chunk in hand towards one direction, as slices across it: row r of slice s is word `r + 32 s`. */
const slices = new Uint32Array(ROWS);
let words = new Uint32Array(1 << 12);
let count = 0;

/**
 * Rectangles of the faces between voxels of a plane and neighbours that are `outside`.
 *
 * `outside` is a function from a chunk (or undefined) to rows. The answer is `words`, valid until the next call, and where
 * those of each face end in them: `ends`.
 */
export function faces(voxels, chunk, plane, outside) {
    const here = chunk[plane];
    const gaps = outside(chunk);
    const ends = new Array(6);
    count = 0;
    for (let face = 0; face < 6; face++) {
        const beyond = outside(voxels.neighbour(chunk, face));
        if (slice[face >> 1](here, gaps, beyond, face & 1)) merge(face);
        ends[face] = count;
    }
    return { words: words.subarray(0, count), ends };
}

/** Rectangles of the tops of a chunk's voxels in one layer, whatever is above: what a cut shows. */
export function section(rows, layer) {
    count = 0;
    slices.fill(0);
    slices.set(rows.subarray(SIDE * layer, SIDE * (layer + 1)), SIDE * layer);
    merge(5);
    return words.subarray(0, count);
}

/** The rows of free voxels of a chunk; where there is no chunk, none. */
export function freeRows(chunk) {
    if (!chunk) return NONE;
    return chunk.known.map((known, i) => known & ~chunk.occupied[i]);
}

/** Gives the rows of voxels of a chunk that are not in a plane; where there is no chunk, all. */
export function rowsWithout(plane) {
    return chunk => (chunk ? chunk[plane].map(row => ~row) : ALL);
}

// For each axis: sorts the faces into `slices` and says whether there are any.
const slice = [
    (here, gaps, beyond, up) => {
        let any = 0;
        slices.fill(0);
        for (let row = 0; row < ROWS; row++) {
            if (here[row] === 0) continue;
            const next = up ? (gaps[row] >>> 1) | (beyond[row] << 31) : (gaps[row] << 1) | (beyond[row] >>> 31);
            const y = 1 << (row & 31),
                z = row >> 5;
            let found = here[row] & next;
            any |= found;
            for (; found !== 0; found &= found - 1) slices[z + SIDE * (31 - Math.clz32(found & -found))] |= y;
        }
        return any !== 0;
    },
    (here, gaps, beyond, up) => {
        let any = 0;
        for (let y = 0; y < SIDE; y++) {
            const inner = up ? y + 1 < SIDE : y > 0;
            const [from, next] = inner ? [gaps, y + (up ? 1 : -1)] : [beyond, up ? 0 : SIDE - 1];
            for (let z = 0; z < SIDE; z++) {
                any |= slices[z + SIDE * y] = here[y + SIDE * z] & from[next + SIDE * z];
            }
        }
        return any !== 0;
    },
    (here, gaps, beyond, up) => {
        let any = 0;
        for (let z = 0; z < SIDE; z++) {
            const inner = up ? z + 1 < SIDE : z > 0;
            const [from, next] = inner ? [gaps, z + (up ? 1 : -1)] : [beyond, up ? 0 : SIDE - 1];
            for (let y = 0; y < SIDE; y++) {
                any |= slices[y + SIDE * z] = here[y + SIDE * z] & from[y + SIDE * next];
            }
        }
        return any !== 0;
    },
];

/** Where a rectangle from bit `b` of row `r` of slice `s` begins, and how its two lengths lie: bits and rows. */
const place = [
    (s, r, b, bits, rows) => s | (b << 5) | (r << 10) | (bits << 18) | (rows << 23),
    (s, r, b, bits, rows) => b | (s << 5) | (r << 10) | (rows << 18) | (bits << 23),
    (s, r, b, bits, rows) => b | (r << 5) | (s << 10) | (bits << 18) | (rows << 23),
];

/** Takes the faces out of `slices`, a rectangle at a time: the longest run of bits, over as many rows as have it. */
function merge(face) {
    const word = place[face >> 1];
    for (let start = 0; start < ROWS; start += SIDE) {
        for (let row = 0; row < SIDE; row++) {
            while (slices[start + row] !== 0) {
                const bits = slices[start + row];
                const first = 31 - Math.clz32(bits & -bits);
                const ends = ~(bits >>> first);
                const length = ends === 0 ? 32 : 31 - Math.clz32(ends & -ends);
                const run = (length === 32 ? -1 : (1 << length) - 1) << first;
                let last = row;
                do slices[start + last++] &= ~run;
                while (last < SIDE && (slices[start + last] & run) === run);
                push(word(start / SIDE, row, first, length - 1, last - row - 1) | (face << 15));
            }
        }
    }
}

function push(word) {
    if (count === words.length) {
        const longer = new Uint32Array(2 * count);
        longer.set(words);
        words = longer;
    }
    words[count++] = word;
}
