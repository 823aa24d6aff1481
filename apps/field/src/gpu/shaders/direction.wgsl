// Conjugate gradients: p = z + beta p, Ap, and <p, Ap>; and x along the previous direction, which is at hand here.

@group(0) @binding(4) var<storage, read> z: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> p: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> next_p: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> ap: array<vec2<f32>>;
@group(0) @binding(8) var<storage, read_write> x: array<vec2<f32>>;

fn value(i: u32, at: vec3<i32>) -> vec2<f32> {
    return z[i] + state.beta * p[i];
}

fn visit(i: u32, here: vec2<f32>, around: vec2<f32>) -> f32 {
    let d = diagonal(i);
    let product = select(vec2<f32>(0.0), d * here - around, d > vec2<f32>(0.0));
    x[i] += state.alpha * p[i];
    next_p[i] = here;
    ap[i] = product;
    return dot(here, product);
}
