// The operator of the finest level: weight 1 between neighbours. Values outside are zero, so that only the diagonal has
// to be known: how many neighbours a cell has, in four bits, 0 outside.

@group(0) @binding(2) var<storage, read> degrees: array<u32>;

fn diagonal(i: u32) -> vec2<f32> {
    let pair = degrees[i >> 2u] >> ((i & 3u) * 8u);
    return vec2<f32>(f32(pair & 15u), f32((pair >> 4u) & 15u));
}

/// The weighted sum of the values around a pair.
fn sum(
    i: u32, left: vec2<f32>, right: vec2<f32>, front: vec2<f32>, back: vec2<f32>, below: vec2<f32>, above: vec2<f32>,
) -> vec2<f32> {
    return (left + right) + (front + back) + (below + above);
}

fn degree(cell: u32) -> u32 {
    return (degrees[cell >> 3u] >> ((cell & 7u) * 4u)) & 15u;
}

/// The weights to the next cells along x, y and z, and the diagonal.
fn stencil(cell: u32) -> vec4<f32> {
    let next = vec3<u32>(degree(cell + 1u), degree(cell + 2u * level.row), degree(cell + 2u * level.plane));
    let own = degree(cell);
    return vec4<f32>(vec3<f32>(min(next, vec3<u32>(1u)) * min(own, 1u)), f32(own));
}
