// A made-up run: a robot goes through the rooms of a building, and each voxel remembers the scan that first saw it.

const RESOLUTION = 0.1;
const UNKNOWN = 0xffff;
/** The camera's angles (rad) and range (m). */
const CAMERA = { horizontal: 1.4, vertical: 1.0, range: 4.5 };

/** Numbers from 0 to 1, the same for the same seed (mulberry32). */
function random(seed) {
    return () => {
        seed = (seed + 0x6d2b79f5) | 0;
        let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
        t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
        return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
    };
}

/** Which voxels of a box are solid, and since which scan they are known. Sizes are multiples of 8 voxels. */
class Grid {
    constructor(size) {
        this.size = size;
        this.solid = new Uint8Array(size[0] * size[1] * size[2]);
        this.seen = new Uint16Array(this.solid.length).fill(UNKNOWN);
    }

    index(x, y, z) {
        return x + this.size[0] * (y + this.size[1] * z);
    }

    inside(x, y, z) {
        return x >= 0 && y >= 0 && z >= 0 && x < this.size[0] && y < this.size[1] && z < this.size[2];
    }

    fill([x0, y0, z0], [x1, y1, z1], solid = 1) {
        for (let z = z0; z < z1; z++)
            for (let y = y0; y < y1; y++) this.solid.fill(solid, this.index(x0, y, z), this.index(x1, y, z));
    }
}

/** Rooms of 5 x 5 m in a square, with doors, and boxes that stand about. */
function rooms(across, along, seed, roughness) {
    const next = random(seed);
    const side = 50,
        high = 28;
    const round = value => Math.ceil(value / 8) * 8;
    const grid = new Grid([round(across * side + 4), round(along * side + 4), 32]);
    const [w, l] = [across * side + 1, along * side + 1];
    grid.fill([0, 0, 0], [w, l, 1]);
    grid.fill([0, 0, high - 1], [w, l, high]);
    for (let i = 0; i <= across; i++) grid.fill([i * side, 0, 0], [i * side + 1, l, high]);
    for (let j = 0; j <= along; j++) grid.fill([0, j * side, 0], [w, j * side + 1, high]);
    for (let i = 0; i < across; i++) {
        for (let j = 0; j < along; j++) {
            const [x, y] = [i * side, j * side];
            if (i > 0) grid.fill([x, y + 20, 1], [x + 1, y + 31, 21], 0);
            if (j > 0) grid.fill([x + 20, y, 1], [x + 31, y + 1, 21], 0);
            for (let box = 0; box < 5; box++) furnish(grid, next, x, y);
        }
    }
    for (let i = 0; i < grid.solid.length && roughness > 0; i++)
        if (grid.solid[i] && next() < roughness) grid.solid[i] = 0;
    return grid;
}

/** Puts a box into a corner of a room, where nobody passes. */
function furnish(grid, next, x, y) {
    const many = (low, high) => low + Math.floor(next() * (high - low));
    const [wide, deep, tall] = [many(4, 14), many(4, 14), many(4, 20)];
    const [left, front] = [next() < 0.5, next() < 0.5].map((near, axis) => (near ? 2 : 48 - [wide, deep][axis]));
    const z = next() < 0.25 ? many(8, 12) : 1;
    grid.fill([x + left, y + front, z], [x + left + wide, y + front + deep, Math.min(27, z + tall)]);
}

/** The poses of a robot that goes round all rooms, looking about in each: position, yaw, pitch. */
function poses(across, along) {
    const centre = (i, j) => [5 * i + 2.55, 5 * j + 2.55];
    const stops = [];
    for (let j = 0; j < along; j++) for (let i = 0; i < across; i++) stops.push(centre(j % 2 ? across - 1 - i : i, j));
    const all = [];
    stops.forEach((stop, k) => {
        const from = stops[k - 1] ?? stop;
        const yaw = Math.atan2(stop[1] - from[1], stop[0] - from[0]);
        const steps = Math.round(Math.hypot(stop[0] - from[0], stop[1] - from[1]) / 0.25);
        for (let step = 1; step <= steps; step++) {
            const at = from.map((value, axis) => value + ((stop[axis] - value) * step) / steps);
            all.push({
                at: [...at, 1.2 + 0.15 * Math.sin(all.length / 7)],
                yaw: yaw + 0.3 * Math.sin(step / 2),
                pitch: 0.1,
            });
        }
        for (let turn = 0; turn < 12; turn++) {
            all.push({ at: [...stop, 1.2], yaw: yaw + (turn * Math.PI) / 6, pitch: turn % 2 ? 0.35 : -0.3 });
        }
    });
    return all;
}

