// The picture of the world: which of the two views is shown, and when it is drawn, which is only if something has changed.

import { Camera } from "./camera.js";
import { control } from "./controls.js";
import { drawingList } from "./drawings.js";
import { scheme } from "./palette.js";
import { Plan2d } from "./plan2d.js";
import { Scene } from "./scene.js";
import { heightSlider, layerSwitches, viewButtons } from "./viewbar.js";

const by = id => document.getElementById(id);
/** A frame that comes later than this (ms) after it was asked for is slow: while a hand moves, half the resolution does. */
const SLOW_MS = 60;
/** How long the picture of a state that is to be forgotten is kept in sight, at most, until the next one is whole (ms). */
const HOLD_MS = 1000;
/** After the last movement, until the picture is drawn in full (ms). */
const STILL_MS = 200;

export class Stage {
    /** When the next frame was asked for, or null. */
    #asked = null;
    /** Until when a hand is taken to move the camera. */
    #movingUntil = 0;
    #shownVersion = -1;
    #heldUntil = 0;

    /** For whoever measures: frames so far, and when the first one and the first whole one with voxels were drawn (ms). */
    frames = 0;
    whenFirst = null;
    whenWhole = null;

    constructor({ link, world, tell }) {
        this.world = world;
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
        this.buttons = viewButtons(this);
        this.height = heightSlider(world);
        layerSwitches(world, link);
        drawingList(world);
        world.watch(what => this.#worldChanged(what));
        link.on("world", ({ ok, text }) => text && tell(text, ok ? undefined : "bad"));
        for (const end of ["hello", "reset"]) link.on(end, () => (this.#heldUntil = performance.now() + HOLD_MS));
        link.on("frame", () => (this.#heldUntil = 0));
        new ResizeObserver(() => this.redraw()).observe(by("stage"));
        addEventListener("scheme", () => this.#recolour());
        this.#recolour();
        this.showFlat(this.scene === null);
    }

    redraw() {
        if (this.#asked !== null) return;
        this.#asked = performance.now();
        requestAnimationFrame(now => this.#frame(now));
    }

    showFlat(flat) {
        this.isFlat = flat || this.scene === null;
        by("scene").hidden = this.isFlat;
        by("flat").hidden = !this.isFlat;
        this.buttons.show();
        this.redraw();
    }

    follow(follows = !this.camera.follows) {
        this.camera.move({ follows });
        this.#lookAtRobot();
    }

    /** Shows the whole map, and keeps to that as it grows. */
    whole() {
        this.camera.release();
        this.#fit();
    }

    #frame(now) {
        const late = now - this.#asked;
        this.#asked = null;
        if (now < this.#heldUntil) return this.redraw();
        this.#keepUp();
        const share = now < this.#movingUntil && late > SLOW_MS ? 0.5 : 1;
        const more = this.isFlat ? this.flat.draw(this.colours) : this.scene.draw(this.colours, share, late);
        this.frames += 1;
        if (this.world.voxels.occupied > 0) this.whenFirst ??= performance.now();
        if (this.world.voxels.occupied > 0 && !more) this.whenWhole ??= performance.now();
        if (more) this.redraw();
        else if (share < 1) setTimeout(() => this.redraw(), STILL_MS);
    }

    /** What goes with the size of the map, once a frame however many messages came. */
    #keepUp() {
        const { version } = this.world.voxels;
        if (version === this.#shownVersion) return;
        this.#shownVersion = version;
        this.height.show();
        if (!this.camera.touched) this.#fit();
    }

    #fit() {
        const box = this.world.voxels.bounds();
        const { clientWidth, clientHeight } = by("stage");
        if (box) this.camera.fit(box, clientWidth / clientHeight);
    }

    #moved(who) {
        if (who === "hand") this.#movingUntil = performance.now() + STILL_MS;
        this.buttons.show();
        this.redraw();
    }

    #worldChanged(what) {
        const { robot, voxels } = this.world;
        if (what === "world") {
            by("empty").hidden = voxels.known + voxels.occupied > 0 || robot !== null;
            this.#lookAtRobot();
        }
        this.redraw();
    }

    #lookAtRobot() {
        const { robot } = this.world;
        if (!this.camera.follows || robot === null) return;
        this.camera.target = [...robot.position];
        this.redraw();
    }

    #recolour() {
        this.colours = scheme();
        this.redraw();
    }
}
