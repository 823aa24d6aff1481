// What is drawn over the voxels: grid, way, plan, scan, and the robot with its camera's frustum.

import { Quads, Vertices, floats } from "./gl.js";
import { dart, frustumOf } from "./robot.js";

/** Segments of a way that are on the card together, so that a longer way costs only its end. */
const BLOCK = 1024;

export class Overlay {
    #lines = new Map();
    #points = new Map();
    #body = null;

    constructor(stage, world) {
        Object.assign(this, { stage, world });
    }

    /** Nothing is on the card. */
    restart() {
        this.#lines.clear();
        this.#points.clear();
        this.#body = null;
    }

    drawWay(colours) {
        const { way } = this.world;
        for (let from = 0; from + 1 < way.length; from += BLOCK) {
            const end = Math.min(from + BLOCK, way.length - 1);
            const segments = () => pairs(way.slice(from, end + 1));
            this.#drawLine(`way from ${from}`, way[end], segments, { colour: colours.way, width: 2.5, bias: 2e-4 });
        }
    }

    drawPlan(colours) {
        const { plan, target } = this.world;
        const dash = this.stage.camera.heightAtTarget() / 60;
        this.#drawLine("plan", plan, () => pairs(plan), { colour: colours.plan, width: 2.5, bias: 4e-4, dash });
        if (target)
            this.#drawPoints("target", target, () => new Float32Array(target), { colour: colours.plan, size: 11 });
    }

    drawScan(colours) {
        const { scan } = this.world;
        const size = Math.max(
            1.3,
            Math.min(4, (0.02 * this.stage.canvas.clientHeight) / this.stage.camera.heightAtTarget()),
        );
        this.#drawPoints("scan", scan, () => scan, { colour: colours.ink, size });
    }

    drawFrustum(colours) {
        const { robot } = this.world;
        const segments = () => {
            const { eye, far } = frustumOf(robot);
            return far.flatMap((corner, i) => [
                [eye, corner],
                [corner, far[(i + 1) % 4]],
            ]);
        };
        this.#drawLine("frustum", robot, segments, { colour: colours.robot, alpha: 0.8, width: 1.3 });
    }

    /** As large as a robot is, but never too small to be found. */
    drawRobot(colours) {
        const { gl, camera } = this.stage;
        this.#body ??= new Vertices(gl, floats(3, 1));
        const triangles = dart(this.world.robot, Math.max(0.25, camera.heightAtTarget() / 32));
        this.#body.set(triangles);
        this.stage.use("TRIANGLES", { paint: [...colours.robot, 1] });
        gl.disable(gl.CULL_FACE);
        this.#body.draw(gl.TRIANGLES, triangles.length / 4);
        gl.enable(gl.CULL_FACE);
    }

    /** Lines a metre (or ten, or a hundred) apart, under a box. */
    drawGrid({ low, high }, colours) {
        const extent = Math.max(high[0] - low[0], high[1] - low[1]);
        const step = 10 ** Math.max(0, Math.ceil(Math.log10(extent / 40)));
        const [left, front] = low.map(value => (Math.floor(value / step) - 1) * step);
        const [right, back] = high.map(value => (Math.ceil(value / step) + 1) * step);
        const z = low[2] - 0.02;
        const segments = () => {
            const lines = [];
            for (let x = left; x <= right; x += step)
                lines.push([
                    [x, front, z],
                    [x, back, z],
                ]);
            for (let y = front; y <= back; y += step)
                lines.push([
                    [left, y, z],
                    [right, y, z],
                ]);
            return lines;
        };
        const state = [left, right, front, back, z].join();
        this.#drawLine("grid", state, segments, { colour: colours.line, alpha: 0.7, width: 1 });
    }

    /** Draws segments, `[from, to]` each, that are put on the card only when `state` is not what it was. */
    #drawLine(name, state, segments, { colour, alpha = 1, width, dash = 0, bias = 0 }) {
        const { gl, indices, canvas, pixelRatio } = this.stage;
        const line = upToDate(
            this.#lines,
            name,
            state,
            () => new Quads(gl, indices, floats(3, 3), 6),
            () => new Float32Array(segments().flat(2)),
        );
        const pixels = [canvas.width / 2, canvas.height / 2];
        this.stage.use("LINES", { pixels, width: (width * pixelRatio) / 2, dash, bias, paint: [...colour, alpha] });
        gl.disable(gl.CULL_FACE);
        if (alpha < 1) gl.enable(gl.BLEND);
        line.draw();
        gl.disable(gl.BLEND);
        gl.enable(gl.CULL_FACE);
    }

    #drawPoints(name, state, data, { colour, size }) {
        const { gl, pixelRatio } = this.stage;
        const points = upToDate(this.#points, name, state, () => new Vertices(gl, floats(3)), data);
        this.stage.use("POINTS", { size: size * pixelRatio, bias: 4e-4, paint: [...colour, 1] });
        points.draw(gl.POINTS, data().length / 3);
    }
}

/** The vertices of a name, made when there are none and set anew when `state` is another. */
function upToDate(all, name, state, make, data) {
    if (!all.has(name)) all.set(name, Object.assign(make(), { state: undefined }));
    const vertices = all.get(name);
    if (vertices.state !== state) vertices.set(data());
    vertices.state = state;
    return vertices;
}

function pairs(points) {
    return points.slice(1).map((point, i) => [points[i], point]);
}