/** Follows the rays of a scan, and notes what they have seen for the first time; returns the points they hit. */
function look(grid, { at, yaw, pitch }, scan) {
    const hits = [];
    const [columns, rows] = [72, 52];
    for (let i = 0; i < columns; i++) {
        for (let j = 0; j < rows; j++) {
            const side = Math.tan(CAMERA.horizontal / 2) * (1 - (2 * i) / (columns - 1));
            const up = Math.tan(CAMERA.vertical / 2) * (1 - (2 * j) / (rows - 1));
            const [c, s, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
            const ahead = cp + sp * up,
                rise = -sp + cp * up;
            const ray = [c * ahead - s * side, s * ahead + c * side, rise];
            const long = Math.hypot(...ray);
            for (let far = 0; far < CAMERA.range; far += RESOLUTION / 2) {
                const point = at.map((value, axis) => value + (ray[axis] / long) * far);
                const [x, y, z] = point.map(value => Math.floor(value / RESOLUTION));
                if (!grid.inside(x, y, z)) break;
                const index = grid.index(x, y, z);
                grid.seen[index] = Math.min(grid.seen[index], scan);
                if (!grid.solid[index]) continue;
                hits.push(...point);
                break;
            }
        }
    }
    return Float32Array.from(hits);
}

/** A quaternion (x, y, z, w) of a yaw and, after it, a pitch downwards. */
function quaternion({ yaw, pitch }) {
    const [cy, sy, cp, sp] = [Math.cos(yaw / 2), Math.sin(yaw / 2), Math.cos(pitch / 2), Math.sin(pitch / 2)];
    return [-sy * sp, cy * sp, sy * cp, cy * cp];
}

/** A run whose every moment can be asked for. Scans count from 0; the bricks of a moment are those known after that scan. */
export class Run {
    resolution = RESOLUTION;
    camera = CAMERA;

    /** Through `across` × `along` rooms. */
    static explored(across, along, seed = 7) {
        const run = new Run(rooms(across, along, seed, 0));
        run.poses = poses(across, along).map(pose => ({ ...pose, quaternion: quaternion(pose) }));
        run.scans = run.poses.map((pose, scan) => look(run.grid, pose, scan));
        run.finish();
        return run;
    }

    /** A building that is known from the start, of about so many occupied voxels, this share of them missing again. */
    static known(occupied, roughness = 0.02) {
        const side = Math.max(1, Math.round(Math.sqrt(occupied / 10950 / (1 - roughness))));
        const run = new Run(rooms(side, side, 7, roughness));
        run.poses = [{ at: [2.55, 2.55, 1.2], yaw: 0.6, pitch: 0.1 }].map(pose => ({
            ...pose,
            quaternion: quaternion(pose),
        }));
        const { grid } = run;
        for (let z = 0; z < 28; z++)
            for (let y = 0; y <= side * 50; y++) {
                grid.seen.fill(0, grid.index(0, y, z), grid.index(side * 50, y, z) + 1);
            }
        run.scans = run.poses.map((pose, scan) => look(grid, pose, scan));
        run.finish();
        return run;
    }

    constructor(grid) {
        this.grid = grid;
    }

    get length() {
        return this.poses.length;
    }

    /** Works out what each scan has changed, and how much is known after it. */
    finish() {
        const { grid, length } = this;
        this.changes = Array.from({ length }, () => new Set());
        const known = new Array(length).fill(0),
            occupied = new Array(length).fill(0);
        const [w, l, h] = grid.size;
        for (let z = 0; z < h; z++)
            for (let y = 0; y < l; y++)
                for (let x = 0; x < w; x++) {
                    const scan = grid.seen[grid.index(x, y, z)];
                    if (scan === UNKNOWN) continue;
                    known[scan] += 1;
                    occupied[scan] += grid.solid[grid.index(x, y, z)];
                    this.#mark(this.changes[scan], x, y, z);
                }
        let way = 0;
        this.marks = this.poses.map(({ at }, scan) => {
            if (scan > 0) way += Math.hypot(...at.map((value, axis) => value - this.poses[scan - 1].at[axis]));
            known[scan] += known[scan - 1] ?? 0;
            occupied[scan] += occupied[scan - 1] ?? 0;
            return { way, known: known[scan], occupied: occupied[scan] };
        });
    }

    /** The brick of a voxel, and those next to it whose frontier it may change. */
    #mark(bricks, x, y, z) {
        const add = (x, y, z) => this.grid.inside(x, y, z) && bricks.add(`${x >> 3},${y >> 3},${z >> 3}`);
        add(x, y, z);
        for (const [axis, value] of [x, y, z].entries()) {
            const step = (value & 7) === 0 ? -1 : (value & 7) === 7 ? 1 : 0;
            if (step !== 0) add(...[x, y, z].map((value, i) => (i === axis ? value + step : value)));
        }
    }

    isKnown(x, y, z, scan) {
        return this.grid.inside(x, y, z) && this.grid.seen[this.grid.index(x, y, z)] <= scan;
    }

    isOccupied(x, y, z, scan) {
        return this.isKnown(x, y, z, scan) && this.grid.solid[this.grid.index(x, y, z)] === 1;
    }

    isFrontier(x, y, z, scan) {
        if (!this.isKnown(x, y, z, scan) || this.grid.solid[this.grid.index(x, y, z)]) return false;
        return [
            [1, 0, 0],
            [-1, 0, 0],
            [0, 1, 0],
            [0, -1, 0],
            [0, 0, 1],
            [0, 0, -1],
        ].some(
            ([dx, dy, dz]) => this.grid.inside(x + dx, y + dy, z + dz) && !this.isKnown(x + dx, y + dy, z + dz, scan),
        );
    }

    /** The binary message of all bricks that changed after scan `from`, up to scan `to`. */
    bricks(from, to) {
        // All of a large building takes seconds to put together, and is the same for everyone who comes.
        if (from === -1 && this.length === 1) return (this.whole ??= this.#bricks(from, to));
        return this.#bricks(from, to);
    }

    #bricks(from, to) {
        const names = new Set();
        for (let scan = from + 1; scan <= to; scan++) for (const name of this.changes[scan]) names.add(name);
        return bricksMessage(
            this.resolution,
            [...names].map(name => this.#brick(name.split(",").map(Number), to)),
        );
    }

    #brick([x, y, z], scan) {
        const planes = [0, 1, 2].map(() => Buffer.alloc(64));
        const tests = [this.isKnown, this.isOccupied, this.isFrontier];
        for (let bit = 0; bit < 512; bit++) {
            const at = [8 * x + (bit & 7), 8 * y + ((bit >> 3) & 7), 8 * z + (bit >> 6)];
            tests.forEach((test, plane) => {
                if (test.call(this, ...at, scan)) planes[plane][bit >> 3] |= 1 << (bit & 7);
            });
        }
        return { x, y, z, planes };
    }
}

