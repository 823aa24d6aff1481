// The operator of a coarser level: by cell the weights to the next along x, y and z, and the diagonal.

@group(0) @binding(2) var<storage, read> weights: array<vec4<f32>>;

fn diagonal(i: u32) -> vec2<f32> {
    return vec2<f32>(weights[2u * i].w, weights[2u * i + 1u].w);
}

/// The weighted sum of the values around a pair.
fn sum(
    i: u32, left: vec2<f32>, right: vec2<f32>, front: vec2<f32>, back: vec2<f32>, below: vec2<f32>, above: vec2<f32>,
) -> vec2<f32> {
    let first = weights[2u * i];
    let second = weights[2u * i + 1u];
    let y = 2u * (i - level.row);
    let z = 2u * (i - level.plane);
    return vec2<f32>(weights[2u * i - 1u].x, first.x) * left + vec2<f32>(first.x, second.x) * right
        + vec2<f32>(weights[y].y, weights[y + 1u].y) * front + vec2<f32>(first.y, second.y) * back
        + vec2<f32>(weights[z].z, weights[z + 1u].z) * below + vec2<f32>(first.z, second.z) * above;
}

/// The weights to the next cells along x, y and z, and the diagonal.
fn stencil(cell: u32) -> vec4<f32> {
    return weights[cell];
}
