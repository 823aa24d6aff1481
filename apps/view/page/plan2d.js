// The 2-D view: the map from above, cut at a height, on a plain canvas. It is also what a browser without WebGL 2 gets.

import { drawFlat } from "./drawnflat.js";
import { sectionOf } from "./ghost.js";
import { css, mix, ofHeight } from "./palette.js";
import { frustumOf } from "./robot.js";
import { SIDE } from "./voxels.js";

/** Above the robot, where the map is cut if nobody has said a height (m): what is higher is a ceiling. */
const HEADROOM = 0.05;
/** Longest a person waits for tiles in one frame (ms). */
const TILING_MS = 40;
/** How much of what lies below the cut, and of the frontier, is lost in the colour of free space. */
const PALE = 0.55;

export class Plan2d {
    /** A tile of 32 × 32 voxels of the plan: a canvas each, by `x,y`; those to be painted again are in `#stale`. */
    #tiles = new Map();
    #stale = new Map();

    constructor(canvas, world, camera) {
        Object.assign(this, { canvas, world, camera });
        this.context = canvas.getContext("2d", { alpha: false });
        world.voxels.watch({
            changed: chunk => this.#stale.set(`${chunk.x},${chunk.y}`, [chunk.x, chunk.y]),
            cleared: () => [this.#tiles, this.#stale].forEach(all => all.clear()),
        });
        for (const chunk of world.voxels.chunks()) this.#stale.set(`${chunk.x},${chunk.y}`, [chunk.x, chunk.y]);
    }

    /** Paints for a while what has changed, then draws; says whether there is more to paint. */
    draw(colours) {
        this.#resize();
        const { context, canvas, world } = this;
        const { shown } = world;
        this.#tile(colours);
        context.setTransform(1, 0, 0, 1, 0, 0);
        context.fillStyle = css(colours.ground);
        context.fillRect(0, 0, canvas.width, canvas.height);
        // From here on in metres, y up.
        const metre = canvas.height / this.camera.heightAtTarget();
        const [x, y] = this.camera.target;
        context.setTransform(metre, 0, 0, -metre, canvas.width / 2 - x * metre, canvas.height / 2 + y * metre);
        this.pixel = this.ratio / metre;
        this.#drawTiles();
        if (shown.has("grid")) this.#drawGrid(colours);
        if (shown.has("world") && world.surfaces) this.#drawWorld(colours);
        if (shown.has("scan")) this.#drawScan(colours);
        if (shown.has("way")) this.#stroke(world.way, colours.way, 2);
        if (shown.has("plan")) this.#drawPlan(colours);
        if (shown.has("drawings")) drawFlat(context, this.pixel, world);
        if (shown.has("robot") && world.robot) this.#drawRobot(colours);
        return this.#stale.size > 0;
    }

    #resize() {
        const { canvas } = this;
        this.ratio = Math.min(window.devicePixelRatio || 1, 2);
        const width = Math.max(1, Math.round(canvas.clientWidth * this.ratio));
        const height = Math.max(1, Math.round(canvas.clientHeight * this.ratio));
        if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    }

    /** Index of the layer at which the map is cut: as a person says, or just above the robot. */
    layer() {
        const { robot, voxels } = this.world;
        const clip = this.world.clipLayer();
        if (clip !== null || !robot || !voxels.resolution) return clip ?? Infinity;
        return Math.floor((robot.position[2] + HEADROOM) / voxels.resolution);
    }

    #tile(colours) {
        const layer = this.layer();
        const style = JSON.stringify([layer, colours, this.world.voxels.heights(), ...this.world.shown]);
        if (style !== this.style) {
            for (const { x, y } of this.world.voxels.chunks()) this.#stale.set(`${x},${y}`, [x, y]);
        }
        this.style = style;
        if (this.#stale.size === 0) return;
        const columns = new Map();
        for (const chunk of this.world.voxels.chunks()) {
            const key = `${chunk.x},${chunk.y}`;
            if (this.#stale.has(key)) columns.set(key, [...(columns.get(key) ?? []), chunk]);
        }
        const end = performance.now() + TILING_MS;
        for (const [key, [x, y]] of this.#stale) {
            const chunks = (columns.get(key) ?? []).sort((a, b) => b.z - a.z);
            if (!this.#tiles.has(key)) this.#tiles.set(key, { x, y, canvas: newTile() });
            this.#paint(this.#tiles.get(key).canvas, chunks, layer, colours);
            this.#stale.delete(key);
            if (performance.now() > end) break;
        }
    }

    /** Paints a column of chunks, the uppermost first: what is cut, else the first thing below, else that it is free. */
    #paint(tile, chunks, layer, colours) {
        const { voxels, shown } = this.world;
        const context = tile.getContext("2d");
        const image = context.createImageData(SIDE, SIDE);
        const pixels = new Uint32Array(image.data.buffer);
        const [low, high] = voxels.heights() ?? [0, 1];
        const [cut, free, frontier] = [colours.cut, colours.free, mix(colours.frontier, colours.free, PALE / 2)].map(
            pack,
        );
        const paint = (y, bits, colour) => {
            for (; bits !== 0; bits &= bits - 1) pixels[31 - Math.clz32(bits & -bits) + SIDE * (SIDE - 1 - y)] = colour;
        };
        for (let y = 0; y < SIDE; y++) {
            let open = -1,
                known = 0,
                edge = 0;
            for (const chunk of chunks) {
                for (let z = Math.min(SIDE - 1, layer - SIDE * chunk.z); z >= 0; z--) {
                    const row = y + SIDE * z;
                    const found = shown.has("occupied") ? chunk.occupied[row] & open : 0;
                    known |= chunk.known[row] & ~chunk.occupied[row] & open;
                    if (shown.has("frontier")) edge |= chunk.frontier[row] & open;
                    if (found === 0) continue;
                    const height = (SIDE * chunk.z + z + 1) * voxels.resolution;
                    const shade =
                        SIDE * chunk.z + z === layer
                            ? cut
                            : pack(mix(ofHeight((height - low) / (high - low)), colours.free, PALE));
                    paint(y, found, shade);
                    open &= ~found;
                }
            }
            paint(y, known & open, free);
            paint(y, edge, frontier);
        }
        context.putImageData(image, 0, 0);
    }

    #drawTiles() {
        const { context, world, canvas } = this;
        const side = SIDE * (world.voxels.resolution ?? 1);
        context.imageSmoothingEnabled = (context.getTransform().a * side) / SIDE < 1;
        const { a: metre, e: left, f: bottom } = context.getTransform();
        context.save();
        context.setTransform(1, 0, 0, 1, 0, 0);
        for (const { x, y, canvas: tile } of this.#tiles.values()) {
            // On whole pixels, so that no seam is between two tiles.
            const [x0, x1] = [x, x + 1].map(index => Math.round(left + index * side * metre));
            const [y1, y0] = [y, y + 1].map(index => Math.round(bottom - index * side * metre));
            if (x1 < 0 || y1 < 0 || x0 > canvas.width || y0 > canvas.height) continue;
            context.drawImage(tile, x0, y0, x1 - x0, y1 - y0);
        }
        context.restore();
    }

