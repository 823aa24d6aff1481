//! A problem on a card: its buffers, and the dispatches of the kernels that solve it.

use std::sync::mpsc::channel;

use bytemuck::{Pod, Zeroable, bytes_of, cast_slice, pod_read_unaligned};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, Buffer, BufferDescriptor, BufferUsages, CommandEncoder,
    ComputePipeline, MapMode, PollType,
};

use super::device::{Gpu, GpuError};
use super::grid::Grid;
use crate::laplace::Solution;
use crate::problem::Problem;

/// Cells of a workgroup that walks through planes: 32 pairs, 8 rows, 4 planes.
const MARCH: [u32; 3] = [64, 8, 4];
/// Coarse cells of a workgroup that walks through coarse planes.
const COARSE_MARCH: [u32; 3] = [32, 8, 2];
/// Coarse cells of a workgroup whose every invocation has one.
const COARSE_CELLS: [u32; 3] = [32, 8, 1];
/// Voxels of a workgroup whose every invocation has one.
const VOXELS: [u32; 3] = [64, 4, 1];
/// Cells of a workgroup whose every invocation has a word of degrees.
const WORDS: [u32; 3] = [64, 8, 4];

/// Iterations between two looks at whether it is done. Those too many cost next to nothing.
const ITERATIONS_A_LOOK: usize = 12;
/// Past this something is wrong with the problem, not with the number.
const MAX_ITERATIONS: usize = 5000;

/// A level, as `level.wgsl` has it.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Level {
    pairs: u32,
    rows: u32,
    planes: u32,
    row: u32,
    plane: u32,
    coarse_row: u32,
    coarse_plane: u32,
    coarse_rows: u32,
    coarse_planes: u32,
    padding: [u32; 3],
}

impl Level {
    fn of(grid: Grid) -> Self {
        let (Grid([x, y, z]), coarse) = (grid, grid.coarser());
        Self {
            pairs: x.div_ceil(2),
            rows: y,
            planes: z,
            row: (grid.row() / 2) as u32,
            plane: (grid.plane() / 2) as u32,
            coarse_row: coarse.row() as u32,
            coarse_plane: coarse.plane() as u32,
            coarse_rows: coarse.0[1],
            coarse_planes: coarse.0[2],
            padding: [0; 3],
        }
    }
}

/// The region of a problem, as `volume.wgsl` has it.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Volume {
    row: u32,
    plane: u32,
    len: u32,
    padding: u32,
}

/// The scalars, as `state.wgsl` has them.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct State {
    rz: f32,
    alpha: f32,
    beta: f32,
    bb: f32,
    enough: f32,
    residual: f32,
    iterations: u32,
    done: u32,
}

/// A kernel with all that it works on.
#[derive(Debug)]
struct Step {
    pipeline: ComputePipeline,
    bindings: BindGroup,
    groups: [u32; 3],
}

/// A problem on a card, to be solved there as often as one likes.
#[derive(Debug)]
pub struct Domain<'a> {
    gpu: &'a Gpu,
    state: Buffer,
    x: Buffer,
    psi: Buffer,
    voxels: usize,
    /// The right-hand side becomes the residual, and it may be small enough at once.
    start: Vec<Step>,
    /// An even and an odd one: each reads the residual and the direction that the other writes.
    iterations: [Vec<Step>; 2],
    answer: Vec<Step>,
}

/// The vectors and the operator of a level.
struct LevelBuffers {
    grid: Grid,
    level: Buffer,
    operator: Buffer,
    /// Right-hand side (on the finest level, where there are two of them, none), and two vectors to work in.
    b: Option<Buffer>,
    x: Buffer,
    scratch: Buffer,
}

impl<'a> Domain<'a> {
    /// Brings a problem to the card, and makes its coarser levels there.
    ///
    /// # Errors
    /// It is too large for the card, or the card fails.
    pub fn new(gpu: &'a Gpu, problem: &Problem) -> Result<Self, GpuError> {
        let grid = Grid(problem.dim().map(|n| (n - 2) as u32));
        check(gpu, problem, grid)?;
        let domain = Builder::new(gpu, problem, grid).build();
        gpu.failed()?;
        Ok(domain)
    }

