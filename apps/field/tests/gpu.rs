//! The solver on a graphics card beside the one on the CPU; software such as Mesa's `lavapipe` (mesa-vulkan-drivers) is
//! card enough.

#[path = "../../../tests/common/skip.rs"]
mod skip;

use std::sync::LazyLock;

use elk_field::gpu::{Domain, Gpu, GpuError, NoGpu};
use elk_field::{Cell, Problem, Solution, Solver, solve};
use elk_geometry::{Region, Voxel};
use proptest::prelude::*;
use skip::skip;

static GPU: LazyLock<Result<Gpu, String>> = LazyLock::new(|| Gpu::or_software().map_err(|e| e.to_string()));

/// The card, or word that the test skips.
fn gpu(test: &str) -> Option<&'static Gpu> {
    GPU.as_ref().map_err(|why| skip(test, "vulkan", why)).ok()
}

/// A box of `inner` cells with a margin; `cell` says what each inner cell is.
fn problem(inner: [usize; 3], mut cell: impl FnMut([usize; 3]) -> Cell) -> Problem {
    let region = Region::new(Voxel::new(0, 0, 0), inner.map(|n| n + 2), 1.0);
    let mut cells = vec![Cell::Outside; region.len()];
    for z in 0..inner[2] {
        for y in 0..inner[1] {
            for x in 0..inner[0] {
                cells[((z + 1) * (inner[1] + 2) + y + 1) * (inner[0] + 2) + x + 1] = cell([x, y, z]);
            }
        }
    }
    Problem::new(region, cells).unwrap()
}

/// Rooms and doors: walls across the box, each with a gap, alternating sides.
fn rooms(inner: [usize; 3]) -> Problem {
    let [nx, ny, _] = inner;
    problem(inner, |[x, y, z]| {
        let door = if x / 8 % 2 == 0 { y < 3 } else { y + 3 >= ny };
        match (x, y, z) {
            (1, 1, 1) => Cell::Source,
            (x, ..) if x == nx - 1 && y > ny / 2 => Cell::Sink,
            (x, ..) if x % 8 == 7 && !door => Cell::Outside,
            _ => Cell::Inside,
        }
    })
}

