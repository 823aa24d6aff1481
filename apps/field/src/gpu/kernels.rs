//! The kernels, each put together from the parts that it is made of.

use std::borrow::Cow;

use wgpu::{
    ComputePipeline, ComputePipelineDescriptor, Device, PipelineCompilationOptions, ShaderModuleDescriptor,
    ShaderSource,
};

const STATE: &str = include_str!("shaders/state.wgsl");
const LEVEL: &str = include_str!("shaders/level.wgsl");
const VOLUME: &str = include_str!("shaders/volume.wgsl");
const UNIT: &str = include_str!("shaders/unit.wgsl");
const WEIGHTED: &str = include_str!("shaders/weighted.wgsl");
const DOT: &str = include_str!("shaders/dot.wgsl");
const NO_DOT: &str = include_str!("shaders/no_dot.wgsl");
const TWICE: &str = include_str!("shaders/twice.wgsl");
const MARCH: &str = include_str!("shaders/march.wgsl");
const START: &str = include_str!("shaders/start.wgsl");
const COARSEN: &str = include_str!("shaders/coarsen.wgsl");
const DIRECTION: &str = include_str!("shaders/direction.wgsl");
const DESCEND: &str = include_str!("shaders/descend.wgsl");
const SMOOTH_FROM_ZERO: &str = include_str!("shaders/smooth_from_zero.wgsl");
const RESTRICT: &str = include_str!("shaders/restrict.wgsl");
const COARSEST: &str = include_str!("shaders/coarsest.wgsl");
const CORRECT: &str = include_str!("shaders/correct.wgsl");
const SMOOTH: &str = include_str!("shaders/smooth.wgsl");
const SCALARS: &str = include_str!("shaders/scalars.wgsl");
const ANSWER: &str = include_str!("shaders/answer.wgsl");
const RESIDUAL: &str = include_str!("shaders/residual.wgsl");

/// The same kernel for the finest level, whose weights are 1, and for the others.
#[derive(Debug)]
pub struct ByLevel {
    /// For the finest.
    pub unit: ComputePipeline,
    /// For the coarser ones.
    pub weighted: ComputePipeline,
}

impl ByLevel {
    /// The one for a level, 0 being the finest.
    pub fn of(&self, level: usize) -> &ComputePipeline {
        if level == 0 { &self.unit } else { &self.weighted }
    }
}

/// What a graphics card runs; what each does is said in its file under `shaders/`.
#[derive(Debug)]
pub struct Kernels {
    /// Cells become the finest level and its right-hand side.
    pub start: ComputePipeline,
    /// A level's next coarser operator.
    pub coarsen: ByLevel,
    /// Search direction of the conjugate gradients.
    pub direction: ComputePipeline,
    /// Residual, and the first half of the cycle on the finest level.
    pub descend: ComputePipeline,
    /// The first half on a coarser level.
    pub smooth_from_zero: ComputePipeline,
    /// A level's residual becomes the next coarser right-hand side.
    pub restrict: ByLevel,
    /// All of the cycle on the coarsest level.
    pub coarsest: ComputePipeline,
    /// The second half: correction and a sweep.
    pub correct: ByLevel,
    /// The second half: the last sweep.
    pub smooth: ByLevel,
    /// α of the conjugate gradients.
    pub alpha: ComputePipeline,
    /// β of the conjugate gradients.
    pub beta: ComputePipeline,
    /// Whether the residual is small enough.
    pub check: ComputePipeline,
    /// The field by the problem's voxels.
    pub answer: ComputePipeline,
    /// Products of the residual of that field.
    pub residual: ComputePipeline,
    /// Their sum.
    pub residual_sum: ComputePipeline,
}

impl Kernels {
    /// Compiles them.
    pub fn new(device: &Device) -> Self {
        let kernel = |parts: &[&str]| pipeline(device, parts, "main");
        let scalar = |entry: &str| pipeline(device, &[STATE, SCALARS], entry);
        let by_level = |dot: [&str; 2], parts: &[&str]| ByLevel {
            unit: kernel(&[&[STATE, LEVEL, UNIT, dot[0]], parts].concat()),
            weighted: kernel(&[&[STATE, LEVEL, WEIGHTED, dot[1]], parts].concat()),
        };
        Self {
            start: kernel(&[STATE, LEVEL, VOLUME, START]),
            coarsen: by_level(["", ""], &[COARSEN]),
            direction: kernel(&[STATE, LEVEL, UNIT, DOT, DIRECTION, MARCH]),
            descend: kernel(&[STATE, LEVEL, UNIT, DOT, TWICE, DESCEND, MARCH]),
            smooth_from_zero: kernel(&[STATE, LEVEL, WEIGHTED, NO_DOT, TWICE, SMOOTH_FROM_ZERO, MARCH]),
            restrict: by_level(["", ""], &[RESTRICT]),
            coarsest: kernel(&[STATE, LEVEL, WEIGHTED, COARSEST]),
            correct: by_level([NO_DOT, NO_DOT], &[CORRECT, MARCH]),
            smooth: by_level([DOT, NO_DOT], &[SMOOTH, MARCH]),
            alpha: scalar("alpha"),
            beta: scalar("beta"),
            check: scalar("check"),
            answer: kernel(&[STATE, LEVEL, VOLUME, ANSWER]),
            residual: kernel(&[VOLUME, DOT, RESIDUAL]),
            residual_sum: scalar("residual"),
        }
    }
}

fn pipeline(device: &Device, parts: &[&str], entry: &str) -> ComputePipeline {
    let source = ShaderSource::Wgsl(Cow::Owned(parts.concat()));
    let module = device.create_shader_module(ShaderModuleDescriptor { label: Some(entry), source });
    device.create_compute_pipeline(&ComputePipelineDescriptor {
        label: Some(entry),
        layout: None,
        module: &module,
        entry_point: Some(entry),
        // What is shared by a workgroup is written before it is read.
        compilation_options: PipelineCompilationOptions {
            zero_initialize_workgroup_memory: false,
            ..Default::default()
        },
        cache: None,
    })
}
