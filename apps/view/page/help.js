// The keys, under `?`.

import { make } from "./dom.js";
import { LAYERS } from "./world.js";

const KEYS = [
    ["drag, one finger, arrow keys", "turn the map; move it in 2-D"],
    ["right drag, Shift + drag, two fingers, Shift + arrow keys", "move the map"],
    ["wheel, pinch, + and −", "nearer and farther"],
    ["V", "3-D or 2-D"],
    ["F", "stay with the robot"],
    ["H", "the whole map"],
    ["[ and ]", "cut the map lower or higher; \\ shows all of it"],
    ...Object.values(LAYERS).map(({ key, name }) => [key, `show or hide: ${name}`]),
    ["space", "pause or resume the mission; play or pause a recorded run"],
    ["N", "one step of a mission that is paused"],
    ["/", "search the variables"],
    ["T", "dark, light, or as the system"],
    ["?", "this help"],
];

export function help(dialog) {
    const rows = KEYS.flatMap(([keys, meaning]) => [
        make("dt", {}, make("kbd", { textContent: keys })),
        make("dd", { textContent: meaning }),
    ]);
    dialog.replaceChildren(
        make(
            "div",
            {},
            make("h2", { id: "help-title", textContent: "Keys" }),
            make("p", {
                class: "quiet",
                textContent: "Tab goes from one control to the next; the map takes arrow keys once it has the focus.",
            }),
            make("dl", { class: "keys" }, ...rows),
            make(
                "form",
                { method: "dialog", class: "buttons" },
                make("button", { type: "submit", class: "primary", textContent: "Close" }),
            ),
        ),
    );
    dialog.addEventListener("click", event => {
        if (event.target === dialog) dialog.close();
    });
    return () => dialog.showModal();
}
