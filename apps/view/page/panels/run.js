// How far the run is: figures, coverage over the way, plots, and at the end the summary.

import { Chart } from "../chart.js";
import { duration, figure, integer, make, metres, say } from "../dom.js";
import { replaceFrom } from "../world.js";

const FIGURES = [
    ["Scans", ({ scans }) => integer(scans)],
    ["Way", ({ way }) => metres(way)],
    ["Time", ({ time }) => duration(time)],
    ["Known", ({ known }) => integer(known)],
    ["Frontier", ({ frontier }) => integer(frontier)],
    ["Phase", ({ phase }) => phase || "–"],
];

export function runPanel(panel, { link, plots }) {
    const values = FIGURES.map(() => make("dd", { textContent: "–" }));
    const stats = make(
        "dl",
        { class: "stats" },
        ...FIGURES.map(([name], i) => make("div", {}, make("dt", { textContent: name }), values[i])),
    );
    const summary = make("section", { hidden: true, class: "summary" });
    const curves = make("section");
    panel.append(summary, stats, curves, plots.element);

    const charts = new Map();
    const chartOf = name => {
        if (!charts.has(name)) {
            const words = { title: `${name[0].toUpperCase()}${name.slice(1)} over the way`, axes: ["m", "voxels"] };
            charts.set(name, new Chart(words));
            curves.append(charts.get(name).element);
        }
        return charts.get(name);
    };
    const forget = () => {
        values.forEach(value => say(value, "–"));
        for (const chart of charts.values()) Object.assign(chart, { points: [] }).redraw();
        summary.hidden = true;
    };
    chartOf("coverage");
    link.on("hello", forget);
    link.on("reset", forget);
    link.on("progress", progress => FIGURES.forEach(([, words], i) => say(values[i], words(progress))));
    link.on("curve", ({ name, from, points }) => {
        const chart = chartOf(name);
        replaceFrom(chart.points, from, points);
        chart.redraw();
    });
    link.on("end", ({ summary: facts }) => {
        summary.replaceChildren(make("h2", { textContent: "The mission is over" }), ...sections(facts));
        summary.hidden = false;
        panel.scrollTop = 0;
    });
}

const isObject = value => value !== null && typeof value === "object" && !Array.isArray(value);
const isPair = item => Array.isArray(item) && item.length === 2 && typeof item[0] === "string";
/** A text of more characters comes after the figures. */
const LONG = 60;

/** A report a section, and what is in none of them in one without a name. */
function sections(facts) {
    const reports = Object.entries(facts).filter(([, value]) => isObject(value));
    const others = Object.entries(facts).filter(([, value]) => !isObject(value));
    return [
        ...(others.length > 0 ? [list(others)] : []),
        ...reports.flatMap(([name, report]) => [
            make("h3", { textContent: plainName(name) }),
            list(Object.entries(report)),
        ]),
    ];
}

/** Names and values in their order, but for long texts, which come last. */
function list(entries) {
    const rows = entries.filter(([, value]) => value !== null).map(([name, value]) => [plainName(name), worded(value)]);
    const isLong = ([, text]) => text.length > LONG;
    const sorted = [...rows.filter(row => !isLong(row)), ...rows.filter(isLong)];
    const parts = sorted.flatMap(([name, text]) => [
        make("dt", { textContent: name }),
        make("dd", { textContent: text }),
    ]);
    return make("dl", { class: "facts" }, ...parts);
}

/** Any value in words: of what counts things, only what there are. */
function worded(value) {
    if (typeof value === "number") return figure(value);
    if (typeof value === "boolean") return value ? "yes" : "no";
    if (Array.isArray(value) && value.every(isPair)) return named(value);
    if (Array.isArray(value)) return value.map(worded).join(value.some(isObject) ? "\n" : ", ") || "none";
    return isObject(value) ? named(Object.entries(value)) : String(value ?? "–");
}

function named(pairs) {
    const there = pairs.filter(([, value]) => value !== null && value !== 0);
    return there.map(([name, value]) => `${plainName(name)} ${worded(value)}`).join(", ") || "none";
}

/** `path_length_m` as `path length (m)`. */
function plainName(name) {
    const [, words, unit] = /^(.*?)(?:_(m|ms|s))?$/.exec(name);
    return words.replaceAll("_", " ") + (unit ? ` (${unit})` : "");
}
