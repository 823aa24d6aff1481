// The apps: state, CPU, memory, restarts, drops; a row opens to stop, start, swap, and to the app's log.

import { bytes, duration, integer, keep, make, percent, say } from "../dom.js";
import { parameterFields } from "../parameters.js";

const COLUMNS = [
    ["App", "Name and type"],
    ["State", "What it is doing"],
    ["CPU", "Of one core, now"],
    ["Memory", "Resident"],
    ["↻", "Restarts"],
    ["Drops", "Messages missed because it did not keep up"],
];
const STOPPED = ["stopped", "ended"];

export function appsPanel(panel, { link, orders, dialog, showLog }) {
    const open = new Set();
    const head = make(
        "tr",
        {},
        ...COLUMNS.map(([textContent, title]) => make("th", { scope: "col", textContent, title })),
    );
    const body = make("tbody");
    const quiet = make("p", { class: "quiet", textContent: "No apps have been named yet." });
    panel.append(quiet, make("table", {}, make("thead", {}, head), body));
    let rows = [];
    const show = () => {
        quiet.hidden = rows.length > 0;
        const shown = rows.flatMap(app => (open.has(app.name) ? [{ app }, { app, detail: true }] : [{ app }]));
        keep(
            body,
            shown,
            ({ app, detail }) => `${detail ?? false} ${app.name}`,
            makeRow,
            (row, { app }) => row.show(app),
        );
    };
    const makeRow = ({ app, detail }) => (detail ? detailRow(app) : appRow(app));

    function appRow({ name }) {
        const type = make("small");
        const button = make("button", {
            type: "button",
            class: "name",
            textContent: name,
            onclick: () => {
                if (!open.delete(name)) open.add(name);
                show();
            },
        });
        const state = make("span", { class: "badge" });
        const [cpu, memory, restarts, drops] = [1, 2, 3, 4].map(() => make("td"));
        const row = make(
            "tr",
            {},
            make("td", { class: "wrap" }, button, " ", type),
            make("td", {}, state),
            cpu,
            memory,
            restarts,
            drops,
        );
        row.show = app => {
            button.setAttribute("aria-expanded", open.has(name));
            say(type, app.type && app.type !== name ? app.type : "");
            say(state, app.state);
            state.dataset.state = app.state;
            say(cpu, percent(app.cpu_percent_now));
            say(memory, bytes(app.resident_bytes));
            say(restarts, integer(app.restarts));
            restarts.classList.toggle("alarm", app.restarts > 0);
            say(drops, integer(app.dropped));
            drops.classList.toggle("alarm", app.dropped > 0);
        };
        return row;
    }

    function detailRow({ name }) {
        const facts = make("dl", { class: "facts" });
        const button = (text, onclick) =>
            make("button", { type: "button", class: "small", textContent: text, onclick });
        let now;
        const stop = button("Stop", () =>
            STOPPED.includes(now.state)
                ? orders.order({ command: "start", app: name }, `Start ${name}`)
                : orders.order({ command: "stop", app: name }, `Stop ${name}`),
        );
        const swap = button("Swap…", () => openSwap(now));
        const actions = make(
            "div",
            { class: "actions" },
            stop,
            swap,
            button("Log", () => showLog(name)),
        );
        const row = make("tr", { class: "detail" }, make("td", { colSpan: COLUMNS.length }, facts, actions));
        row.show = app => {
            now = app;
            const texts = {
                Element: app.element || "–",
                Process: app.pid === null ? "–" : String(app.pid),
                Since: duration(app.state_secs),
                Swaps: integer(app.swaps),
                Rejected: integer(app.rejected),
                "Last end": app.last_exit ?? "none",
            };
            keep(
                facts,
                Object.entries(texts).flatMap(([term, text]) => [
                    ["dt", term, term],
                    ["dd", term, text],
                ]),
                ([tag, term]) => `${tag} ${term}`,
                ([tag]) => make(tag),
                (element, [, , text]) => say(element, text),
            );
            say(stop, STOPPED.includes(app.state) ? "Start" : "Stop");
            // Launcher and broker are nobody's element: they carry the mission, and are no apps of it.
            stop.hidden = swap.hidden = orders.readOnly || !app.element;
        };
        return row;
    }

    async function openSwap(app) {
        const elements = await orders.types().catch(() => null);
        const types = elements?.find(({ element }) => element === app.element)?.types;
        if (types) swapForm(dialog, orders, app, types);
        else if (elements) orders.say(`Nothing is known of the types of ${app.element}`, "bad");
    }

    link.on("apps", message => {
        rows = message.rows;
        show();
    });
    link.on("hello", () => {
        rows = [];
        show();
    });
}

/** Asks for another type, or other parameters, of an app. */
function swapForm(dialog, orders, app, types) {
    const choice = make(
        "select",
        { id: "swap-type" },
        ...types.map(({ name }) => make("option", { value: name, textContent: name })),
    );
    const summary = make("p", { class: "quiet" });
    const place = make("div", { class: "form-fields" });
    let fields;
    const chosen = () => {
        const type = types.find(({ name }) => name === choice.value);
        fields = parameterFields(type.params);
        say(summary, type.summary ?? "");
        place.replaceChildren(...fields.elements);
    };
    if (types.some(({ name }) => name === app.type)) choice.value = app.type;
    choice.addEventListener("change", chosen);
    chosen();
    const send = event => {
        event.preventDefault();
        const params = fields.values();
        if (params === null) return;
        const type_name = choice.value === app.type ? null : choice.value;
        orders.order({ command: "swap", app: app.name, type_name, params }, `Swap ${app.name}`);
        dialog.close();
    };
    dialog.replaceChildren(
        make(
            "form",
            { method: "dialog", noValidate: true, onsubmit: send },
            make("h2", { id: "form-title", textContent: `Swap ${app.name}` }),
            make(
                "div",
                { class: "parameter" },
                make("label", { htmlFor: "swap-type", textContent: "Type" }),
                choice,
                summary,
            ),
            place,
            make(
                "div",
                { class: "buttons" },
                make("button", { type: "button", textContent: "Cancel", onclick: () => dialog.close() }),
                make("button", { type: "submit", class: "primary", textContent: "Swap" }),
            ),
        ),
    );
    dialog.showModal();
}
