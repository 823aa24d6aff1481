/// Two damped sweeps from zero in one: `around` is the sum of the first sweep's values, before they are damped.
fn twice_from_zero(inverse: vec2<f32>, b: vec2<f32>, around: vec2<f32>) -> vec2<f32> {
    let both = OMEGA.x * OMEGA.y;
    return inverse * ((OMEGA.x + OMEGA.y - both) * b + both * around);
}