fn furthest(a: &Solution, b: &Solution) -> f32 {
    assert_eq!(a.psi.len(), b.psi.len());
    a.psi.iter().zip(&b.psi).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Solves on both, and says how far they are apart.
fn apart(gpu: &Gpu, problem: &Problem) -> f32 {
    let there = gpu.solve(problem, 1e-8).unwrap();
    let here = solve(problem, Solver::Multigrid, 1e-8);
    assert!(there.residual < 1e-4, "{:e}", there.residual);
    furthest(&there, &here)
}

#[test]
fn software_is_no_card() {
    let Some(any) = gpu("software_is_no_card") else { return };
    match Gpu::new() {
        Ok(card) => assert_eq!(card.name(), any.name(), "a card comes first"),
        Err(NoGpu::None { software }) => assert_eq!(software, any.name()),
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn the_field_of_rooms_is_the_cpus() {
    let Some(gpu) = gpu("the_field_of_rooms_is_the_cpus") else { return };
    for inner in [[31, 14, 6], [70, 33, 9], [64, 32, 16]] {
        let apart = apart(gpu, &rooms(inner));
        // In a labyrinth ψ falls by little a cell, and single precision has its say: the one is as right as the other.
        assert!(apart < 3e-5, "{inner:?}: {apart}");
    }
}

#[test]
fn it_takes_as_few_iterations_as_the_cpu() {
    let Some(gpu) = gpu("it_takes_as_few_iterations_as_the_cpu") else { return };
    for inner in [[31, 14, 6], [64, 32, 16]] {
        let problem = rooms(inner);
        let (there, here) = (gpu.solve(&problem, 1e-6).unwrap(), solve(&problem, Solver::Multigrid, 1e-6));
        assert!(there.iterations <= here.iterations + 2, "{} and {}", there.iterations, here.iterations);
    }
}

#[test]
fn the_same_field_comes_again_to_the_bit() {
    let Some(gpu) = gpu("the_same_field_comes_again_to_the_bit") else { return };
    let problem = rooms([40, 21, 10]);
    let once = gpu.solve(&problem, 1e-6).unwrap();
    assert_eq!(once, gpu.solve(&problem, 1e-6).unwrap());
    let domain = Domain::new(gpu, &problem).unwrap();
    for tolerance in [1e-3, 1e-6] {
        domain.solve(tolerance, || false).unwrap();
    }
    assert_eq!(once, domain.answer().unwrap(), "what a domain solved before leaves no trace");
}

#[test]
fn a_robot_between_goals_needs_no_iteration() {
    let Some(gpu) = gpu("a_robot_between_goals_needs_no_iteration") else { return };
    let problem = problem([3, 1, 1], |[x, ..]| [Cell::Sink, Cell::Source, Cell::Sink][x]);
    let solution = gpu.solve(&problem, 1e-6).unwrap();
    assert_eq!(solution, solve(&problem, Solver::Multigrid, 1e-6));
}

#[test]
fn a_sealed_robot_and_one_without_goals_have_the_value_of_the_source_around_them() {
    let Some(gpu) = gpu("a_sealed_robot_and_one_without_goals_have_the_value_of_the_source_around_them") else {
        return;
    };
    let sealed = problem([20, 9, 9], |[x, y, z]| match (x, y, z) {
        (3, 4, 4) => Cell::Source,
        (10, ..) => Cell::Outside,
        (19, ..) => Cell::Sink,
        _ => Cell::Inside,
    });
    let aimless = problem([17, 5, 3], |at| if at == [1, 1, 1] { Cell::Source } else { Cell::Inside });
    for problem in [sealed, aimless] {
        let solution = gpu.solve(&problem, 1e-7).unwrap();
        let goals = problem.cells().contains(&Cell::Sink);
        for (i, cell) in problem.cells().iter().enumerate() {
            let x = problem.region().voxel(i).x - 1;
            let expected = if *cell == Cell::Outside || goals && x > 10 { 0.0 } else { 1.0 };
            assert!((solution.psi[i] - expected).abs() < 1e-5, "{x}: {}", solution.psi[i]);
        }
    }
}

#[test]
fn without_a_source_there_is_nothing_to_solve() {
    let Some(gpu) = gpu("without_a_source_there_is_nothing_to_solve") else { return };
    let problem = problem([9, 8, 7], |[x, ..]| if x == 8 { Cell::Sink } else { Cell::Inside });
    let solution = gpu.solve(&problem, 1e-6).unwrap();
    assert_eq!((solution.iterations, solution.residual), (0, 0.0));
    assert!(solution.psi.iter().all(|psi| *psi == 0.0));
}

#[test]
fn a_solution_is_given_up_once_nobody_waits_for_it() {
    let Some(gpu) = gpu("a_solution_is_given_up_once_nobody_waits_for_it") else { return };
    let problem = rooms([31, 14, 6]);
    let asked = std::cell::Cell::new(0);
    let stopping = || asked.replace(asked.get() + 1) == 0;
    let domain = Domain::new(gpu, &problem).unwrap();
    let given_up = domain.solve(0.0, stopping).unwrap();
    assert!(given_up <= 20 && asked.get() <= 1, "{given_up} {}", asked.get());
}

#[test]
fn what_a_card_cannot_hold_is_refused() {
    let Some(gpu) = gpu("what_a_card_cannot_hold_is_refused") else { return };
    let region = Region::new(Voxel::new(0, 0, 0), [3, 3, 20_000_000], 1.0);
    let cells = vec![Cell::Outside; region.len()];
    let refused = gpu.solve(&Problem::new(region, cells).unwrap(), 1e-6).unwrap_err();
    assert!(matches!(refused, GpuError::TooLarge { cells: [1, 1, 19_999_998], .. }), "{refused}");
    assert!(apart(gpu, &rooms([20, 9, 5])) < 1e-5, "and the card solves on");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]
    /// Walls, goals, cells without a neighbour, sealed robots, in boxes of any shape.
    #[test]
    fn the_field_is_the_cpus(
        inner in [1..40_usize, 1..20_usize, 1..20_usize],
        seed in 1..u64::MAX,
        walls in 1..20_u64,
        sinks in 0..5_u64,
    ) {
        let Some(gpu) = gpu("the_field_is_the_cpus") else { return Ok(()) };
        let source = inner.map(|n| n / 2);
        let mut random = seed;
        let problem = problem(inner, |at| {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            match (random >> 33) % 100 {
                _ if at == source => Cell::Source,
                kind if kind < walls => Cell::Outside,
                kind if kind < walls + sinks => Cell::Sink,
                _ => Cell::Inside,
            }
        });
        let apart = apart(gpu, &problem.connected());
        prop_assert!(apart < 2e-5, "{apart}");
    }
}
