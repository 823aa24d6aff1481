/// The scalars of the conjugate gradients.
struct State {
    /// <r, z>, with z the preconditioned residual.
    rz: f32,
    alpha: f32,
    beta: f32,
    /// <b, b>; negative until it is known.
    bb: f32,
    /// The square of the relative residual that is enough.
    enough: f32,
    /// <r, r> of the field that is answered.
    residual: f32,
    iterations: u32,
    /// Not zero once there is nothing more to do: every kernel returns at once.
    done: u32,
}
