// Drawings from above, on a plain canvas: what stands upright is seen as the line that it is from there.

import { placing } from "./drawings.js";
import { lineEnds } from "./drawn.js";

/** Canvases of images, by primitive. */
const pictures = new WeakMap();

/** Draws what is shown of `world` into a context in metres, y up, in which a pixel of the screen is so large (m). */
export function drawFlat(context, pixel, world) {
    for (const drawing of world.drawings.list()) {
        const place = placing(drawing, world.robot);
        if (place === null || !world.drawings.isShown(drawing)) continue;
        for (const primitive of drawing.primitives) PARTS[primitive.kind](context, pixel, primitive, place);
    }
}

const pointOf = ({ at }, i) => [at[3 * i], at[3 * i + 1], at[3 * i + 2]];

function css({ colours }, i) {
    const from = colours.length === 4 ? 0 : 4 * i;
    return `rgb(${colours[from]} ${colours[from + 1]} ${colours[from + 2]} / ${colours[from + 3] / 255})`;
}

const PARTS = {
    points(context, pixel, primitive, place) {
        const radius = (primitive.size / 2) * pixel;
        for (let i = 0; i < primitive.at.length / 3; i++) {
            const [x, y] = place(pointOf(primitive, i));
            context.fillStyle = css(primitive, i);
            context.beginPath();
            context.arc(x, y, radius, 0, 2 * Math.PI);
            context.fill();
        }
    },

    lines(context, pixel, primitive, place) {
        context.lineWidth = primitive.width * pixel;
        context.lineCap = "round";
        for (const [from, to] of lineEnds(primitive)) {
            const [[x0, y0], [x1, y1]] = [from, to].map(end => place(pointOf(primitive, end)));
            context.strokeStyle = css(primitive, from);
            context.beginPath();
            context.moveTo(x0, y0);
            context.lineTo(x1, y1);
            context.stroke();
        }
        context.lineCap = "butt";
    },

    triangles(context, _pixel, primitive, place) {
        for (let i = 0; i < primitive.at.length / 3; i += 3) {
            context.fillStyle = css(primitive, i);
            context.beginPath();
            for (let corner = 0; corner < 3; corner++) context.lineTo(...place(pointOf(primitive, i + corner)).slice(0, 2));
            context.closePath();
            context.fill();
        }
    },

    voxels(context, _pixel, primitive, place) {
        const half = primitive.edge / 2;
        for (let i = 0; i < primitive.at.length / 3; i++) {
            const [x, y, z] = pointOf(primitive, i);
            context.fillStyle = css(primitive, i);
            context.beginPath();
            for (const [dx, dy] of [
                [-half, -half],
                [half, -half],
                [half, half],
                [-half, half],
            ])
                context.lineTo(...place([x + dx, y + dy, z]).slice(0, 2));
            context.closePath();
            context.fill();
        }
    },

    text(context, pixel, primitive, place) {
        const [x, y] = place(pointOf(primitive, 0));
        context.save();
        context.translate(x, y);
        context.scale(pixel, -pixel);
        context.font = `600 ${primitive.size}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`;
        Object.assign(context, { textAlign: "center", textBaseline: "middle", fillStyle: css(primitive, 0) });
        context.fillText(primitive.text, 0, 0);
        context.restore();
    },

    image(context, _pixel, primitive, place) {
        const corner = place(pointOf(primitive, 0));
        const side = i => {
            const to = place(pointOf(primitive, 0).map((value, axis) => value + pointOf(primitive, i)[axis]));
            return [to[0] - corner[0], to[1] - corner[1]];
        };
        const [along, across] = [side(1), side(2)];
        const { columns, colours } = primitive;
        const rows = colours.length / 4 / columns;
        context.save();
        context.transform(...along, ...across, corner[0], corner[1]);
        context.scale(1 / columns, 1 / rows);
        context.imageSmoothingEnabled = false;
        context.drawImage(pictureOf(primitive, columns, rows), 0, 0);
        context.restore();
    },
};

function pictureOf(primitive, columns, rows) {
    if (!pictures.has(primitive)) {
        const canvas = Object.assign(document.createElement("canvas"), { width: columns, height: rows });
        const pixels = new Uint8ClampedArray(primitive.colours);
        canvas.getContext("2d").putImageData(new ImageData(pixels, columns, rows), 0, 0);
        pictures.set(primitive, canvas);
    }
    return pictures.get(primitive);
}
