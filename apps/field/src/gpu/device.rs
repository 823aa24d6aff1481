//! A graphics card, opened, and why there is none.

use std::sync::{Arc, Mutex, PoisonError};

use wgpu::{
    Adapter, Backends, Device, DeviceDescriptor, DeviceType, Instance, InstanceDescriptor, InstanceFlags, Limits, Queue,
};

use super::kernels::Kernels;

/// Why there is no card to solve on.
#[derive(Debug, thiserror::Error)]
pub enum NoGpu {
    /// Vulkan finds none.
    #[error("Vulkan finds no graphics card: a driver has to be installed (only software: {software})")]
    None {
        /// The name of an adapter that is only software, if there is one.
        software: String,
    },
    /// It gives no access.
    #[error("the graphics card {name} gives no access: {reason}")]
    Refused {
        /// Its name.
        name: String,
        /// What it says.
        reason: String,
    },
}

/// Why a card could not solve a problem.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// A buffer is larger than the card can bind, or there are more workgroups than it starts.
    #[error("{name} is too small for {cells:?} cells: {what} takes {needed}, it allows {allowed}; solve it on the CPU")]
    TooLarge {
        /// The card.
        name: String,
        /// Cells along x, y and z.
        cells: [u32; 3],
        /// What is too large.
        what: &'static str,
        /// How much that would be (bytes, or workgroups).
        needed: u64,
        /// What the card allows.
        allowed: u64,
    },
    /// It has run out of memory, or it is gone.
    #[error("{name} failed: {reason}; solve it on the CPU")]
    Failed {
        /// The card.
        name: String,
        /// What it says.
        reason: String,
    },
}

/// A graphics card that solves.
#[derive(Debug)]
pub struct Gpu {
    name: String,
    /// What makes buffers and bindings.
    pub(super) device: Device,
    /// What runs them.
    pub(super) queue: Queue,
    /// What it allows.
    pub(super) limits: Limits,
    /// What it runs.
    pub(super) kernels: Kernels,
    /// The first failure that nobody has been told of.
    failure: Arc<Mutex<Option<String>>>,
}

impl Gpu {
    /// The fastest graphics card.
    ///
    /// # Errors
    /// There is none, or it gives no access.
    pub fn new() -> Result<Self, NoGpu> {
        Self::first_of(|kind| kind != DeviceType::Cpu)
    }

    /// The fastest graphics card, or else one that is only software, such as Mesa's `lavapipe`: that is slower than
    /// [`solve`](crate::solve) and there to try things out.
    ///
    /// # Errors
    /// There is none, or it gives no access.
    pub fn or_software() -> Result<Self, NoGpu> {
        Self::first_of(|_| true)
    }

    fn first_of(is_right: impl Fn(DeviceType) -> bool) -> Result<Self, NoGpu> {
        let instance = Instance::new(InstanceDescriptor {
            backends: Backends::VULKAN,
            flags: InstanceFlags::empty(),
            ..InstanceDescriptor::new_without_display_handle()
        });
        let mut adapters = pollster::block_on(instance.enumerate_adapters(Backends::VULKAN));
        adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
        match adapters.iter().find(|adapter| is_right(adapter.get_info().device_type)) {
            Some(adapter) => Self::open(adapter),
            None => {
                let software = adapters.first().map_or("none".to_owned(), |adapter| adapter.get_info().name);
                Err(NoGpu::None { software })
            }
        }
    }

    fn open(adapter: &Adapter) -> Result<Self, NoGpu> {
        let (name, limits) = (adapter.get_info().name, adapter.limits());
        let wanted = DeviceDescriptor { required_limits: limits.clone(), ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&wanted))
            .map_err(|e| NoGpu::Refused { name: name.clone(), reason: e.to_string() })?;
        let failure = Arc::new(Mutex::new(None));
        let told = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error| {
            let mut told = told.lock().unwrap_or_else(PoisonError::into_inner);
            told.get_or_insert_with(|| error.to_string());
        }));
        let kernels = Kernels::new(&device);
        let gpu = Self { name, device, queue, limits, kernels, failure };
        match gpu.failed() {
            Ok(()) => Ok(gpu),
            Err(GpuError::Failed { name, reason }) => Err(NoGpu::Refused { name, reason }),
            Err(other) => Err(NoGpu::Refused { name: gpu.name.clone(), reason: other.to_string() }),
        }
    }

    /// What it calls itself.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether something has gone wrong since this was last asked.
    pub(super) fn failed(&self) -> Result<(), GpuError> {
        let mut failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.take().map_or(Ok(()), |reason| Err(self.failure(reason)))
    }

    /// That it has failed, and why.
    pub(super) fn failure(&self, reason: String) -> GpuError {
        GpuError::Failed { name: self.name.clone(), reason }
    }
}

/// Faster kinds first.
fn rank(kind: DeviceType) -> u8 {
    match kind {
        DeviceType::DiscreteGpu => 0,
        DeviceType::IntegratedGpu => 1,
        DeviceType::VirtualGpu => 2,
        DeviceType::Other => 3,
        DeviceType::Cpu => 4,
    }
}
