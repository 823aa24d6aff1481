// Keys that apps have declared: which there are, and what becomes of one that is pressed.

import { make } from "./dom.js";

export class AppKeys {
    /** As the server says: `{app, key, meaning, taken_by}`. */
    rows = [];
    #watchers = [];

    /** `say(text, mood)` tells a person. */
    constructor(link, orders, say) {
        Object.assign(this, { orders });
        link.on("keys", ({ rows }) => {
            const known = this.rows.filter(({ taken_by }) => taken_by).map(words);
            this.#become(rows);
            for (const row of rows) if (row.taken_by && !known.includes(words(row))) say(words(row), "bad");
        });
        const forget = () => this.#become([]);
        link.on("hello", forget);
        link.on("reset", forget);
    }

    /** Has `watcher()` called when there are other keys. */
    watch(watcher) {
        this.#watchers.push(watcher);
    }

    /** Presses a key for the app that has it; says whether there is one. */
    press(key, modifiers = {}) {
        const row = this.rows.find(row => row.key === key && !row.taken_by);
        if (row) this.orders.press(row, { shift: false, alt: false, ...modifiers });
        return row !== undefined;
    }

    #become(rows) {
        this.rows = rows;
        for (const watcher of this.#watchers) watcher();
    }

    /** The keys as a list of terms, each of which can be pressed by a hand as well. */
    list() {
        return this.rows.flatMap(row => {
            const button = make("button", {
                type: "button",
                class: "small",
                textContent: row.key,
                title: `Press ${row.key} for ${row.app}`,
                disabled: this.orders.readOnly || Boolean(row.taken_by),
                onclick: () => this.press(row.key),
            });
            const meaning = row.taken_by ? words(row) : `${row.app}: ${row.meaning}`;
            return [make("dt", {}, button), make("dd", { class: row.taken_by ? "alarm" : "", textContent: meaning })];
        });
    }
}

function words({ app, key, meaning, taken_by }) {
    return `${app} cannot have the key ${key} (${meaning}): ${taken_by} has declared it already`;
}
