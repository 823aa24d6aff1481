// Drawings on the card: each primitive as vertices or a texture, made when a drawing comes and let go when it has gone.

import { placing } from "./drawings.js";
import { Instances, Quads, Vertices, floats } from "./gl.js";
import { cross, dot, length, multiply, subtract } from "./vectors.js";

const LIGHT = [0.3, 0.2, 0.93];
const WHITE = [1, 1, 1, 1];
const BIAS = 4e-4;

export class Drawn {
    /** By drawing, what is on the card of it: functions that draw, and what is to be let go. */
    #pictures = new Map();

    constructor(scene, world) {
        Object.assign(this, { scene, world });
    }

    /** Nothing is on the card. */
    restart() {
        this.#pictures.clear();
    }

    /** Draws all drawings that are shown. */
    draw() {
        const { scene, world } = this;
        const { gl } = scene;
        const shown = world.drawings.list();
        for (const [drawing, { parts }] of this.#pictures) {
            if (shown.includes(drawing)) continue;
            parts.forEach(part => part.free());
            this.#pictures.delete(drawing);
        }
        const camera = scene.matrix;
        gl.disable(gl.CULL_FACE);
        gl.enable(gl.BLEND);
        gl.depthFunc(gl.LEQUAL);
        for (const drawing of shown) {
            const place = placing(drawing, world.robot);
            if (place === null || !world.drawings.isShown(drawing)) continue;
            scene.matrix = drawing.frame === "world" ? camera : multiply(camera, matrixOf(place));
            if (!this.#pictures.has(drawing)) {
                this.#pictures.set(drawing, { parts: drawing.primitives.map(one => PARTS[one.kind](scene, one)) });
            }
            for (const part of this.#pictures.get(drawing).parts) part.draw();
        }
        scene.matrix = camera;
        gl.depthFunc(gl.LESS);
        gl.disable(gl.BLEND);
        gl.enable(gl.CULL_FACE);
    }
}

/** What a placing does, as a matrix. */
function matrixOf(place) {
    const origin = place([0, 0, 0]);
    const axes = [0, 1, 2].map(axis => subtract(place([0, 1, 2].map(i => (i === axis ? 1 : 0))), origin));
    return [...axes.flatMap(axis => [...axis, 0]), ...origin, 1];
}

const point = ({ at }, i) => [at[3 * i], at[3 * i + 1], at[3 * i + 2]];
/** The colour of a place (0 to 1 each); there is one for each, or one for all. */
function colour({ colours }, i) {
    const from = colours.length === 4 ? 0 : 4 * i;
    return [0, 1, 2, 3].map(part => colours[from + part] / 255);
}

/** Makes a primitive's part on the card, by kind. */
const PARTS = {
    points(scene, primitive) {
        const { gl } = scene;
        const vertices = new Vertices(gl, floats(3, 4));
        const count = primitive.at.length / 3;
        vertices.set(packed(count, 7, i => [...point(primitive, i), ...colour(primitive, i)]));
        return {
            draw() {
                scene.use("POINTS", { size: primitive.size * scene.pixelRatio, bias: BIAS, paint: WHITE });
                vertices.draw(gl.POINTS, count);
            },
            free: () => vertices.free(),
        };
    },

    lines(scene, primitive) {
        const { gl, indices, canvas } = scene;
        const quads = new Quads(gl, indices, floats(3, 3, 4), 10);
        const ends = lineEnds(primitive);
        quads.set(
            packed(ends.length, 10, i => {
                const [from, to] = ends[i];
                return [...point(primitive, from), ...point(primitive, to), ...colour(primitive, from)];
            }),
        );
        return {
            draw() {
                const pixels = [canvas.width / 2, canvas.height / 2];
                const width = (primitive.width * scene.pixelRatio) / 2;
                scene.use("LINES", { pixels, width, dash: 0, bias: BIAS, paint: WHITE });
                quads.draw();
            },
            free: () => quads.free(),
        };
    },

    triangles(scene, primitive) {
        const { gl } = scene;
        const vertices = new Vertices(gl, floats(3, 1, 4));
        const count = primitive.at.length / 3;
        vertices.set(
            packed(count, 8, i => {
                const first = i - (i % 3);
                return [...point(primitive, i), shadeOf(primitive, first), ...colour(primitive, first)];
            }),
        );
        return {
            draw() {
                scene.use("TRIANGLES", { paint: WHITE });
                vertices.draw(gl.TRIANGLES, count);
            },
            free: () => vertices.free(),
        };
    },

    voxels(scene, primitive) {
        const cubes = new Instances(scene.gl, floats(3, 4), 36);
        const count = primitive.at.length / 3;
        cubes.set(packed(count, 7, i => [...point(primitive, i), ...colour(primitive, i)]));
        return {
            draw() {
                scene.use("CUBES", { edge: primitive.edge });
                cubes.draw(count);
            },
            free: () => cubes.free(),
        };
    },

    text(scene, primitive) {
        const { gl, canvas } = scene;
        const picture = pictureOf(primitive);
        const texture = textureOf(gl, picture, gl.LINEAR);
        const empty = gl.createVertexArray();
        return {
            draw() {
                const pixels = [canvas.width / 2, canvas.height / 2];
                const size = [picture.width, picture.height].map(side => (side / SHARP) * scene.pixelRatio);
                scene.use("LABELS", { at: point(primitive, 0), size, pixels, bias: BIAS });
                drawPicture(gl, empty, texture);
            },
            free: () => (gl.deleteTexture(texture), gl.deleteVertexArray(empty)),
        };
    },

    image(scene, primitive) {
        const { gl } = scene;
        const texture = textureOf(gl, primitive, gl.NEAREST);
        const empty = gl.createVertexArray();
        const [corner, along, across] = [0, 1, 2].map(i => point(primitive, i));
        return {
            draw() {
                // What is drawn over it later is not to be hidden by what can be seen through.
                gl.depthMask(false);
                scene.use("IMAGES", { corner, along, across });
                drawPicture(gl, empty, texture);
                gl.depthMask(true);
            },
            free: () => (gl.deleteTexture(texture), gl.deleteVertexArray(empty)),
        };
    },
};

/** Pairs of places with a line between them. */
export function lineEnds({ at, joined }) {
    const count = at.length / 3;
    const pairs = joined ? Math.max(0, count - 1) : count / 2;
    return Array.from({ length: pairs }, (_, i) => (joined ? [i, i + 1] : [2 * i, 2 * i + 1]));
}

/** `count` times `size` numbers. */
function packed(count, size, of) {
    const all = new Float32Array(count * size);
    for (let i = 0; i < count; i++) all.set(of(i), i * size);
    return all;
}

/** How bright a triangle is, from whichever side it is seen. */
function shadeOf(primitive, first) {
    const [a, b, c] = [0, 1, 2].map(corner => point(primitive, first + corner));
    const normal = cross(subtract(b, a), subtract(c, a));
    return 0.72 + (0.28 * Math.abs(dot(normal, LIGHT))) / (length(normal) || 1);
}

/** Pixels of a text's picture to one on the screen. */
const SHARP = 2;

/** A text on a canvas. */
function pictureOf(primitive) {
    const canvas = document.createElement("canvas");
    const context = canvas.getContext("2d");
    const font = `600 ${SHARP * primitive.size}px system-ui, "Noto Sans", "DejaVu Sans", sans-serif`;
    context.font = font;
    canvas.width = Math.min(4096, Math.max(1, Math.ceil(context.measureText(primitive.text).width)));
    canvas.height = Math.ceil(1.3 * SHARP * primitive.size);
    Object.assign(context, { font, textBaseline: "middle" });
    const [red, green, blue, alpha] = colour(primitive, 0);
    context.fillStyle = `rgb(${255 * red} ${255 * green} ${255 * blue} / ${alpha})`;
    context.fillText(primitive.text, 0, canvas.height / 2);
    return canvas;
}

function textureOf(gl, picture, filter) {
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    if (picture instanceof HTMLCanvasElement) {
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    } else {
        const { columns, colours } = picture;
        const rows = colours.length / 4 / columns;
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, columns, rows, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
    }
    for (const which of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, which, filter);
    for (const wrap of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
        gl.texParameteri(gl.TEXTURE_2D, wrap, gl.CLAMP_TO_EDGE);
    return texture;
}

function drawPicture(gl, empty, texture) {
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.bindVertexArray(empty);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
}
