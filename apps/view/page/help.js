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

/** What opens the help; `appKeys` are those of the apps. */
export function help(dialog, appKeys) {
    const ofApps = make("dl", { class: "keys", id: "app-keys" });
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
            make("h2", { textContent: "Keys of the apps" }),
            ofApps,
            make(
                "form",
                { method: "dialog", class: "buttons" },
                // What has the focus when the help opens is not to be the first key of an app.
                make("button", { type: "submit", class: "primary", textContent: "Close", autofocus: true }),
            ),
        ),
    );
    dialog.addEventListener("click", event => {
        if (event.target === dialog) dialog.close();
    });
    const showKeys = () => {
        const keys = appKeys.list();
        ofApps.replaceChildren(...keys);
        ofApps.previousElementSibling.hidden = keys.length === 0;
    };
    appKeys.watch(() => dialog.open && showKeys());
    return () => {
        showKeys();
        dialog.showModal();
    };
}
