// The picture of the world: which view is shown, the buttons around it, and when it is drawn: only if something has changed.

import { Camera } from "./camera.js";
import { control } from "./controls.js";
import { make, say } from "./dom.js";
import { scheme } from "./palette.js";
import { Plan2d } from "./plan2d.js";
import { Scene } from "./scene.js";
import { LAYERS } from "./world.js";

const by = id => document.getElementById(id);
/** Layers that the server need not send while they are hidden. */
const SENT = ["scan"];
/** Frames that take longer than this (ms) are drawn at half the resolution while something moves. */
const SLOW_MS = 60;
/** After the last movement, until the picture is drawn in full (ms). */
const STILL_MS = 200;

export class Stage {
    #pending = false;
    #settle = 0;
    #shownVersion = -1;
    #lastFrame = 0;
    /** Time between two frames that came one after the other (ms). */
    #frameMs = 0;

    /** For whoever measures: frames so far, and when the first one and the first whole one with voxels were drawn (ms). */
    frames = 0;
    whenFirst = null;
    whenWhole = null;

    constructor({ link, world, tell }) {
        Object.assign(this, { link, world });
        this.camera = new Camera(by => this.#moved(by));
        this.flat = new Plan2d(by("flat"), world, this.camera);
        try {
            this.scene = new Scene(by("scene"), world, this.camera);
        } catch (error) {
            this.scene = null;
            tell(`The map is shown from above: ${error.message}`);
        }
        control(by("scene"), this.camera, { flat: false });
        control(by("flat"), this.camera, { flat: true });
        this.#makeButtons();
        this.#makeLayers();
        this.#makeHeight();
        world.watch(what => this.#worldChanged(what));
        new ResizeObserver(() => this.redraw()).observe(by("stage"));
        link.on("hello", () => this.#askForLayers());
        const recolour = () => {
            this.colours = scheme();
            this.redraw();
        };
        addEventListener("scheme", recolour);
        recolour();
        this.showFlat(this.scene === null);
    }

    redraw() {
        if (this.#pending) return;
        this.#pending = true;
        requestAnimationFrame(now => this.#frame(now));
    }

    showFlat(flat) {
        this.isFlat = flat || this.scene === null;
        by("scene").hidden = this.isFlat;
        by("flat").hidden = !this.isFlat;
        by("view-3d").setAttribute("aria-pressed", !this.isFlat);
        by("view-2d").setAttribute("aria-pressed", this.isFlat);
        this.redraw();
    }

    follow(follows = !this.camera.follows) {
        this.camera.move({ follows });
        this.#lookAtRobot();
    }

    whole() {
        this.camera.release();
        this.#fit();
    }

    /** Cuts the map some layers higher or lower than now. */
    moveClip(layers) {
        const { resolution } = this.world.voxels;
        const clip = by("clip");
        if (resolution === null || clip.disabled) return;
        this.#clipAt((this.world.clip ?? Number(clip.max)) + layers * resolution);
    }

    unclip() {
        this.world.clipAt(null);
    }

    toggleLayer(layer) {
        this.world.show(layer, !this.world.shown.has(layer));
    }

    #frame(now) {
        this.#pending = false;
        // A frame that was asked for long after the last one says nothing of how long a frame takes.
        if (now - this.#lastFrame < 1500) this.#frameMs = now - this.#lastFrame;
        this.#lastFrame = now;
        this.#keepUp();
        const moving = now < this.#settle;
        const share = moving && this.#frameMs > SLOW_MS ? 0.5 : 1;
        const more = this.isFlat ? this.flat.draw(this.colours) : this.scene.draw(this.colours, share, this.#frameMs);
        this.frames += 1;
        if (this.world.voxels.occupied > 0) this.whenFirst ??= performance.now();
        if (!more && this.world.voxels.occupied > 0) this.whenWhole ??= performance.now();
        if (more) this.redraw();
        else if (share < 1) setTimeout(() => this.redraw(), STILL_MS);
    }

    /** What goes with the size of the map, once a frame however many messages came. */
    #keepUp() {
        const { version } = this.world.voxels;
        if (version === this.#shownVersion) return;
        this.#shownVersion = version;
        this.#showHeight();
        if (!this.camera.touched) this.#fit();
    }

    #moved(who) {
        if (who === "hand") this.#settle = performance.now() + STILL_MS;
        by("follow").setAttribute("aria-pressed", this.camera.follows);
        this.redraw();
    }

    #worldChanged(what) {
        if (what === "shown") this.#showLayers();
        if (what === "world") {
            by("empty").hidden = this.world.voxels.known + this.world.voxels.occupied > 0 || this.world.robot !== null;
            this.#lookAtRobot();
        }
        if (what === "clip") this.#showHeight();
        this.redraw();
    }

    #lookAtRobot() {
        const { robot } = this.world;
        if (!this.camera.follows || robot === null) return;
        this.camera.target = [...robot.position];
        this.redraw();
    }

    #fit() {
        const box = this.world.voxels.bounds();
        const stage = by("stage");
        if (box) this.camera.fit(box, stage.clientWidth / stage.clientHeight);
    }

    #askForLayers() {
        this.link.send({ type: "show", layers: SENT.filter(layer => this.world.shown.has(layer)) });
    }

    // The buttons.

    #makeButtons() {
        const on = (id, action) => by(id).addEventListener("click", action);
        on("view-3d", () => this.showFlat(false));
        on("view-2d", () => this.showFlat(true));
        on("follow", () => this.follow());
        on("whole", () => this.whole());
        on("zoom-in", () => this.camera.zoom(0.8));
        on("zoom-out", () => this.camera.zoom(1.25));
        if (this.scene === null) Object.assign(by("view-3d"), { disabled: true, title: "This browser has no WebGL 2" });
    }

    #makeLayers() {
        this.boxes = {};
        const labels = Object.entries(LAYERS).map(([layer, { name, key }]) => {
            const box = make("input", { type: "checkbox", onchange: () => this.world.show(layer, box.checked) });
            const swatch = make("i");
            if (!["occupied", "closed"].includes(layer)) swatch.style.setProperty("--swatch", `var(--${{ scan: "ink", grid: "line" }[layer] ?? layer})`);
            this.boxes[layer] = box;
            return make("label", { title: `Key ${key}` }, box, name, swatch);
        });
        by("layers").querySelector("div").append(...labels);
        by("layers").open = matchMedia("(min-width: 761px)").matches;
        this.#showLayers();
    }

    #showLayers() {
        const { shown } = this.world;
        for (const [layer, box] of Object.entries(this.boxes)) box.checked = shown.has(layer);
        if (shown.has("closed") !== this.closed) this.scene?.chunks.remesh();
        this.closed = shown.has("closed");
        this.#askForLayers();
    }

    #makeHeight() {
        const clip = by("clip");
        clip.addEventListener("input", () => this.#clipAt(Number(clip.value)));
    }

    #clipAt(height) {
        const { min, max } = by("clip");
        this.world.clipAt(height >= Number(max) - 1e-6 ? null : Math.max(height, Number(min)));
    }

    #showHeight() {
        const { voxels, clip } = this.world;
        const heights = voxels.heights();
        const input = by("clip");
        input.disabled = heights === null;
        if (heights === null) return;
        const [low, high] = heights;
        Object.assign(input, { min: low, max: high, step: voxels.resolution });
        input.value = clip ?? high;
        const words = height => `${height.toFixed(2)} m`;
        input.setAttribute("aria-valuetext", clip === null ? "all" : words(clip));
        say(by("height-high"), clip === null ? words(high) : `≤ ${words(clip)}`);
        say(by("height-low"), words(low));
    }
}
