// The bar of a live mission: pause, step, resume.

import { make } from "../dom.js";

const COMMANDS = [
    ["pause", "Pause", "Hold the robot before its next pose (space)"],
    ["step", "Step", "One pose more (N)"],
    ["resume", "Resume", "Go on (space)"],
];

export function steering(bar, { link, orders }) {
    const buttons = COMMANDS.map(([command, name, title]) =>
        make("button", { type: "button", textContent: name, title, onclick: () => give(command) }),
    );
    const element = make("div", { class: "card", role: "toolbar", "aria-label": "Steering", hidden: true }, ...buttons);
    bar.append(element);
    let paused = false;
    const give = command => orders.order({ command }, COMMANDS.find(([name]) => name === command)[1]);
    const show = now => {
        paused = now;
        buttons[0].setAttribute("aria-pressed", paused);
    };
    link.on("hello", () => {
        element.hidden = orders.readOnly;
        show(false);
    });
    link.on("progress", ({ phase }) => show(/pause/i.test(phase ?? "")));
    link.on("end", () => (element.hidden = true));
    return {
        isShown: () => !element.hidden,
        toggle: () => give(paused ? "resume" : "pause"),
        step: () => give("step"),
    };
}