/** Bricks, `{x, y, z, planes: [known, occupied, frontier]}` with 64 bytes a plane, as the page reads them. */
export function bricksMessage(resolution, bricks) {
    const head = Buffer.alloc(12);
    head[0] = 1;
    head.writeFloatLE(resolution, 4);
    head.writeUInt32LE(bricks.length, 8);
    const parts = bricks.flatMap(({ x, y, z, planes }) => {
        const own = Buffer.alloc(8);
        [x, y, z].forEach((value, axis) => own.writeInt16LE(value, 2 * axis));
        const full = planes.map(plane => plane.some(byte => byte !== 0));
        own[6] = full.reduce((bits, is, plane) => bits | (is << plane), 0);
        return [own, ...planes.filter((_, plane) => full[plane])];
    });
    return Buffer.concat([head, ...parts]);
}

/** A drawing: primitives of `{kind, at: [[x, y, z] …], colours: [[r, g, b, a] …], …}`. */
export function drawingMessage(app, name, primitives, frame = "world") {
    const said = primitives.map(({ at, colours, ...rest }) => ({ ...rest, places: at.length, colours: colours.length }));
    const words = Buffer.from(JSON.stringify({ app, name, frame, primitives: said }));
    const head = Buffer.alloc(8 + 4 * Math.ceil(words.length / 4), " ");
    head.fill(0, 0, 8);
    head[0] = 3;
    head.writeUInt32LE(words.length, 4);
    words.copy(head, 8);
    const data = primitives.flatMap(({ at, colours }) => [
        Buffer.from(new Float32Array(at.flat()).buffer),
        Buffer.from(colours.flat()),
    ]);
    return Buffer.concat([head, ...data]);
}

/** The surfaces of a box without a lid between two corners, all seen from within. */
export function boxOf([x0, y0, z0], [x1, y1, z1]) {
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map(i => [i & 1 ? x1 : x0, i & 2 ? y1 : y0, i & 4 ? z1 : z0]);
    const quads = [
        [0, 1, 3, 2],
        [0, 2, 6, 4],
        [1, 5, 7, 3],
        [0, 4, 5, 1],
        [2, 3, 7, 6],
    ];
    return { corners, triangles: quads.flatMap(([a, b, c, d]) => [[a, b, c], [c, d, a]]) };
}

export function surfacesMessage({ corners, triangles }) {
    const head = Buffer.alloc(12);
    head[0] = 4;
    head.writeUInt32LE(corners.length, 4);
    head.writeUInt32LE(triangles.length, 8);
    const bytes = [new Float32Array(corners.flat()), new Uint32Array(triangles.flat())].map(data => Buffer.from(data.buffer));
    return Buffer.concat([head, ...bytes]);
}

export function scanMessage(points) {
    const head = Buffer.alloc(24);
    head[0] = 2;
    head.writeUInt32LE(points.length / 3, 4);
    const step = points.reduce((most, part) => Math.max(most, Math.abs(part)), 1e-6) / 32767;
    head.writeFloatLE(step, 20);
    return Buffer.concat([head, Buffer.from(Int16Array.from(points, part => Math.round(part / step)).buffer)]);
}
