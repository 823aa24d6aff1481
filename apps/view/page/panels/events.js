// What has happened, the latest first: the mission's events, answers to orders, and what the page has to say of itself.

import { duration, make } from "../dom.js";

const MOST_EVENTS = 500;
const TOAST_MS = 6000;

export class Events {
    constructor(panel, toasts, link) {
        this.list = make("ol", { class: "events", reversed: true });
        Object.assign(this, { toasts, problems: 0 });
        panel.append(this.list);
        link.on("event", ({ time, text }) => this.note(text, "", duration(time), "mission"));
        link.on("problem", ({ text }) => {
            this.problems += 1;
            this.say(text, "bad");
        });
        // The server says again what has happened in the mission; what the page has said stays.
        link.on("hello", () => {
            for (const item of this.list.querySelectorAll("[data-from=mission]")) item.remove();
            this.note("Connected", "", "page");
        });
    }

    /** Tells a person at once, and keeps it among the events. What is said again is counted. */
    say(text, mood = "") {
        this.note(text, mood, "page");
        const toast =
            [...this.toasts.children].find(({ textContent }) => textContent === text) ??
            make("p", { textContent: text });
        toast.className = mood;
        clearTimeout(toast.timer);
        toast.timer = setTimeout(() => toast.remove(), TOAST_MS);
        this.toasts.append(toast);
        while (this.toasts.children.length > 4) this.toasts.firstChild.remove();
    }

    note(text, mood, when, from = "page") {
        const last = this.list.firstChild;
        if (last?.text === text && last.dataset.from === from) {
            last.times += 1;
            last.lastChild.textContent = `${text} (${last.times} times)`;
            return;
        }
        const item = make(
            "li",
            { class: mood, "data-from": from },
            make("time", { textContent: when }),
            make("span", { class: mood, textContent: text }),
        );
        this.list.prepend(Object.assign(item, { text, times: 1 }));
        if (this.list.children.length > MOST_EVENTS) this.list.lastChild.remove();
    }
}