    /// Solves it until the residual is below `tolerance` of the right-hand side's, or somebody is `stopping`; answers
    /// the iterations.
    ///
    /// # Errors
    /// The card fails.
    pub fn solve(&self, tolerance: f64, stopping: impl Fn() -> bool) -> Result<usize, GpuError> {
        let enough = (tolerance * tolerance) as f32;
        let state = State { rz: 1.0, bb: -1.0, enough, ..Zeroable::zeroed() };
        self.gpu.queue.write_buffer(&self.state, 0, bytes_of(&state));
        self.run(|encoder| {
            encoder.clear_buffer(&self.x, 0, None);
            dispatch(encoder, &self.start);
        });
        let mut iteration = 0;
        loop {
            self.run(|encoder| {
                for i in iteration..iteration + ITERATIONS_A_LOOK {
                    dispatch(encoder, &self.iterations[i % 2]);
                }
            });
            iteration += ITERATIONS_A_LOOK;
            let state = self.state()?;
            if state.done != 0 || iteration >= MAX_ITERATIONS || stopping() {
                return Ok(state.iterations as usize);
            }
        }
    }

    /// The field, from the card.
    ///
    /// # Errors
    /// The card fails.
    pub fn answer(&self) -> Result<Solution, GpuError> {
        self.run(|encoder| dispatch(encoder, &self.answer));
        let State { residual, bb, iterations, .. } = self.state()?;
        let scale = if bb > 0.0 { f64::from(bb).sqrt() } else { 1.0 };
        let psi = self.read(&self.psi, |bytes| cast_slice::<u8, f32>(&bytes[..4 * self.voxels]).to_vec())?;
        Ok(Solution { psi, iterations: iterations as usize, residual: f64::from(residual).sqrt() / scale })
    }

    fn state(&self) -> Result<State, GpuError> {
        self.read(&self.state, pod_read_unaligned)
    }

    fn run(&self, record: impl FnOnce(&mut CommandEncoder)) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        record(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// What `take` makes of the bytes of a buffer, once all that was submitted is done.
    fn read<T>(&self, from: &Buffer, take: impl FnOnce(&[u8]) -> T) -> Result<T, GpuError> {
        let usage = BufferUsages::COPY_DST | BufferUsages::MAP_READ;
        let here = buffer(self.gpu, from.size(), usage);
        self.run(|encoder| encoder.copy_buffer_to_buffer(from, 0, &here, 0, from.size()));
        let (mapped, is_mapped) = channel();
        here.map_async(MapMode::Read, .., move |result| {
            // Nobody is there to hear it if the wait below has failed.
            let _ = mapped.send(result);
        });
        let wait = self.gpu.device.poll(PollType::wait_indefinitely());
        self.gpu.failed()?;
        wait.map_err(|e| self.gpu.failure(e.to_string()))?;
        let mapping = is_mapped.recv().map_err(|e| self.gpu.failure(e.to_string()))?;
        mapping.map_err(|e| self.gpu.failure(e.to_string()))?;
        let bytes = here.get_mapped_range(..).map_err(|e| self.gpu.failure(e.to_string()))?;
        Ok(take(&bytes))
    }
}

fn dispatch(encoder: &mut CommandEncoder, steps: &[Step]) {
    let mut pass = encoder.begin_compute_pass(&Default::default());
    for step in steps {
        pass.set_pipeline(&step.pipeline);
        pass.set_bind_group(0, &step.bindings, &[]);
        let [x, y, z] = step.groups;
        pass.dispatch_workgroups(x, y, z);
    }
}

/// Workgroups for so many of something along each axis.
fn groups(count: [u32; 3], of_each: [u32; 3]) -> [u32; 3] {
    [0, 1, 2].map(|axis| count[axis].div_ceil(of_each[axis]))
}

/// Whether a card can bind the largest buffer and start the workgroups.
fn check(gpu: &Gpu, problem: &Problem, grid: Grid) -> Result<(), GpuError> {
    let limits = &gpu.limits;
    let refused = |what, needed, allowed| {
        Err(GpuError::TooLarge { name: gpu.name().to_owned(), cells: grid.0, what, needed, allowed })
    };
    // Cells are numbered by 32 bits.
    let (largest, cells) = (4 * grid.len().max(problem.cells().len() as u64), u64::from(u32::MAX));
    let allowed = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size).min(4 * cells);
    if largest > allowed {
        return refused("a vector", largest, allowed);
    }
    let dim = problem.dim().map(|n| n as u32);
    let most = [groups(dim, VOXELS), groups(grid.0, MARCH), groups(grid.0, WORDS)].into_iter().flatten().max();
    let (most, allowed) = (most.unwrap_or(0), limits.max_compute_workgroups_per_dimension);
    if most > allowed {
        return refused("an axis in workgroups", most.into(), allowed.into());
    }
    Ok(())
}

