// A thin layer on WebGL 2: programs, and buffers of things that are drawn as quads.

/** A linked program with its uniforms' places by name. */
export function program(gl, vertex, fragment, attributes) {
    const linked = gl.createProgram();
    for (const [kind, source] of [
        [gl.VERTEX_SHADER, vertex],
        [gl.FRAGMENT_SHADER, fragment],
    ]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, `#version 300 es\nprecision highp float;\n${source}`);
        gl.compileShader(shader);
        gl.attachShader(linked, shader);
    }
    attributes.forEach((name, place) => gl.bindAttribLocation(linked, place, name));
    gl.linkProgram(linked);
    if (!gl.getProgramParameter(linked, gl.LINK_STATUS)) {
        const logs = gl.getAttachedShaders(linked).map(shader => gl.getShaderInfoLog(shader));
        throw new Error([gl.getProgramInfoLog(linked), ...logs].join("\n"));
    }
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(linked, gl.ACTIVE_UNIFORMS); i++) {
        const name = gl.getActiveUniform(linked, i).name;
        uniforms[name.replace("[0]", "")] = gl.getUniformLocation(linked, name);
    }
    return { linked, uniforms };
}

/** A layout of attributes one after the other: `sizes` floats each. */
export function floats(...sizes) {
    const stride = 4 * sizes.reduce((sum, size) => sum + size);
    return gl => {
        let offset = 0;
        sizes.forEach((size, place) => {
            gl.enableVertexAttribArray(place);
            gl.vertexAttribPointer(place, size, gl.FLOAT, false, stride, offset);
            offset += 4 * size;
        });
    };
}

/** A layout of one attribute: a word. */
export function word(gl) {
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 4, 0);
}

/** Vertices on the card; `layout(gl)` says how their buffer feeds the attributes. */
export class Vertices {
    constructor(gl, layout) {
        this.gl = gl;
        this.array = gl.createVertexArray();
        this.buffer = gl.createBuffer();
        gl.bindVertexArray(this.array);
        gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer);
        layout(gl);
        gl.bindVertexArray(null);
    }

    /** Takes data in place of what there was. */
    set(data) {
        this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffer);
        this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.DYNAMIC_DRAW);
    }

    draw(mode, count) {
        this.gl.bindVertexArray(this.array);
        this.gl.drawArrays(mode, 0, count);
    }

    free() {
        this.gl.deleteVertexArray(this.array);
        this.gl.deleteBuffer(this.buffer);
    }
}

/** As many times the same `vertices`, which the shader makes of `gl_VertexID`, as there is data: one piece each. */
export class Instances extends Vertices {
    constructor(gl, layout, vertices) {
        super(gl, gl => {
            layout(gl);
            for (const place of [0, 1]) gl.vertexAttribDivisor(place, 1);
        });
        Object.assign(this, { vertices });
    }

    draw(count) {
        this.gl.bindVertexArray(this.array);
        this.gl.drawArraysInstanced(this.gl.TRIANGLES, 0, this.vertices, count);
    }
}

/** The indices of any number of quads, of whose corners 0 to 3 the triangles are 0 1 2 and 2 1 3: one buffer for all. */
export class QuadIndices {
    #gl;
    #quads = 0;

    constructor(gl) {
        this.#gl = gl;
        this.buffer = gl.createBuffer();
    }

    /** Makes the buffer, which a bound vertex array refers to, long enough. */
    reserve(quads) {
        const gl = this.#gl;
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffer);
        if (quads <= this.#quads) return;
        this.#quads = Math.max(quads, 2 * this.#quads, 4096);
        const indices = new Uint32Array(6 * this.#quads);
        for (let quad = 0; quad < this.#quads; quad++) {
            indices.set(
                [0, 1, 2, 2, 1, 3].map(corner => 4 * quad + corner),
                6 * quad,
            );
        }
        gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    }
}

/** Quads of which each of the four corners has the same data; the shader tells them apart by `gl_VertexID & 3`. */
export class Quads extends Vertices {
    count = 0;

    /** Each quad has `size` numbers. */
    constructor(gl, indices, layout, size = 1) {
        super(gl, layout);
        Object.assign(this, { indices, size });
    }

    set(data) {
        const { size } = this;
        this.count = data.length / size;
        const corners = new data.constructor(4 * data.length);
        for (let i = 0, at = 0; i < data.length; i += size) {
            for (let corner = 0; corner < 4; corner++) {
                for (let k = 0; k < size; k++) corners[at++] = data[i + k];
            }
        }
        super.set(corners);
        this.gl.bindVertexArray(this.array);
        this.indices.reserve(this.count);
        this.gl.bindVertexArray(null);
    }

    /** Draws the quads from one to before another. */
    draw(from = 0, to = this.count) {
        if (to <= from) return;
        this.gl.bindVertexArray(this.array);
        this.gl.drawElements(this.gl.TRIANGLES, 6 * (to - from), this.gl.UNSIGNED_INT, 24 * from);
    }
}
