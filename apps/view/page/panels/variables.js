// The variables: who says them, how often, how long ago; a click on one shows its value, a click on a number plots it.

import { bytes, duration, figure, integer, keep, make, oncePerFrame, perSecond, say } from "../dom.js";
import { leaves } from "./plots.js";

const MOST_ROWS = 200;
const MOST_LEAVES = 60;

export function variablesPanel(panel, { link, orders, plots, say: tell }) {
    const open = new Map();
    let rows = [];
    let leftOut = 0;
    const search = make("input", {
        type: "search",
        id: "search",
        placeholder: "Search by name, type or writer  ( / )",
        "aria-label": "Search variables",
        oninput: () => show(),
    });
    const head = make(
        "tr",
        {},
        ...["Variable", "Rate", "Age"].map(name => make("th", { scope: "col", textContent: name })),
    );
    const body = make("tbody");
    const quiet = make("p", { class: "quiet" });
    const poke = pokeForm(orders);
    panel.append(search, make("table", {}, make("thead", {}, head), body), quiet, poke.element);

    const watch = () => link.send({ type: "watch", keys: [...new Set([...open.keys(), ...plots.keys()])].sort() });
    plots.changed = () => {
        watch();
        show();
    };

    const nothing = () => (rows.length > 0 ? "No variable is called so." : "Nobody has published anything yet.");
    const show = oncePerFrame(() => {
        if (panel.hidden) return;
        const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
        const fits = row =>
            words.every(word => [row.key, row.type, row.writer].some(text => text?.toLowerCase().includes(word)));
        const found = rows.filter(fits);
        const listed = found.slice(0, MOST_ROWS);
        const shown = listed.flatMap(row => (open.has(row.key) ? [{ row }, { row, detail: true }] : [{ row }]));
        keep(
            body,
            shown,
            ({ row, detail }) => `${detail ?? false} ${row.key}`,
            ({ row, detail }) => (detail ? detailRow(row) : variableRow(row)),
            (element, { row }) => element.show(row),
        );
        const more = found.length - listed.length + leftOut;
        say(quiet, more > 0 ? `${integer(more)} more: search for them.` : found.length > 0 ? "" : nothing());
    });

    function variableRow({ key }) {
        const type = make("small");
        const button = make("button", {
            type: "button",
            class: "name mono",
            textContent: key,
            onclick: () => {
                if (!open.delete(key)) {
                    open.set(key, null);
                    poke.suggest(key);
                }
                watch();
                show();
            },
        });
        const [rate, age] = [make("td"), make("td")];
        const element = make("tr", {}, make("td", { class: "wrap" }, button, " ", type), rate, age);
        element.show = row => {
            button.setAttribute("aria-expanded", open.has(key));
            say(type, row.type ?? "");
            say(rate, perSecond(row.rate));
            say(age, duration(row.age));
        };
        return element;
    }

    function detailRow({ key }) {
        const facts = make("p", { class: "quiet" });
        const list = make("ul", { class: "leaves" });
        const element = make("tr", { class: "detail" }, make("td", { colSpan: 3 }, facts, list));
        element.show = row => {
            say(
                facts,
                `${integer(row.count)} from ${row.writer ?? "nobody"}, ${bytes(row.bytes)}, ${integer(row.readers)} readers`,
            );
            keep(
                list,
                leavesOf(open.get(key)),
                ([path]) => path,
                ([path, value]) => leafItem(key, path, value),
                (item, leaf) => item.show(leaf),
            );
        };
        return element;
    }

    function leafItem(key, path) {
        const text = make("code");
        const button = make("button", {
            type: "button",
            class: "small",
            textContent: "Plot",
            "aria-label": `Plot ${key} ${path}`,
            onclick: () => {
                plots.toggle(key, path);
                if (plots.has(key, path)) tell(`${key} ${path} is plotted under Run`, "good");
            },
        });
        const item = make(
            "li",
            {},
            ...(path ? [make("span", { class: "path mono", textContent: path })] : []),
            text,
            button,
        );
        item.show = ([, value]) => {
            say(text, typeof value === "number" ? figure(value) : String(value));
            button.hidden = typeof value !== "number";
            button.setAttribute("aria-pressed", plots.has(key, path));
        };
        return item;
    }

    link.on("variables", message => {
        rows = message.rows;
        leftOut = message.left_out ?? 0;
        show();
    });
    link.on("value", message => {
        if (open.has(message.key)) open.set(message.key, message);
        show();
    });
    link.on("hello", () => {
        poke.element.hidden = orders.readOnly;
        for (const key of open.keys()) open.set(key, null);
        watch();
    });
    return { shown: is => is && show(), search };
}

/** What a value has to show; what cannot be taken apart is shown in the server's words. */
function leavesOf(message) {
    if (message === null) return [["", "has not been said since you look"]];
    if (message.value === null) return [["", message.text]];
    const found = leaves(message.value, MOST_LEAVES);
    return found.length < MOST_LEAVES ? found : [...found, ["…", message.text]];
}

function pokeForm(orders) {
    const key = make("input", { type: "text", required: true, autocomplete: "off", spellcheck: false, class: "mono" });
    const value = make("input", { type: "text", autocomplete: "off", spellcheck: false, class: "mono" });
    const element = make(
        "form",
        {
            class: "row foot",
            noValidate: true,
            onsubmit: event => {
                event.preventDefault();
                if (key.value.trim() === "") return key.focus();
                orders.poke(key.value.trim(), value.value);
            },
        },
        make("label", {}, "Variable", key),
        make("label", {}, "Value", value),
        make("button", { type: "submit", textContent: "Poke" }),
    );
    return { element, suggest: name => (key.value = name) };
}