fn buffer(gpu: &Gpu, size: u64, usage: BufferUsages) -> Buffer {
    gpu.device.create_buffer(&BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}

/// What a domain is built of.
struct Builder<'a> {
    gpu: &'a Gpu,
    dim: [u32; 3],
    volume: Buffer,
    cells: Buffer,
    state: Buffer,
    products: Buffer,
    levels: Vec<LevelBuffers>,
    /// Each iteration reads one of the two and writes the other.
    r: [Buffer; 2],
    p: [Buffer; 2],
    ap: Buffer,
    x: Buffer,
}

impl<'a> Builder<'a> {
    fn new(gpu: &'a Gpu, problem: &Problem, grid: Grid) -> Self {
        let dim = problem.dim().map(|n| n as u32);
        let kinds: Vec<u8> = problem.cells().iter().map(|cell| *cell as u8).collect();
        let volume = Volume { row: dim[0], plane: dim[0] * dim[1], len: kinds.len() as u32, padding: 0 };
        let vector = || storage(gpu, 4 * grid.len());
        let products = groups(grid.0, MARCH).iter().map(|n| u64::from(*n)).product();
        Self {
            gpu,
            dim,
            volume: uniform(gpu, bytes_of(&volume)),
            cells: filled(gpu, kinds),
            state: storage(gpu, size_of::<State>() as u64),
            products: storage(gpu, products_size(products)),
            levels: grid
                .levels()
                .into_iter()
                .enumerate()
                .map(|(n, grid)| LevelBuffers::new(gpu, grid, n == 0))
                .collect(),
            r: [vector(), vector()],
            p: [vector(), vector()],
            ap: vector(),
            x: vector(),
        }
    }

