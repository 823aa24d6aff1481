// What lies over the picture: buttons of the view, switches of the layers, and the slider that cuts the map at a height.

import { make, say } from "./dom.js";
import { LAYERS } from "./world.js";

const by = id => document.getElementById(id);
/** Layers that the server need not send while they are hidden. */
const SENT = ["scan", "drawings", "world"];

/** The buttons; `show()` has them say how the stage is. */
export function viewButtons(stage) {
    const on = (id, action) => by(id).addEventListener("click", action);
    on("view-3d", () => stage.showFlat(false));
    on("view-2d", () => stage.showFlat(true));
    on("follow", () => stage.follow());
    on("whole", () => stage.whole());
    on("zoom-in", () => stage.camera.zoom(0.8));
    on("zoom-out", () => stage.camera.zoom(1.25));
    if (stage.scene === null) Object.assign(by("view-3d"), { disabled: true, title: "This browser has no WebGL 2" });
    return {
        show() {
            by("view-3d").setAttribute("aria-pressed", !stage.isFlat);
            by("view-2d").setAttribute("aria-pressed", stage.isFlat);
            by("follow").setAttribute("aria-pressed", stage.camera.follows);
        },
    };
}

export function layerSwitches(world, link) {
    const boxes = {};
    const labels = Object.entries(LAYERS).map(([layer, { name, key, colour }]) => {
        boxes[layer] = make("input", { type: "checkbox", onchange: event => world.show(layer, event.target.checked) });
        const swatch = make("i");
        if (colour) swatch.style.background = `var(--${colour})`;
        return make("label", { title: `Key ${key}` }, boxes[layer], name, swatch);
    });
    by("layers")
        .querySelector("div")
        .append(...labels);
    by("layers").open = matchMedia("(min-width: 761px) and (min-height: 561px)").matches;
    const ask = () => link.send({ type: "show", layers: SENT.filter(layer => world.shown.has(layer)) });
    const show = () => Object.entries(boxes).forEach(([layer, box]) => (box.checked = world.shown.has(layer)));
    link.on("hello", ask);
    world.watch(what => {
        if (what !== "shown") return;
        show();
        ask();
    });
    show();
}

/** The slider; `show()` has it say how high the map is, `move(layers)` cuts it lower or higher than now. */
export function heightSlider(world) {
    const input = by("clip");
    const cut = height => world.clipAt(height >= Number(input.max) - 1e-6 ? null : Math.max(height, Number(input.min)));
    input.addEventListener("input", () => cut(Number(input.value)));
    const words = height => `${height.toFixed(2)} m`;
    const show = () => {
        const heights = world.voxels.heights();
        input.disabled = heights === null;
        if (heights === null) return;
        const [low, high] = heights;
        Object.assign(input, { min: low, max: high, step: world.voxels.resolution });
        input.value = world.clip ?? high;
        input.setAttribute("aria-valuetext", world.clip === null ? "all" : words(world.clip));
        say(by("height-high"), world.clip === null ? words(high) : `≤ ${words(world.clip)}`);
        say(by("height-low"), words(low));
    };
    world.watch(what => what === "clip" && show());
    return {
        show,
        move(layers) {
            if (!input.disabled) cut((world.clip ?? Number(input.max)) + layers * world.voxels.resolution);
        },
    };
}