    /** Lines a metre (or ten, or a hundred) apart. */
    #drawGrid(colours) {
        const { context, canvas, camera } = this;
        const [height, width] = [camera.heightAtTarget(), (camera.heightAtTarget() * canvas.width) / canvas.height];
        const step = 10 ** Math.max(0, Math.ceil(Math.log10(width / 40)));
        const [left, bottom] = [camera.target[0] - width / 2, camera.target[1] - height / 2];
        context.beginPath();
        for (let x = Math.ceil(left / step) * step; x < left + width; x += step)
            line(context, x, bottom, x, bottom + height);
        for (let y = Math.ceil(bottom / step) * step; y < bottom + height; y += step)
            line(context, left, y, left + width, y);
        context.lineWidth = this.pixel;
        context.strokeStyle = css(colours.line, 0.45);
        context.stroke();
    }

    /** What the cut leaves of the true world: lines where its surfaces go through the height. */
    #drawWorld(colours) {
        const { context, pixel, world } = this;
        const height = world.clip ?? (world.robot ? world.robot.position[2] + HEADROOM : null);
        if (this.section?.surfaces !== world.surfaces || this.section.height !== height)
            this.section = { surfaces: world.surfaces, height, segments: sectionOf(world.surfaces, height) };
        context.beginPath();
        for (const [[x0, y0], [x1, y1]] of this.section.segments) line(context, x0, y0, x1, y1);
        context.lineWidth = 1.5 * pixel;
        context.strokeStyle = css(colours.ghost);
        context.stroke();
    }

    #drawScan(colours) {
        const {
            context,
            pixel,
            world: { scan },
        } = this;
        context.fillStyle = css(colours.ink, 0.7);
        for (let i = 0; i < scan.length; i += 3)
            context.fillRect(scan[i] - pixel, scan[i + 1] - pixel, 2 * pixel, 2 * pixel);
    }

    #stroke(points, colour, width, dash = []) {
        const { context, pixel } = this;
        context.beginPath();
        points.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
        context.lineWidth = width * pixel;
        context.lineJoin = "round";
        context.setLineDash(dash.map(part => part * pixel));
        context.strokeStyle = css(colour);
        context.stroke();
        context.setLineDash([]);
    }

    #drawPlan(colours) {
        const {
            context,
            pixel,
            world: { plan, target },
        } = this;
        this.#stroke(plan, colours.plan, 2, [6, 4]);
        if (target) disc(context, target, 5 * pixel, css(colours.plan));
    }

    #drawRobot(colours) {
        const {
            context,
            pixel,
            world: { robot },
        } = this;
        if (robot.camera) {
            const { eye, far } = frustumOf(robot);
            context.beginPath();
            for (const [x, y] of hull([eye, ...far])) context.lineTo(x, y);
            context.closePath();
            context.fillStyle = css(colours.robot, 0.14);
            context.fill();
            context.lineWidth = pixel;
            context.strokeStyle = css(colours.robot, 0.6);
            context.stroke();
        }
        disc(context, robot.position, 8 * pixel, css(colours.ground));
        disc(context, robot.position, 6 * pixel, css(colours.robot));
    }
}

function newTile() {
    return Object.assign(document.createElement("canvas"), { width: SIDE, height: SIDE });
}

/** A colour as canvases keep it in memory. */
function pack([red, green, blue]) {
    const [r, g, b] = [red, green, blue].map(part => Math.round(255 * part));
    return ((255 << 24) | (b << 16) | (g << 8) | r) >>> 0;
}

function line(context, x0, y0, x1, y1) {
    context.moveTo(x0, y0);
    context.lineTo(x1, y1);
}

function disc(context, [x, y], radius, style) {
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = style;
    context.fill();
}

/** The corners of the convex hull of points of the plan, against the clock (Andrew's monotone chain). */
function hull(points) {
    const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    const turn = ([ax, ay], [bx, by], [cx, cy]) => (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
    const chain = points =>
        points
            .reduce((chain, point) => {
                while (chain.length > 1 && turn(chain.at(-2), chain.at(-1), point) <= 0) chain.pop();
                return [...chain, point];
            }, [])
            .slice(0, -1);
    return [...chain(sorted), ...chain(sorted.reverse())];
}