    fn build(self) -> Domain<'a> {
        let once = self.levels_once();
        let psi = storage(self.gpu, 4 * self.dim.iter().map(|n| u64::from(*n)).product::<u64>());
        let domain = Domain {
            gpu: self.gpu,
            start: self.start(),
            iterations: [self.iteration(0), self.iteration(1)],
            answer: self.answer(&psi),
            voxels: (psi.size() / 4) as usize,
            psi,
            state: self.state,
            x: self.x,
        };
        domain.run(|encoder| dispatch(encoder, &once));
        domain
    }

    /// A kernel with the level's own bindings, which are the first three, and those that are its own.
    fn on_level(&self, pipeline: &ComputePipeline, n: usize, more: &[(u32, &Buffer)], groups: [u32; 3]) -> Step {
        let level = &self.levels[n];
        let own = [(0, &level.level), (1, &self.state), (2, &level.operator)];
        step(self.gpu, pipeline, &[&own, more].concat(), groups)
    }

    /// A kernel that walks through the planes of a level.
    fn march(&self, pipeline: &ComputePipeline, n: usize, more: &[(u32, &Buffer)]) -> Step {
        self.on_level(pipeline, n, more, groups(self.levels[n].grid.0, MARCH))
    }

    /// A kernel that makes a scalar of the products.
    fn scalar(&self, pipeline: &ComputePipeline) -> Step {
        step(self.gpu, pipeline, &[(0, &self.state), (1, &self.products)], [1; 3])
    }

    /// The finest level from the cells, and its first residual.
    fn first_level(&self) -> Step {
        let finest = &self.levels[0];
        let own = [(0, &finest.level), (2, &finest.operator), (4, &self.r[0]), (8, &self.volume), (9, &self.cells)];
        step(self.gpu, &self.gpu.kernels.start, &own, groups(finest.grid.0, WORDS))
    }

    /// All levels, which stay.
    fn levels_once(&self) -> Vec<Step> {
        let coarser = (1..self.levels.len()).map(|n| {
            let (fine, coarse) = (&self.levels[n - 1], &self.levels[n]);
            let own = [(0, &fine.level), (2, &fine.operator), (4, &coarse.operator)];
            step(self.gpu, self.gpu.kernels.coarsen.of(n - 1), &own, groups(coarse.grid.0, COARSE_CELLS))
        });
        std::iter::once(self.first_level()).chain(coarser).collect()
    }

    fn start(&self) -> Vec<Step> {
        vec![self.first_level(), self.descend(0), self.scalar(&self.gpu.kernels.check)]
    }

    /// An even or an odd iteration: the rest of the cycle, a direction, a step along it, and the first half of the next
    /// cycle, which is at hand when the residual is.
    fn iteration(&self, parity: usize) -> Vec<Step> {
        let kernels = &self.gpu.kernels;
        let mut steps = self.cycle(&self.r[1 - parity]);
        steps.extend([
            self.scalar(&kernels.beta),
            self.direction(parity),
            self.scalar(&kernels.alpha),
            self.descend(1 - parity),
            self.scalar(&kernels.check),
        ]);
        steps
    }

    fn direction(&self, parity: usize) -> Step {
        let own = [
            (3, &self.products),
            (4, &self.levels[0].x),
            (5, &self.p[parity]),
            (6, &self.p[1 - parity]),
            (7, &self.ap),
            (8, &self.x),
        ];
        self.march(&self.gpu.kernels.direction, 0, &own)
    }

    /// From the residual in `r[from]` to the next in the other.
    fn descend(&self, from: usize) -> Step {
        let own =
            [(3, &self.products), (4, &self.r[from]), (5, &self.ap), (6, &self.r[1 - from]), (7, &self.levels[0].x)];
        self.march(&self.gpu.kernels.descend, 0, &own)
    }

    /// A V-cycle on `r`, but for the sweeps from zero on the finest level.
    fn cycle(&self, r: &Buffer) -> Vec<Step> {
        let last = self.levels.len() - 1;
        let down = (0..last).flat_map(|n| {
            let sweeps = (n > 0).then(|| self.smooth_from_zero(n, r));
            sweeps.into_iter().chain([self.restrict(n, r)])
        });
        let up = (0..last).rev().flat_map(|n| [self.correct(n, r), self.smooth(n, r)]);
        down.chain([self.coarsest(last, r)]).chain(up).collect()
    }

    /// Right-hand side of a level, on the finest `r`.
    fn b<'b>(&'b self, n: usize, r: &'b Buffer) -> &'b Buffer {
        self.levels[n].b.as_ref().unwrap_or(r)
    }

    fn smooth_from_zero(&self, n: usize, r: &Buffer) -> Step {
        self.march(&self.gpu.kernels.smooth_from_zero, n, &[(4, self.b(n, r)), (5, &self.levels[n].x)])
    }

    fn restrict(&self, n: usize, r: &Buffer) -> Step {
        let own = [(4, &self.levels[n].x), (5, self.b(n, r)), (6, self.b(n + 1, r))];
        let groups = groups(self.levels[n + 1].grid.0, COARSE_MARCH);
        self.on_level(self.gpu.kernels.restrict.of(n), n, &own, groups)
    }

    fn coarsest(&self, n: usize, r: &Buffer) -> Step {
        self.on_level(&self.gpu.kernels.coarsest, n, &[(4, self.b(n, r)), (5, &self.levels[n].x)], [1; 3])
    }

    fn correct(&self, n: usize, r: &Buffer) -> Step {
        let (level, coarse) = (&self.levels[n], &self.levels[n + 1]);
        let own = [(4, &level.x), (5, &coarse.x), (6, self.b(n, r)), (7, &level.scratch)];
        self.march(self.gpu.kernels.correct.of(n), n, &own)
    }

    fn smooth(&self, n: usize, r: &Buffer) -> Step {
        let level = &self.levels[n];
        let mut own = vec![(4, &level.scratch), (5, self.b(n, r)), (6, &level.x)];
        if n == 0 {
            own.push((3, &self.products));
        }
        self.march(self.gpu.kernels.smooth.of(n), n, &own)
    }

    fn answer(&self, psi: &Buffer) -> Vec<Step> {
        let kernels = &self.gpu.kernels;
        let groups = groups(self.dim, VOXELS);
        let products = storage(self.gpu, products_size(groups.iter().map(|n| u64::from(*n)).product()));
        let field = [
            (0, &self.levels[0].level),
            (1, &self.state),
            (2, &self.x),
            (4, &self.p[0]),
            (5, &self.p[1]),
            (6, psi),
            (8, &self.volume),
            (9, &self.cells),
        ];
        let residual = [(3, &products), (6, psi), (8, &self.volume), (9, &self.cells)];
        vec![
            step(self.gpu, &kernels.answer, &field, groups),
            step(self.gpu, &kernels.residual, &residual, groups),
            step(self.gpu, &kernels.residual_sum, &[(0, &self.state), (1, &products)], [1; 3]),
        ]
    }
}

