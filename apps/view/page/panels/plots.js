// Plots of numbers in variables, each asked for by a click.

import { Chart } from "../chart.js";
import { make } from "../dom.js";

/** Points of a plot at most; the older half of them is then thinned out. */
const MOST_POINTS = 4000;

/** The numbers, texts and flags in a value, each with its path: `pose.position[2]`. At most `most`. */
export function leaves(value, most, path = "", found = []) {
    if (found.length === most) return found;
    if (value !== null && typeof value === "object") {
        const entries = Array.isArray(value)
            ? value.map((item, i) => [`${path}[${i}]`, item])
            : Object.entries(value).map(([name, item]) => [path ? `${path}.${name}` : name, item]);
        for (const [below, item] of entries) leaves(item, most, below, found);
    } else {
        found.push([path, value]);
    }
    return found;
}

export class Plots {
    #charts = new Map();

    /** `changed()` is called when other variables than before are plotted. */
    constructor(link, changed) {
        this.changed = changed;
        this.element = make("section", { "aria-label": "Plots" });
        link.on("value", message => this.#take(message));
        const clear = () => this.#charts.forEach(plot => Object.assign(plot.chart, { points: [] }).redraw());
        link.on("hello", clear);
        link.on("reset", clear);
    }

    /** Keys of the variables that are plotted. */
    keys() {
        return [...this.#charts.values()].map(plot => plot.key);
    }

    has(key, path) {
        return this.#charts.has(`${key} ${path}`);
    }

    toggle(key, path) {
        const id = `${key} ${path}`;
        if (this.#charts.has(id)) {
            this.#charts.get(id).chart.close();
            this.#charts.delete(id);
        } else {
            const title = path ? `${key} · ${path}` : key;
            const chart = new Chart({ title, axes: ["s", ""], low: true, remove: () => this.toggle(key, path) });
            this.#charts.set(id, { key, path, chart });
            this.element.append(chart.element);
        }
        this.changed();
    }

    #take({ key, time, value }) {
        const plots = [...this.#charts.values()].filter(plot => plot.key === key);
        if (plots.length === 0 || !Number.isFinite(time)) return;
        for (const { path, chart } of plots) {
            const number = at(value, path);
            if (!Number.isFinite(number)) continue;
            chart.points.push([time, number]);
            if (chart.points.length > MOST_POINTS) {
                chart.points = chart.points.filter((_, i) => i % 2 === 0 || i > MOST_POINTS / 2);
            }
            chart.redraw();
        }
    }
}

/** What is at a path in a value. */
function at(value, path) {
    const steps = path.match(/[^.[\]]+/g) ?? [];
    return steps.reduce((inner, step) => inner?.[step], value);
}
