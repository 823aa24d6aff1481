// The map as this page knows it: chunks of 32 × 32 × 32 voxels, of which each row along x is one 32-bit word.

/** Voxels along an edge of a chunk. */
export const SIDE = 32;
const ROWS = SIDE * SIDE;
/** Bricks (8 voxels) along an edge of a chunk. */
const BRICKS = 4;
/** Chunks at most: half a billion voxels, and some 200 MB. */
const MOST_CHUNKS = 1 << 14;
/** What every plane is until something is in it. Nobody writes here. */
const EMPTY = new Uint32Array(ROWS);
const ONES = Uint8Array.from({ length: 256 }, (_, byte) => byte.toString(2).replaceAll("0", "").length);

const PLANES = ["known", "occupied", "frontier"];
/** The six neighbours of a chunk, in the order of the faces: -x, +x, -y, +y, -z, +z. */
export const NEIGHBOURS = [
    [-1, 0, 0],
    [1, 0, 0],
    [0, -1, 0],
    [0, 1, 0],
    [0, 0, -1],
    [0, 0, 1],
];

/** Row (y, z) of a plane is word `y + 32 z`; voxel x is its bit x. */
class Chunk {
    known = EMPTY;
    occupied = EMPTY;
    frontier = EMPTY;

    /** Rows and columns (along x and y) in which something is occupied, or null if that has to be looked for. */
    extent = null;

    constructor(x, y, z) {
        Object.assign(this, { x, y, z });
    }
}

export class Voxels {
    #chunks = new Map();
    #watchers = [];
    /** What `heights` and `bounds` have found, as long as it holds. */
    #heights;
    #bounds;
    /** Goes up with every change. */
    version = 0;

    constructor() {
        this.clear();
    }

    clear() {
        this.#chunks.clear();
        this.known = this.occupied = this.frontier = 0;
        /** Occupied voxels by layer (index along z). */
        this.layers = new Map();
        this.resolution = null;
        this.#changed();
        for (const { cleared } of this.#watchers) cleared();
    }

    /** Has `changed(chunk)` called for each chunk whose picture may have changed, and `cleared()` for all. */
    watch(watcher) {
        this.#watchers.push(watcher);
    }

    chunks() {
        return this.#chunks.values();
    }

    chunk(x, y, z) {
        return this.#chunks.get(((x + 8192) * 16384 + y + 8192) * 16384 + z + 8192);
    }

    /** The neighbour of a chunk across one of its faces. */
    neighbour(chunk, face) {
        const [x, y, z] = NEIGHBOURS[face];
        return this.chunk(chunk.x + x, chunk.y + y, chunk.z + z);
    }

    /** Whether a voxel, by its indices, is in a plane (`known`, `occupied`, `frontier`). */
    has(plane, x, y, z) {
        const chunk = this.chunk(x >> 5, y >> 5, z >> 5);
        return chunk !== undefined && ((chunk[plane][(y & 31) + SIDE * (z & 31)] >>> (x & 31)) & 1) === 1;
    }

    /** Takes bricks in place of what was known of them. Voxels of another size make another map of it. */
    take({ resolution, bricks }) {
        if (this.resolution !== resolution) this.clear();
        this.resolution = resolution;
        const touched = new Set();
        const left = bricks.filter(brick => !this.#takeBrick(brick, touched));
        this.#changed();
        for (const chunk of touched) for (const { changed } of this.#watchers) changed(chunk);
        if (left.length > 0)
            throw new Error(`${left.length} bricks have no place: this page shows ${MOST_CHUNKS} chunks of 32³ voxels`);
    }

    /** Whether there was a place for it. */
    #takeBrick({ x, y, z, planes }, touched) {
        const chunk = this.#chunkFor(x >> 2, y >> 2, z >> 2);
        if (!chunk) return false;
        const within = [x & 3, y & 3, z & 3];
        PLANES.forEach((name, i) => this.#write(chunk, name, within, planes[i]));
        chunk.extent = null;
        touched.add(chunk);
        // The faces of a neighbour's outermost voxels depend on ours.
        within.forEach((place, axis) => {
            const next =
                place === 0
                    ? this.neighbour(chunk, 2 * axis)
                    : place === BRICKS - 1
                      ? this.neighbour(chunk, 2 * axis + 1)
                      : undefined;
            if (next) touched.add(next);
        });
        return true;
    }

    #chunkFor(x, y, z) {
        const found = this.chunk(x, y, z);
        if (found) return found;
        if (this.#chunks.size === MOST_CHUNKS) return undefined;
        const chunk = new Chunk(x, y, z);
        this.#chunks.set(((x + 8192) * 16384 + y + 8192) * 16384 + z + 8192, chunk);
        return chunk;
    }

    /** A brick's row is a byte of a chunk's row, so a plane is 64 bytes to be put in their places. */
    #write(chunk, name, [x, y, z], source) {
        if (chunk[name] === EMPTY) {
            if (source === null) return;
            chunk[name] = new Uint32Array(ROWS);
        }
        const bytes = new Uint8Array(chunk[name].buffer);
        let more = 0;
        for (let layer = 0; layer < 8; layer++) {
            let moreHere = 0;
            for (let row = 0; row < 8; row++) {
                const place = 4 * (8 * y + row + SIDE * (8 * z + layer)) + x;
                const byte = source === null ? 0 : source[row + 8 * layer];
                moreHere += ONES[byte] - ONES[bytes[place]];
                bytes[place] = byte;
            }
            if (moreHere !== 0 && name === "occupied") this.#countLayer(SIDE * chunk.z + 8 * z + layer, moreHere);
            more += moreHere;
        }
        this[name] += more;
    }

    #changed() {
        this.version += 1;
        this.#heights = this.#bounds = undefined;
    }

    #countLayer(layer, more) {
        this.layers.set(layer, (this.layers.get(layer) ?? 0) + more);
    }

