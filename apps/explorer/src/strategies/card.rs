//! A graphics card that solves Laplace's equation, where elk is built with the feature `gpu` and there is one.

use elk_field::{Problem, Solution};

/// A graphics card.
#[cfg(feature = "gpu")]
#[derive(Debug, Clone)]
pub struct Card(std::sync::Arc<elk_field::gpu::Gpu>);

#[cfg(feature = "gpu")]
impl Card {
    /// The fastest one.
    ///
    /// # Errors
    /// There is none, or it gives no access.
    pub fn open() -> Result<Self, String> {
        elk_field::gpu::Gpu::new().map(|gpu| Self(gpu.into())).map_err(|e| e.to_string())
    }

    /// As [`elk_field::solve_unless`].
    ///
    /// # Errors
    /// It is too small for the problem, or it fails.
    pub fn solve_unless(
        &self,
        problem: &Problem,
        tolerance: f64,
        stopping: impl Fn() -> bool,
    ) -> Result<Solution, String> {
        self.0.solve_unless(problem, tolerance, stopping).map_err(|e| e.to_string())
    }

    /// What it calls itself.
    pub fn name(&self) -> &str {
        self.0.name()
    }
}

/// A graphics card, of which there is none.
#[cfg(not(feature = "gpu"))]
#[derive(Debug, Clone)]
pub enum Card {}

#[cfg(not(feature = "gpu"))]
impl Card {
    /// There is none.
    ///
    /// # Errors
    /// Always.
    pub fn open() -> Result<Self, String> {
        Err("this elk was built without the feature gpu".to_owned())
    }

    /// Nothing, since there is none.
    ///
    /// # Errors
    /// None.
    pub fn solve_unless(&self, _: &Problem, _: f64, _: impl Fn() -> bool) -> Result<Solution, String> {
        match *self {}
    }

    /// Nothing, since there is none.
    pub fn name(&self) -> &str {
        match *self {}
    }
}
