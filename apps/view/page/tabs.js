// Tabs by the pattern that screen readers know: arrow keys choose, the panel follows.

import { make } from "./dom.js";

export class Tabs {
    #shown = new Map();

    constructor(list, panels) {
        Object.assign(this, { list, panels, current: null });
        list.addEventListener("keydown", event => this.#key(event));
    }

    /** Adds a tab and returns its empty panel; `shown(is)` is called when the panel comes and goes. */
    add(id, name, shown = () => {}) {
        const tab = make("button", {
            type: "button",
            id: `tab-${id}`,
            role: "tab",
            textContent: name,
            "aria-selected": "false",
            "aria-controls": `panel-${id}`,
            tabIndex: -1,
            onclick: () => this.show(id),
        });
        const panel = make("section", {
            id: `panel-${id}`,
            role: "tabpanel",
            tabIndex: 0,
            "aria-labelledby": `tab-${id}`,
            hidden: true,
        });
        this.list.append(tab);
        this.panels.append(panel);
        this.#shown.set(id, shown);
        return panel;
    }

    show(id) {
        const before = this.current;
        this.current = id;
        for (const tab of this.list.children) {
            const chosen = tab.id === `tab-${id}`;
            tab.setAttribute("aria-selected", chosen);
            tab.tabIndex = chosen ? 0 : -1;
        }
        for (const panel of this.panels.children) panel.hidden = panel.id !== `panel-${id}`;
        if (before !== null && before !== id) this.#shown.get(before)(false);
        this.#shown.get(id)(true);
    }

    #key(event) {
        const tabs = [...this.list.children];
        const at = tabs.findIndex(tab => tab.id === `tab-${this.current}`);
        const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: -1 }[event.key];
        if (to === undefined) return;
        event.preventDefault();
        const tab = tabs.at(to % tabs.length);
        this.show(tab.id.slice("tab-".length));
        tab.focus();
    }
}
