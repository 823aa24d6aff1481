// The scalars of the conjugate gradients, each from the products of all workgroups, summed by one always in the same
// order.

@group(0) @binding(0) var<storage, read_write> state: State;
@group(0) @binding(1) var<storage, read> products: array<vec4<f32>>;

var<workgroup> lanes: array<f32, 256>;

fn total(local: u32) -> f32 {
    var sum = vec4<f32>(0.0);
    for (var i = local; i < arrayLength(&products); i += 256u) {
        sum += products[i];
    }
    lanes[local] = (sum.x + sum.y) + (sum.z + sum.w);
    for (var half = 128u; half > 0u; half >>= 1u) {
        workgroupBarrier();
        if local < half {
            lanes[local] += lanes[local + half];
        }
    }
    return lanes[0];
}

/// <r, r>: is it enough?
@compute @workgroup_size(256)
fn check(@builtin(local_invocation_index) local: u32) {
    let rr = total(local);
    if local != 0u || state.done != 0u {
        return;
    }
    if state.bb < 0.0 {
        state.bb = rr;
    } else {
        state.iterations += 1u;
    }
    state.done = u32(!(rr > state.enough * state.bb));
}

/// <r, z>
@compute @workgroup_size(256)
fn beta(@builtin(local_invocation_index) local: u32) {
    let rz = total(local);
    if local != 0u || state.done != 0u {
        return;
    }
    state.beta = select(rz / state.rz, 0.0, state.iterations == 0u);
    state.rz = rz;
}

/// <p, Ap>: without curvature, rounding has used up the precision, and there is nothing more to gain.
@compute @workgroup_size(256)
fn alpha(@builtin(local_invocation_index) local: u32) {
    let curvature = total(local);
    if local != 0u || state.done != 0u {
        return;
    }
    state.done = u32(!(curvature > 0.0));
    state.alpha = select(0.0, state.rz / curvature, curvature > 0.0);
}

/// ||b - Ax||^2 of the field that is answered.
@compute @workgroup_size(256)
fn residual(@builtin(local_invocation_index) local: u32) {
    let rr = total(local);
    if local == 0u {
        state.residual = rr;
    }
}
