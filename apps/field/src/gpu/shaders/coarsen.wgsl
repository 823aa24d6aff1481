// The next coarser operator: half of P'AP, since a coarse value taken over by all children is twice too stiff; fixed values
// stay as near as they are, which takes fewer iterations.

@group(0) @binding(4) var<storage, read_write> coarse: array<vec4<f32>>;

@compute @workgroup_size(32, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= level.pairs || id.y >= level.coarse_rows || id.z >= level.coarse_planes {
        return;
    }
    let first = 2u * index(id.x, 2u * id.y, 2u * id.z);
    var total = vec4<f32>(0.0);
    for (var child = 0u; child < 8u; child++) {
        let at = vec3<u32>(child, child >> 1u, child >> 2u) & vec3<u32>(1u);
        let cell = first + at.x + 2u * (at.y * level.row + at.z * level.plane);
        let own = stencil(cell);
        let before = vec3<f32>(
            stencil(cell - 1u).x, stencil(cell - 2u * level.row).y, stencil(cell - 2u * level.plane).z,
        );
        let fixed = own.w - dot(own.xyz + before, vec3<f32>(1.0));
        // Between children of one parent the flux vanishes; the others go on to the next.
        let outward = vec3<f32>(at) * own.xyz;
        let inward = own.xyz - outward;
        total += 0.5 * vec4<f32>(outward, own.w + fixed - 2.0 * (inward.x + inward.y + inward.z));
    }
    coarse[(id.z + 1u) * level.coarse_plane + id.y * level.coarse_row + id.x] = total;
}
