// The voxels on the card: meshes the chunks that have changed bit by bit, and draws those that the camera sees.

import { Quads, word } from "./gl.js";
import { faces, freeRows, rowsWithout, section } from "./mesh.js";
import { ramp } from "./palette.js";
import { facing, frustum, length, sees, subtract } from "./vectors.js";
import { SIDE } from "./voxels.js";

const FRONTIER_ALPHA = 0.42;

export class Chunks {
    /** Chunks to mesh. */
    #queue = new Set();
    /** What is drawn of each chunk. */
    #pictures = new Map();
    /** Whether backs of walls are meshed as well. */
    #isClosed = false;

    constructor(stage, world) {
        Object.assign(this, { stage, world });
        world.voxels.watch({ changed: chunk => this.#queue.add(chunk), cleared: () => this.#forget() });
        world.watch(what => what === "shown" && this.#isClosed !== world.shown.has("closed") && this.remesh());
        this.remesh();
    }

    /** Has every chunk meshed again. */
    remesh() {
        this.#isClosed = this.world.shown.has("closed");
        for (const chunk of this.world.voxels.chunks()) this.#queue.add(chunk);
    }

    /** As `remesh`, and nothing is on the card. */
    restart() {
        this.#pictures.clear();
        this.remesh();
    }

    /** Chunks that are not meshed yet. */
    get waiting() {
        return this.#queue.size;
    }

    /** Rectangles on the card. */
    get rectangles() {
        return [...this.#pictures.values()].reduce(
            (sum, { occupied, frontier }) => sum + occupied.count + frontier.count,
            0,
        );
    }

    #forget() {
        for (const { occupied, frontier, cut } of this.#pictures.values())
            [occupied, frontier, cut].forEach(quads => quads.free());
        this.#pictures.clear();
        this.#queue.clear();
    }

    /** Meshes waiting chunks for some milliseconds, those near the camera's target first. */
    meshFor(ms) {
        if (this.#queue.size === 0) return;
        const end = performance.now() + ms;
        const far = chunk => length(subtract(this.#middle(chunk), this.stage.camera.target));
        const nearest = [...this.#queue].map(chunk => [far(chunk), chunk]).sort(([a], [b]) => a - b);
        for (const [, chunk] of nearest) {
            this.#mesh(chunk);
            this.#queue.delete(chunk);
            if (performance.now() > end) break;
        }
    }

    #mesh(chunk) {
        const { voxels } = this.world;
        const picture = this.#pictures.get(chunk) ?? this.#newPicture(chunk);
        // The back of a wall, which nobody has seen, would hide the room behind it.
        const outside = this.#isClosed || voxels.known === 0 ? rowsWithout("occupied") : freeRows;
        this.#put(picture.occupied, faces(voxels, chunk, "occupied", outside));
        this.#put(picture.frontier, faces(voxels, chunk, "frontier", rowsWithout("frontier")));
        picture.cutLayer = null;
    }

    #put(quads, { words, ends }) {
        quads.set(words);
        quads.ends = ends;
    }

    #newPicture(chunk) {
        const quads = () => new Quads(this.stage.gl, this.stage.indices, word);
        const picture = { occupied: quads(), frontier: quads(), cut: quads(), cutLayer: null };
        this.#pictures.set(chunk, picture);
        return picture;
    }

    #middle(chunk) {
        return [chunk.x, chunk.y, chunk.z].map(index => (index + 0.5) * SIDE * this.world.voxels.resolution);
    }

    /** Looks which chunks the camera sees: the nearest first, so that they hide the others before these are painted. */
    look() {
        const planes = frustum(this.stage.matrix);
        const eye = this.stage.camera.eye();
        const half = (SIDE / 2) * this.world.voxels.resolution;
        const top = this.world.clip ?? Infinity;
        this.visible = [];
        for (const [chunk, picture] of this.#pictures) {
            const middle = this.#middle(chunk);
            if (
                middle[2] - half > top ||
                !sees(
                    planes,
                    middle.map(x => x - half),
                    middle.map(x => x + half),
                )
            )
                continue;
            this.visible.push({
                chunk,
                picture,
                far: length(subtract(middle, eye)),
                facing: facing(middle, half, eye),
            });
        }
        this.visible.sort((a, b) => a.far - b.far);
    }

    drawOccupied(colours) {
        this.heights = this.world.voxels.heights() ?? [0, 1];
        this.#draw(colours, [0, 0, 0, 0], 1, picture => picture.occupied);
        if (this.world.clip !== null)
            this.#draw(colours, [...colours.cut, 1], 1, (picture, chunk) => this.#cut(picture, chunk));
    }

    drawFrontier(colours) {
        const { gl } = this.stage;
        gl.enable(gl.BLEND);
        gl.depthMask(false);
        this.#draw(colours, [...colours.frontier, 1], FRONTIER_ALPHA, picture => picture.frontier);
        gl.depthMask(true);
        gl.disable(gl.BLEND);
    }

    /** What the clipping plane has cut of a chunk. */
    #cut(picture, chunk) {
        const layer = this.world.clipLayer() - SIDE * chunk.z;
        if (layer < 0 || layer >= SIDE) return null;
        if (picture.cutLayer !== layer) picture.cut.set(section(chunk.occupied, layer));
        picture.cutLayer = layer;
        return picture.cut;
    }

    /** `tint`: a colour, and how much of it is mixed in. */
    #draw(colours, tint, alpha, quadsOf) {
        const { gl, camera } = this.stage;
        const { resolution } = this.world.voxels;
        const { origin, ramp: steps } = this.stage.use("FACES", {
            resolution: resolution ?? 1,
            // A little more than the height of a face that lies in the plane.
            clip: this.world.clip === null ? 1e9 : (this.world.clipLayer() + 1.01) * resolution,
            heights: this.heights,
            tint,
            alpha,
            eye: [...camera.eye(), 1.6 * camera.distance],
            ground: colours.ground,
        });
        gl.uniform3fv(steps, ramp);
        for (const { chunk, picture, facing } of this.visible) {
            const quads = quadsOf(picture, chunk);
            if (!quads?.count) continue;
            gl.uniform3f(origin, chunk.x * SIDE, chunk.y * SIDE, chunk.z * SIDE);
            if (quads.ends) drawFacing(quads, facing);
            else quads.draw();
        }
    }
}

/** Draws the quads of the faces that may be seen, those of neighbouring faces in one go. */
function drawFacing(quads, facing) {
    let from = 0;
    quads.ends.forEach((end, face) => {
        if (facing[face] && facing[face + 1]) return;
        if (facing[face]) quads.draw(from, end);
        from = end;
    });
}