impl LevelBuffers {
    fn new(gpu: &Gpu, grid: Grid, is_finest: bool) -> Self {
        let vector = || storage(gpu, 4 * grid.len());
        Self {
            grid,
            level: uniform(gpu, bytes_of(&Level::of(grid))),
            operator: storage(gpu, if is_finest { grid.len() / 2 } else { 16 * grid.len() }),
            b: (!is_finest).then(vector),
            x: vector(),
            scratch: vector(),
        }
    }
}

fn step(gpu: &Gpu, pipeline: &ComputePipeline, bindings: &[(u32, &Buffer)], groups: [u32; 3]) -> Step {
    let bindings = bindings.iter().map(|(binding, buffer)| (*binding, buffer.as_entire_binding()));
    let entries: Vec<_> = bindings.map(|(binding, resource)| BindGroupEntry { binding, resource }).collect();
    let layout = &pipeline.get_bind_group_layout(0);
    let bindings = gpu.device.create_bind_group(&BindGroupDescriptor { label: None, layout, entries: &entries });
    Step { pipeline: pipeline.clone(), bindings, groups }
}

/// Bytes for so many products, in whole vectors of four.
fn products_size(count: u64) -> u64 {
    4 * count.next_multiple_of(4)
}

fn storage(gpu: &Gpu, size: u64) -> Buffer {
    buffer(gpu, size, BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST)
}

fn uniform(gpu: &Gpu, bytes: &[u8]) -> Buffer {
    let buffer = buffer(gpu, bytes.len() as u64, BufferUsages::UNIFORM | BufferUsages::COPY_DST);
    gpu.queue.write_buffer(&buffer, 0, bytes);
    buffer
}

/// A buffer with these bytes, and zeros to the next word.
fn filled(gpu: &Gpu, mut bytes: Vec<u8>) -> Buffer {
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let buffer = storage(gpu, bytes.len() as u64);
    gpu.queue.write_buffer(&buffer, 0, &bytes);
    buffer
}
