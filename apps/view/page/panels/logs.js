// The text log of one app at a time, which is asked for only while it is looked at.

import { keep, make } from "../dom.js";

const MOST_LINES = 5000;

export function logsPanel(panel, { link }) {
    let app = null,
        next = 0,
        names = [];
    const choice = make("select", { onchange: () => choose(choice.value) });
    const text = make("pre", { class: "log", tabIndex: 0, "aria-label": "Log" });
    panel.append(make("div", { class: "row" }, make("label", {}, "App", choice)), text);

    const ask = () => link.send({ type: "logs", app: panel.hidden ? null : app });
    const choose = name => {
        app = name;
        next = 0;
        choice.value = name;
        text.replaceChildren();
        ask();
    };
    link.on("apps", ({ rows }) => {
        // The launcher speaks to the terminal.
        names = rows.filter(({ type }) => type !== "launcher").map(({ name }) => name);
        keep(
            choice,
            names,
            name => name,
            name => make("option", { value: name, textContent: name }),
            () => {},
        );
        if (app === null && names.length > 0) choose((rows.find(({ element }) => element) ?? rows[0]).name);
    });
    link.on("log", message => {
        if (message.app !== app) return;
        const atEnd = text.scrollTop + text.clientHeight >= text.scrollHeight - 20;
        if (message.from < next) text.replaceChildren();
        const gap = message.from > next && next > 0 ? ["…"] : [];
        text.append(...[...gap, ...message.lines].map(line => `${line}\n`));
        while (text.childNodes.length > MOST_LINES) text.firstChild.remove();
        next = message.from + message.lines.length;
        if (atEnd) text.scrollTop = text.scrollHeight;
    });
    link.on("hello", () => {
        next = 0;
        text.replaceChildren();
        if (app !== null) ask();
    });
    return { choose, shown: ask };
}
