// A line of numbers over numbers, on a canvas: axes with round steps, and what lies under finger, mouse or arrow keys.

import { figure, make, oncePerFrame } from "./dom.js";
import { css, scheme } from "./palette.js";

const MARGIN = { left: 46, right: 8, top: 8, bottom: 20 };

export class Chart {
    points = [];
    #at = null;
    #closed = new AbortController();

    redraw = oncePerFrame(() => this.canvas.clientWidth > 0 && this.#draw());

    /** `axes` names x and y, for whoever cannot see the line. */
    constructor({ title, axes, low = false, remove }) {
        this.axes = axes;
        this.readout = make("output");
        this.canvas = make("canvas", { class: low ? "low" : "", tabIndex: 0, role: "img" });
        const caption = make("figcaption", {}, make("strong", { textContent: title, title }), this.readout);
        if (remove)
            caption.append(
                make("button", {
                    type: "button",
                    class: "small",
                    textContent: "Remove",
                    "aria-label": `Remove ${title}`,
                    onclick: remove,
                }),
            );
        this.element = make("figure", {}, caption, this.canvas);
        this.title = title;
        this.canvas.addEventListener("pointermove", event => this.#point(this.#nearest(event.offsetX)));
        this.canvas.addEventListener("pointerleave", () => this.#point(null));
        this.canvas.addEventListener("blur", () => this.#point(null));
        this.canvas.addEventListener("keydown", event => this.#key(event));
        new ResizeObserver(() => this.redraw()).observe(this.canvas);
        addEventListener("scheme", () => this.redraw(), { signal: this.#closed.signal });
    }

    close() {
        this.#closed.abort();
        this.element.remove();
    }

    #point(index) {
        if (index === this.#at) return;
        this.#at = index;
        this.redraw();
    }

    #key(event) {
        const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
        if (!step || this.points.length === 0) return;
        event.preventDefault();
        const by = step * Math.max(1, Math.round(this.points.length / 60));
        this.#point(Math.max(0, Math.min(this.points.length - 1, (this.#at ?? this.points.length - 1) + by)));
    }

    /** The point whose x is nearest to a place on the canvas. */
    #nearest(pixel) {
        if (!this.scale || this.points.length === 0) return null;
        let best = 0;
        const off = i => Math.abs(this.scale.x(this.points[i][0]) - pixel);
        for (let i = 1; i < this.points.length; i++) if (off(i) <= off(best)) best = i;
        return best;
    }

    #draw() {
        const { canvas, points } = this;
        const ratio = window.devicePixelRatio || 1;
        const { clientWidth: width, clientHeight: height } = canvas;
        Object.assign(canvas, { width: width * ratio, height: height * ratio });
        const context = canvas.getContext("2d");
        context.scale(ratio, ratio);
        const colours = scheme();
        const shown = points[this.#at] ?? points.at(-1);
        const words = shown
            ? `${figure(shown[1])} ${this.axes[1]} at ${figure(shown[0])} ${this.axes[0]}`
            : "nothing yet";
        this.readout.textContent = words;
        canvas.setAttribute("aria-label", `${this.title}: ${words}`);
        const [xs, ys] = [range(points, 0), range(points, 1)];
        const x = value => MARGIN.left + ((value - xs.low) / (xs.high - xs.low)) * (width - MARGIN.left - MARGIN.right);
        const y = value =>
            height - MARGIN.bottom - ((value - ys.low) / (ys.high - ys.low)) * (height - MARGIN.top - MARGIN.bottom);
        this.scale = { x, y };
        context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
        context.fillStyle = css(colours.soft);
        context.strokeStyle = css(colours.line);
        context.lineWidth = 1;
        context.textAlign = "right";
        for (const value of ticks(ys, 4)) {
            context.fillText(short(value), MARGIN.left - 6, y(value) + 4);
            stroke(context, [
                [MARGIN.left, y(value)],
                [width - MARGIN.right, y(value)],
            ]);
        }
        context.textAlign = "center";
        for (const value of ticks(xs, 5)) context.fillText(short(value), Math.min(x(value), width - 14), height - 5);
        const line = thin(points, 2 * width).map(([a, b]) => [x(a), y(b)]);
        if (line.length === 0) return;
        context.strokeStyle = css(colours.accent);
        context.lineWidth = 2;
        context.lineJoin = "round";
        stroke(context, line);
        context.lineTo(line.at(-1)[0], height - MARGIN.bottom);
        context.lineTo(line[0][0], height - MARGIN.bottom);
        context.fillStyle = css(colours.accent, 0.12);
        context.fill();
        context.beginPath();
        context.arc(x(shown[0]), y(shown[1]), 3.5, 0, 2 * Math.PI);
        context.fillStyle = css(colours.accent);
        context.fill();
    }
}

function stroke(context, points) {
    context.beginPath();
    for (const [x, y] of points) context.lineTo(x, y);
    context.stroke();
}

/** From the smallest to the largest number of a column, and never nothing between. */
function range(points, column) {
    let low = Infinity,
        high = -Infinity;
    for (const point of points) {
        low = Math.min(low, point[column]);
        high = Math.max(high, point[column]);
    }
    if (points.length === 0) return { low: 0, high: 1 };
    if (low >= 0 && low < high / 2) low = 0;
    if (high > low) return { low, high };
    return high === 0 ? { low: 0, high: 1 } : { low: Math.min(0, low), high: Math.max(0, high) };
}

/** Some `many` round values of a range. */
function ticks({ low, high }, many) {
    const raw = (high - low) / many;
    const power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map(factor => factor * power).find(step => step >= raw);
    const first = Math.ceil(low / step);
    return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
}

function short(value) {
    const size = Math.abs(value);
    if (size >= 1e6) return `${+(value / 1e6).toPrecision(3)}M`;
    return size >= 1e4 ? `${+(value / 1e3).toPrecision(3)}k` : `${+value.toPrecision(4)}`;
}

/** No more than `most` of the points: a canvas has only so many pixels. */
function thin(points, most) {
    const step = Math.ceil(points.length / most);
    return step <= 1 ? points : points.filter((_, i) => i % step === 0 || i === points.length - 1);
}
