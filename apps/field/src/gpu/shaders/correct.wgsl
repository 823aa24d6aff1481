// The way back up: what the next coarser level found is added to its children, and the first of two sweeps made.

@group(0) @binding(4) var<storage, read> x: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> coarse: array<f32>;
@group(0) @binding(6) var<storage, read> b: array<vec2<f32>>;
@group(0) @binding(7) var<storage, read_write> out: array<vec2<f32>>;

/// x with its parent's value, where a cell is inside.
fn value(i: u32, at: vec3<i32>) -> vec2<f32> {
    let above = vec3<i32>(at.x, at.yz >> vec2<u32>(1u));
    let parent = (above.z + 1) * i32(level.coarse_plane) + above.y * i32(level.coarse_row) + above.x;
    return x[i] + select(vec2<f32>(0.0), vec2<f32>(coarse[parent]), diagonal(i) > vec2<f32>(0.0));
}

fn visit(i: u32, here: vec2<f32>, around: vec2<f32>) -> f32 {
    let d = diagonal(i);
    out[i] = here + OMEGA.y * inverse(d) * (b[i] - d * here + around);
    return 0.0;
}
