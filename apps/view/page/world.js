// The model: what the server has said of map and robot, and what of it a person wants to see. Views are told of changes.

import { Drawings } from "./drawings.js";
import { Voxels } from "./voxels.js";

/** What can be shown and hidden: its name on the page, the key that switches it, and its colour, if it has only one. */
export const LAYERS = {
    occupied: { name: "Occupied", key: "1", shown: true },
    frontier: { name: "Frontier", key: "2", shown: true, colour: "frontier" },
    robot: { name: "Robot", key: "3", shown: true, colour: "robot" },
    way: { name: "Way", key: "4", shown: true, colour: "way" },
    plan: { name: "Plan", key: "5", shown: true, colour: "plan" },
    scan: { name: "Scan", key: "6", shown: true, colour: "ink" },
    grid: { name: "Grid", key: "7", shown: true, colour: "line" },
    drawings: { name: "Drawings", key: "9", shown: true },
    closed: { name: "Backs of walls", key: "8", shown: false },
    world: { name: "True world", key: "0", shown: false, colour: "ghost" },
};

export class World {
    #watchers = [];

    voxels = new Voxels();
    drawings = new Drawings();
    shown = new Set(Object.keys(LAYERS).filter(layer => LAYERS[layer].shown));
    /** Surfaces of the world that a simulated sensor sees, or null: only a page that shows them has them. */
    surfaces = null;
    /** Height (m) above which nothing is shown, or null. */
    clip = null;

    constructor(link) {
        this.#forget();
        link.on("hello", () => {
            this.surfaces = null;
            this.forget();
        });
        link.on("reset", () => this.forget());
        link.on("bricks", message => this.#change(() => this.voxels.take(message)));
        link.on("world", ({ ok }) => ok || this.#change(() => (this.surfaces = null)));
        link.on("surfaces", surfaces => this.#change(() => this.shown.has("world") && (this.surfaces = surfaces)));
        link.on("scan", ({ points }) => this.#change(() => (this.scan = points)));
        link.on("robot", robot => this.#change(() => (this.robot = robot)));
        link.on("way", ({ from, points }) => this.#change(() => replaceFrom(this.way, from, points)));
        link.on("drawing", drawing => this.#change(() => this.drawings.take(drawing), "drawings"));
        link.on("drawings", ({ rows }) => this.#change(() => this.drawings.keepListed(rows), "drawings"));
        link.on("plan", ({ points, target }) => this.#change(() => Object.assign(this, { plan: points, target })));
    }

    /** Has `watcher(what)` called when anything is other than it was: `world`, `drawings`, `shown` or `clip`. */
    watch(watcher) {
        this.#watchers.push(watcher);
    }

    forget() {
        this.#change(() => {
            this.voxels.clear();
            this.#forget();
        });
        this.#change(() => this.drawings.clear(), "drawings");
    }

    /** Shows or hides some drawings. */
    showDrawings(drawings, shown) {
        this.#change(() => drawings.forEach(one => this.drawings.show(one, shown)), "drawings");
    }

    show(layer, shown) {
        if (shown) this.shown.add(layer);
        else this.shown.delete(layer);
        if (!this.shown.has("world")) this.surfaces = null;
        this.#tell("shown");
    }

    clipAt(height) {
        this.clip = height;
        this.#tell("clip");
    }

    /** Index of the uppermost layer of voxels that is shown, or null for all. */
    clipLayer() {
        if (this.clip === null || this.voxels.resolution === null) return null;
        return Math.round(this.clip / this.voxels.resolution) - 1;
    }

    #forget() {
        this.robot = null;
        this.way = [];
        this.plan = [];
        this.target = null;
        this.scan = new Float32Array(0);
    }

    #change(change, what = "world") {
        try {
            change();
        } finally {
            this.#tell(what);
        }
    }

    #tell(what) {
        for (const watcher of this.#watchers) watcher(what);
    }
}

/** Puts `points` in place of all that `list` has from index `from` on. */
export function replaceFrom(list, from, points) {
    if (from > list.length) throw new Error(`points from ${from} on, but only ${list.length} are known`);
    list.length = from;
    for (const point of points) list.push(point);
}
