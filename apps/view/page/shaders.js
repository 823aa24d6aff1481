// The shaders: faces of voxels, lines of some width, round points, plain triangles, surfaces, cubes, labels and images.

import { RAMP_STEPS } from "./palette.js";

const CAMERA = `
uniform mat4 camera;
`;

/** A rectangle of voxel faces, unpacked from the word that `mesh.js` makes. */
export const FACES = {
    attributes: ["rectangle"],
    vertex: `${CAMERA}
in highp uint rectangle;
uniform vec3 origin;
uniform float resolution;
out vec3 voxels;
flat out int face;

int bits(int at, int many) { return int(rectangle >> uint(at)) & ((1 << many) - 1); }

void main() {
    face = bits(15, 3);
    int axis = face >> 1, u = (axis + 1) % 3, v = (axis + 2) % 3;
    bool up = (face & 1) == 1;
    // Seen from outside, the corners go round against the clock: for a face that looks down, u and v change places.
    int corner = gl_VertexID & 3;
    ivec2 far = up ? ivec2(corner & 1, corner >> 1) : ivec2(corner >> 1, corner & 1);
    ivec3 at = ivec3(bits(0, 5), bits(5, 5), bits(10, 5));
    at[axis] += up ? 1 : 0;
    at[u] += far.x * (bits(18, 5) + 1);
    at[v] += far.y * (bits(23, 5) + 1);
    voxels = origin + vec3(at);
    gl_Position = camera * vec4(voxels * resolution, 1.0);
}`,
    fragment: `
in vec3 voxels;
flat in int face;
uniform float resolution, clip;
uniform vec2 heights;
uniform vec3 ramp[${RAMP_STEPS}];
uniform vec4 tint;       // a colour and how much of it is mixed in
uniform float alpha;
uniform vec4 eye;        // and the distance at which things begin to fade
uniform vec3 ground;
out vec4 colour;

vec3 ofHeight(float share) {
    float place = clamp(share, 0.0, 0.9999) * float(${RAMP_STEPS - 1});
    int low = int(place);
    return mix(ramp[low], ramp[low + 1], fract(place));
}

void main() {
    vec3 world = voxels * resolution;
    if (world.z > clip) discard;
    int axis = face >> 1;
    bool up = (face & 1) == 1;
    float light = axis == 2 ? (up ? 1.0 : 0.62) : axis == 1 ? (up ? 0.86 : 0.80) : (up ? 0.74 : 0.70);
    float share = (world.z - heights.x) / (heights.y - heights.x);
    vec3 base = mix(ofHeight(share), tint.rgb, tint.a) * light;
    // Edges of the voxels, as far as they are wide enough to be seen.
    vec2 on = axis == 0 ? voxels.yz : axis == 1 ? voxels.zx : voxels.xy;
    vec2 wide = fwidth(on);
    vec2 off = abs(fract(on - 0.5) - 0.5) / wide;
    float edge = (1.0 - clamp(min(off.x, off.y), 0.0, 1.0)) * clamp(1.0 - 3.0 * max(wide.x, wide.y), 0.0, 1.0);
    base *= 1.0 - 0.22 * edge;
    float fade = clamp((distance(world, eye.xyz) / eye.w - 1.0) * 0.35, 0.0, 0.55);
    colour = vec4(mix(base, ground, fade), alpha);
}`,
};

/** A line from `from` to `to` (m) of some pixels' width. */
export const LINES = {
    attributes: ["from", "to", "tint"],
    vertex: `${CAMERA}
in vec3 from;
in vec3 to;
in vec4 tint;
flat out vec4 tinted;
uniform vec2 pixels;
uniform float width, bias;
out float along;

void main() {
    tinted = tint;
    vec4 a = camera * vec4(from, 1.0), b = camera * vec4(to, 1.0);
    // What is behind the eye is cut off, lest it comes out on the other side.
    float near = 1e-4;
    if (a.w < near && b.w < near) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
    if (a.w < near) a = mix(a, b, (near - a.w) / (b.w - a.w));
    if (b.w < near) b = mix(b, a, (near - b.w) / (a.w - b.w));
    vec2 way = (b.xy / b.w - a.xy / a.w) * pixels;
    way = dot(way, way) > 0.0 ? normalize(way) : vec2(1.0, 0.0);
    bool end = (gl_VertexID & 2) != 0;
    vec2 side = vec2(-way.y, way.x) * ((gl_VertexID & 1) != 0 ? 1.0 : -1.0) + way * (end ? 0.5 : -0.5);
    gl_Position = end ? b : a;
    along = end ? distance(from, to) : 0.0;
    gl_Position.xy += side * width / pixels * gl_Position.w;
    gl_Position.z -= bias * gl_Position.w;
}`,
    fragment: `
in float along;
flat in vec4 tinted;
uniform vec4 paint;
uniform float dash;      // its length (m), or 0
out vec4 colour;
void main() {
    if (dash > 0.0 && fract(along / dash) > 0.6) discard;
    colour = paint * tinted;
}`,
};