    /** Lowest and highest height (m) between which all occupied voxels lie but 1 % at either end, or null. */
    heights() {
        return this.#heights === undefined ? (this.#heights = this.#findHeights()) : this.#heights;
    }

    #findHeights() {
        const layers = [...this.layers].filter(([, count]) => count > 0).sort(([a], [b]) => a - b);
        if (layers.length === 0) return null;
        const reach = rows => {
            let left = this.occupied / 100;
            return rows.find(([, count]) => (left -= count) < 0)[0];
        };
        return [reach(layers) * this.resolution, (reach(layers.reverse()) + 1) * this.resolution];
    }

    /** The box (m) of the chunks in which something is occupied, cut to the heights of `heights`, or null. */
    bounds() {
        return this.#bounds === undefined ? (this.#bounds = this.#findBounds()) : this.#bounds;
    }

    #findBounds() {
        const heights = this.heights();
        if (heights === null) return null;
        const low = [Infinity, Infinity],
            high = [-Infinity, -Infinity];
        for (const chunk of this.chunks()) {
            chunk.extent ??= extent(chunk);
            chunk.extent.forEach(([first, last], axis) => {
                low[axis] = Math.min(low[axis], first);
                high[axis] = Math.max(high[axis], last + 1);
            });
        }
        const metres = corner => corner.map(index => index * this.resolution);
        return { low: [...metres(low), heights[0]], high: [...metres(high), heights[1]] };
    }
}

/** First and last index along x and along y of what is occupied in a chunk; none of either if nothing is. */
function extent(chunk) {
    let columns = 0,
        rows = 0;
    for (let row = 0; row < ROWS; row++) {
        columns |= chunk.occupied[row];
        if (chunk.occupied[row] !== 0) rows |= 1 << (row & 31);
    }
    if (columns === 0) return [];
    const ends = bits => [31 - Math.clz32(bits & -bits), 31 - Math.clz32(bits)];
    return [ends(columns).map(x => SIDE * chunk.x + x), ends(rows).map(y => SIDE * chunk.y + y)];
}
