// The 3-D view: a canvas with WebGL 2, and in which order what is drawn on it.

import { Chunks } from "./chunks.js";
import { Drawn } from "./drawn.js";
import { Ghost } from "./ghost.js";
import { QuadIndices, program } from "./gl.js";
import { Overlay } from "./overlay.js";
import * as shaders from "./shaders.js";

/** Time for meshing in a frame (ms): at least, and at most where frames are slow anyway. */
const MESHING_MS = [6, 100];

export class Scene {
    /** Throws if the browser has no WebGL 2. */
    constructor(canvas, world, camera) {
        Object.assign(this, { canvas, world, camera });
        // Where the processor stands in for a card, it has no time for smooth edges.
        this.software = isSoftware();
        this.gl = canvas.getContext("webgl2", { antialias: !this.software, alpha: false });
        if (!this.gl) throw new Error("this browser has no WebGL 2");
        this.#start();
        this.chunks = new Chunks(this, world);
        this.overlay = new Overlay(this, world);
        this.drawn = new Drawn(this, world);
        this.ghost = new Ghost(this, world);
        canvas.addEventListener("webglcontextlost", event => event.preventDefault());
        canvas.addEventListener("webglcontextrestored", () => {
            this.#start();
            this.chunks.restart();
            this.overlay.restart();
            this.drawn.restart();
            this.ghost.restart();
            camera.changed();
        });
    }

    #start() {
        const { gl } = this;
        this.programs = Object.fromEntries(
            Object.entries(shaders).map(([name, { vertex, fragment, attributes }]) => [
                name,
                program(gl, vertex, fragment, attributes),
            ]),
        );
        this.indices = new QuadIndices(gl);
        // Where vertices have no tint of their own, the paint is as it is.
        for (const place of [1, 2]) gl.vertexAttrib4f(place, 1, 1, 1, 1);
        gl.enable(gl.DEPTH_TEST);
        gl.enable(gl.CULL_FACE);
        gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    }

    /** Meshes for a while, then draws at a share of the screen's resolution; says whether there is more to mesh. */
    draw(colours, share, lastFrameMs) {
        const { gl, canvas, world, chunks, overlay } = this;
        if (gl.isContextLost()) return false;
        chunks.meshFor(Math.max(MESHING_MS[0], Math.min(MESHING_MS[1], lastFrameMs)));
        this.#resize(share);
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.clearColor(...colours.ground, 1);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        this.matrix = this.camera.matrix(canvas.width / canvas.height);
        chunks.look();
        const { shown, robot } = world;
        const box = world.voxels.bounds();
        if (shown.has("occupied")) chunks.drawOccupied(colours);
        if (shown.has("grid") && box) overlay.drawGrid(box, colours);
        if (shown.has("scan")) overlay.drawScan(colours);
        if (shown.has("way")) overlay.drawWay(colours);
        if (shown.has("plan")) overlay.drawPlan(colours);
        if (shown.has("robot") && robot) overlay.drawRobot(colours);
        if (shown.has("drawings")) this.drawn.draw();
        if (shown.has("frontier")) chunks.drawFrontier(colours);
        if (shown.has("world")) this.ghost.draw(colours);
        if (shown.has("robot") && robot?.camera) overlay.drawFrustum(colours);
        return chunks.waiting > 0;
    }

    #resize(share) {
        const { canvas } = this;
        const ratio = Math.min(window.devicePixelRatio || 1, 2) * share;
        const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
        const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
        if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
        this.pixelRatio = ratio;
    }

    /** Makes a program the current one and gives it the camera and other uniforms; returns where its uniforms are. */
    use(name, values) {
        const { gl } = this;
        const { linked, uniforms } = this.programs[name];
        gl.useProgram(linked);
        gl.uniformMatrix4fv(uniforms.camera, false, this.matrix);
        for (const [uniform, value] of Object.entries(values)) {
            if (typeof value === "number") gl.uniform1f(uniforms[uniform], value);
            else gl[`uniform${value.length}f`](uniforms[uniform], ...value);
        }
        return uniforms;
    }
}

/** Whether WebGL is drawn by the processor, as far as the browser says so. */
function isSoftware() {
    const gl = document.createElement("canvas").getContext("webgl2");
    const named = gl?.getExtension("WEBGL_debug_renderer_info");
    const renderer = gl?.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER) ?? "";
    gl?.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}