/** A disc of some pixels' size at each point. */
export const POINTS = {
    attributes: ["at", "tint"],
    vertex: `${CAMERA}
in vec3 at;
in vec4 tint;
flat out vec4 tinted;
uniform float size, bias;
void main() {
    tinted = tint;
    gl_Position = camera * vec4(at, 1.0);
    gl_Position.z -= bias * gl_Position.w;
    gl_PointSize = size;
}`,
    fragment: `
flat in vec4 tinted;
uniform vec4 paint;
out vec4 colour;
void main() {
    if (distance(gl_PointCoord, vec2(0.5)) > 0.5) discard;
    colour = paint * tinted;
}`,
};

/** Triangles with a shade each. */
export const TRIANGLES = {
    attributes: ["at", "shade", "tint"],
    vertex: `${CAMERA}
in vec3 at;
in float shade;
in vec4 tint;
flat out vec4 tinted;
flat out float light;
void main() {
    tinted = tint;
    gl_Position = camera * vec4(at, 1.0);
    light = shade;
}`,
    fragment: `
flat in vec4 tinted;
flat in float light;
uniform vec4 paint;
out vec4 colour;
void main() { colour = paint * tinted * vec4(vec3(light), 1.0); }`,
};

/** Surfaces that are seen through, below a height. */
export const SURFACES = {
    attributes: ["at"],
    vertex: `${CAMERA}
in vec3 at;
out vec3 world;
void main() {
    world = at;
    gl_Position = camera * vec4(at, 1.0);
}`,
    fragment: `
in vec3 world;
uniform vec4 paint;
uniform float clip;
out vec4 colour;
void main() {
    if (world.z > clip) discard;
    vec3 normal = normalize(cross(dFdx(world), dFdy(world)));
    colour = vec4(paint.rgb * (0.7 + 0.3 * abs(normal.z)), paint.a);
}`,
};

/** A cube along the axes around each place, of 36 vertices. */
export const CUBES = {
    attributes: ["at", "tint"],
    vertex: `${CAMERA}
in vec3 at;
in vec4 tint;
uniform float edge;
flat out vec4 tinted;

void main() {
    int face = gl_VertexID / 6, corner = (int[6](0, 1, 2, 2, 1, 3))[gl_VertexID % 6];
    int axis = face >> 1;
    bool up = (face & 1) == 1;
    vec3 off = vec3(-0.5);
    off[axis] += up ? 1.0 : 0.0;
    off[(axis + 1) % 3] += float(corner & 1);
    off[(axis + 2) % 3] += float(corner >> 1);
    float light = axis == 2 ? (up ? 1.0 : 0.62) : axis == 1 ? 0.83 : 0.72;
    tinted = vec4(tint.rgb * light, tint.a);
    gl_Position = camera * vec4(at + off * edge, 1.0);
}`,
    fragment: `
flat in vec4 tinted;
out vec4 colour;
void main() { colour = tinted; }`,
};

const PICTURE = `
in vec2 on;
uniform sampler2D picture;
out vec4 colour;
void main() {
    colour = texture(picture, on);
    if (colour.a < 0.004) discard;
}`;

/** A picture of some pixels' size that faces the eye, around a place: a strip of four vertices. */
export const LABELS = {
    attributes: [],
    vertex: `${CAMERA}
uniform vec3 at;
uniform vec2 size, pixels;
uniform float bias;
out vec2 on;
void main() {
    on = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = camera * vec4(at, 1.0);
    gl_Position.xy += (on - 0.5) * vec2(1.0, -1.0) * size / pixels * gl_Position.w;
    gl_Position.z -= bias * gl_Position.w;
}`,
    fragment: PICTURE,
};

/** A picture on a parallelogram: a strip of four vertices. */
export const IMAGES = {
    attributes: [],
    vertex: `${CAMERA}
uniform vec3 corner, along, across;
out vec2 on;
void main() {
    on = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = camera * vec4(corner + on.x * along + on.y * across, 1.0);
}`,
    fragment: PICTURE,
};
