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
    const summary = make("section", { hidden: true });
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
        summary.replaceChildren(make("h2", { textContent: "The mission is over" }), factsOf(facts));
        summary.hidden = false;
        panel.scrollTop = 0;
    });
}

/** Any object as a list of names and values, objects in it as lists in it. */
function factsOf(facts) {
    const rows = Object.entries(facts)
        .filter(([, value]) => value !== null)
        .flatMap(([name, value]) => [make("dt", { textContent: plainName(name) }), make("dd", {}, worded(value))]);
    return make("dl", { class: "facts" }, ...rows);
}

function worded(value) {
    if (typeof value === "number") return figure(value);
    if (typeof value === "boolean") return value ? "yes" : "no";
    if (Array.isArray(value))
        return value.some(item => item && typeof item === "object")
            ? make("div", {}, ...value.map(worded))
            : value.map(worded).join(", ") || "none";
    return value !== null && typeof value === "object" ? factsOf(value) : String(value ?? "–");
}

/** `path_length_m` as `path length (m)`. */
function plainName(name) {
    const [, words, unit] = /^(.*?)(?:_(m|ms|s))?$/.exec(name);
    return words.replaceAll("_", " ") + (unit ? ` (${unit})` : "");
}
