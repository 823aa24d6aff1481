// The bar of a recorded run: play, pause, scrub, rate, loop.

import { duration, make, say } from "../dom.js";

const RATES = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16];
/** Between two places that a hand on the slider asks for (ms). */
const SEEK_MS = 80;

export function timeline(bar, { link }) {
    let now = null,
        held = false,
        asked = 0;
    const play = make("button", {
        type: "button",
        textContent: "Play",
        title: "Play or pause (space)",
        onclick: () => toggle(),
    });
    const scrub = make("input", { type: "range", min: 0, max: 1000, step: "any", "aria-label": "Time" });
    const time = make("output");
    const rate = make(
        "select",
        { "aria-label": "Rate", onchange: () => send({ rate: Number(rate.value) }) },
        ...RATES.map(rate => make("option", { value: rate, textContent: `${rate} ×` })),
    );
    const loop = make("input", { type: "checkbox", onchange: () => send({ looping: loop.checked }) });
    const element = make(
        "div",
        { class: "card timeline", role: "toolbar", "aria-label": "Time line", hidden: true },
        play,
        scrub,
        time,
        rate,
        make("label", {}, loop, "Loop"),
    );
    bar.append(element);

    const send = change => {
        if (now === null) return;
        const { playing, rate, looping } = { ...now, ...change };
        link.send({ type: "play", playing, rate, looping });
    };
    const toggle = () => send({ playing: !now?.playing });
    const seek = to => {
        if (now === null) return;
        now.at = Math.max(now.start, Math.min(now.end, to));
        show();
        clearTimeout(asked);
        asked = setTimeout(() => {
            asked = 0;
            link.send({ type: "seek", time: now.at });
        }, SEEK_MS);
    };
    const show = () => {
        say(play, now.playing ? "Pause" : "Play");
        Object.assign(scrub, { min: now.start, max: now.end });
        scrub.value = now.at;
        scrub.setAttribute("aria-valuetext", duration(now.at - now.start));
        say(time, `${duration(now.at - now.start)} / ${duration(now.end - now.start)}`);
        if (!RATES.includes(now.rate)) rate.append(make("option", { value: now.rate, textContent: `${now.rate} ×` }));
        rate.value = now.rate;
        loop.checked = now.looping;
    };
    scrub.addEventListener("input", () => seek(Number(scrub.value)));
    scrub.addEventListener("pointerdown", () => (held = true));
    for (const end of ["pointerup", "pointercancel"]) scrub.addEventListener(end, () => (held = false));
    scrub.addEventListener("keydown", event => {
        const by = { ArrowLeft: -1, ArrowRight: 1, PageUp: -10, PageDown: 10 }[event.key];
        if (!by || now === null) return;
        event.preventDefault();
        seek(now.at + by);
    });
    link.on("hello", ({ recorded }) => {
        now = null;
        element.hidden = recorded === null || recorded === undefined;
    });
    link.on("timeline", message => {
        // A hand on the slider, or one that has just been there, knows better where it is.
        now = held || asked ? { ...message, at: now?.at ?? message.at } : message;
        show();
    });
    return { isShown: () => !element.hidden, toggle };
}
