use super::lattice::NONE;
use super::*;
use crate::{Solver, solve};
use proptest::prelude::*;

/// A box of `dim` voxels at `origin` with a margin; `cell` says what each inner voxel is.
fn problem(origin: Voxel, dim: [usize; 3], cell: impl Fn(Voxel) -> Cell) -> Problem {
    let region = Region::new(origin - Voxel::new(1, 1, 1), dim.map(|n| n + 2), 0.1);
    let last = origin + Voxel::new(dim[0] as i32, dim[1] as i32, dim[2] as i32);
    let is_inner = |v: Voxel| {
        let (v, from, to) = (v.to_array(), origin.to_array(), last.to_array());
        (0..3).all(|a| (from[a]..to[a]).contains(&v[a]))
    };
    let cells = (0..region.len()).map(|i| region.voxel(i)).map(|v| if is_inner(v) { cell(v) } else { Cell::Outside });
    let cells = cells.collect();
    Problem::new(region, cells).unwrap()
}

/// What a cell is by a number, mostly inside.
fn kind(number: u8) -> Cell {
    match number {
        0..=2 => Cell::Outside,
        3 => Cell::Sink,
        4 => Cell::Source,
        _ => Cell::Inside,
    }
}

/// All equations of all levels, by position: what two domains have to agree on.
fn equations(domain: &mut Domain) -> Vec<String> {
    domain.settle();
    let Domain { fine, coarse, cells, squares, .. } = &*domain;
    let finest = fine.lattice.order().iter().map(|&slot| {
        let (position, at) = (fine.lattice.position(slot), slot as usize);
        let beside = fine.lattice.neighbours(slot).map(|n| (n != NONE).then(|| fine.lattice.position(n)));
        let own = (cells[at], fine.stencil.neighbours[at], fine.stencil.sixtieths[at], fine.cells[at], squares[at]);
        format!("{position:?} {beside:?} {own:?}")
    });
    let levels = coarse.iter().flat_map(|level| {
        let blocks = level.lattice.order().iter();
        blocks.map(|&slot| {
            format!(
                "{:?} {:?} {:?}",
                level.lattice.position(slot),
                level.stencil.blocks[slot as usize],
                level.stencil.fill[slot as usize]
            )
        })
    });
    finest.chain(levels).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn a_kept_domain_is_the_one_that_would_be_made_anew(
        edits in prop::collection::vec(((-20..30i32, -9..12i32, -5..9i32), 0..12u8), 1..600),
        solutions in prop::collection::vec(0..600usize, 0..4),
    ) {
        let mut kept = Domain::new();
        let mut cells = std::collections::BTreeMap::new();
        for (i, ((x, y, z), number)) in edits.into_iter().enumerate() {
            // In eights, so that there are whole blocks, empty ones, and ones that come and go.
            for voxel in (0..8).map(|d| Voxel::new(2 * x + (d & 1), 2 * y + (d >> 1 & 1), 2 * z + (d >> 2))) {
                kept.set(voxel, kind(number));
                cells.insert(voxel, kind(number));
            }
            if solutions.contains(&i) {
                kept.solve(1e-3, || false);
            }
        }
        let mut fresh = Domain::new();
        cells.iter().for_each(|(voxel, cell)| fresh.set(*voxel, *cell));
        prop_assert_eq!(equations(&mut kept), equations(&mut fresh));
        // Solved from nothing, both are equal to the bit.
        kept.forget();
        prop_assert_eq!(kept.solve(1e-6, || false), fresh.solve(1e-6, || false));
        for voxel in cells.keys() {
            prop_assert_eq!(kept.psi(*voxel).to_bits(), fresh.psi(*voxel).to_bits());
        }
        // And so they are nearly solved, one after a solution and the other before any.
        let mut fresh = Domain::new();
        cells.iter().for_each(|(voxel, cell)| fresh.set(*voxel, *cell));
        prop_assert_eq!(kept.cascade(1e-2, || false), fresh.cascade(1e-2, || false));
        for (voxel, cell) in &cells {
            let psi = kept.psi(*voxel);
            prop_assert_eq!(psi.to_bits(), fresh.psi(*voxel).to_bits());
            prop_assert!(cell.fixed().is_none_or(|value| psi == value) && (*cell != Cell::Outside || psi == 0.0));
        }
    }

    /// What is interpolated and smoothed lies between what it is of: a cascade keeps the maximum principle as far as the coarser
    /// cells are solved. And it is nearly the solution.
    #[test]
    fn a_cascade_is_bounded_and_near_the_solution(
        boxes in prop::collection::vec(((1..36i32, 1..22i32, 0..14i32), (2..7i32, 2..7i32, 2..7i32)), 0..40),
        sink in (0..20i32, 0..11i32),
    ) {
        let robot = Voxel::new(2, 2, 2);
        let is_in = |v: Voxel, ((x, y, z), (a, b, c)): &((i32, i32, i32), (i32, i32, i32))| {
            (*x..x + a).contains(&v.x) && (*y..y + b).contains(&v.y) && (*z..z + c).contains(&v.z)
        };
        let problem = problem(Voxel::new(-3, -5, -7), [40, 25, 15], |v| match v - Voxel::new(-3, -5, -7) {
            v if v == robot => Cell::Source,
            v if v.x == 39 && (v.y - sink.0).abs() < 3 && (v.z - sink.1).abs() < 3 => Cell::Sink,
            v if boxes.iter().any(|taken| is_in(v, taken)) => Cell::Outside,
            _ => Cell::Inside,
        })
        .connected();
        let mut domain = Domain::of(&problem);
        domain.cascade(1e-6, || false);
        let near = domain.psi_of(problem.region());
        prop_assert!(near.iter().all(|psi| (-1e-4..=1.0 + 1e-4).contains(psi)));
        let exact = solve(&problem, Solver::Multigrid, 1e-6).psi;
        let worst = near.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        prop_assert!(worst < 0.06, "{}", worst);
        // Solved on from there, it is the solution.
        domain.solve(1e-6, || false);
        let after = domain.psi_of(problem.region());
        let worst = after.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        prop_assert!(worst < 2e-5, "{}", worst);
    }

    #[test]
    fn a_domain_becomes_whatever_problem_it_is_given(
        first in prop::collection::vec(0..12u8, 12 * 10 * 9),
        second in prop::collection::vec(0..12u8, 12 * 10 * 9),
        moved in (-20..20i32, -20..20i32, -20..20i32),
    ) {
        let of = |kinds: &[u8], origin: Voxel| problem(origin, [12, 10, 9], |v| {
            let [x, y, z] = (v - origin).to_array().map(|c| c as usize);
            kind(kinds[(z * 10 + y) * 12 + x])
        });
        let first = of(&first, Voxel::new(-5, 3, -1));
        let second = of(&second, Voxel::new(moved.0, moved.1, moved.2));
        let mut kept = Domain::of(&first);
        kept.solve(1e-6, || false);
        kept.update(&second);
        kept.forget();
        kept.solve(1e-6, || false);
        prop_assert_eq!(equations(&mut kept), equations(&mut Domain::of(&second)));
        prop_assert_eq!(kept.psi_of(second.region()), solve(&second, Solver::Multigrid, 1e-6).psi);
    }

    /// `A` is symmetric on all levels: what one cell has to its neighbour, that one has to it.
    #[test]
    fn weights_are_the_same_from_either_side(kinds in prop::collection::vec(0..8u8, 20 * 18 * 17)) {
        let of = |v: Voxel| kind(kinds[((v.z * 18 + v.y) * 20 + v.x) as usize]);
        let mut domain = Domain::of(&problem(Voxel::new(0, 0, 0), [20, 18, 17], of));
        domain.settle();
        for level in &domain.coarse {
            for &slot in level.lattice.order() {
                for cell in 0..512 {
                    let voxel = elk_geometry::bricks::voxel_at(level.lattice.position(slot), cell);
                    for (face, offset) in elk_geometry::voxel::FACES.into_iter().enumerate() {
                        let beside = level.lattice.slot(brick_of(voxel + offset)) as usize;
                        let there = cell_of(voxel + offset);
                        let own = level.stencil.blocks[slot as usize].to[face][cell / 8][cell % 8];
                        prop_assert_eq!(own, level.stencil.blocks[beside].to[face ^ 1][there / 8][there % 8]);
                    }
                }
            }
        }
    }
}

/// Rooms in a row with a door between each two; source in the first, sink in the last.
fn rooms(n: i32) -> Problem {
    let length = 20 * n;
    problem(Voxel::new(0, 0, 0), [length as usize, 18, 12], |v| match v {
        Voxel { x: 3, y: 3, z: 3 } => Cell::Source,
        Voxel { x, y, .. } if x == length - 1 && y > 9 => Cell::Sink,
        Voxel { x, y, z } if x % 20 == 19 && !(y > 12 && y < 16 && z < 7) => Cell::Outside,
        _ => Cell::Inside,
    })
}

#[test]
fn a_warm_start_ends_where_a_cold_one_does_and_sooner() {
    let before = rooms(5);
    let mut domain = Domain::of(&before);
    let cold = domain.solve(1e-6, || false);
    // A piece of furniture in the fourth room is gone to the next.
    let furniture = |v: Voxel| (65..69).contains(&v.x) && (4..8).contains(&v.y) && v.z < 5;
    let region = before.region().clone();
    let cells = (0..region.len()).map(|i| if furniture(region.voxel(i)) { Cell::Outside } else { before.cells()[i] });
    let cells = cells.collect();
    let after = Problem::new(region, cells).unwrap();
    domain.update(&after);
    let warm = domain.solve(1e-6, || false);
    assert!(warm.iterations < cold.iterations, "{} and {}", warm.iterations, cold.iterations);
    let fresh = solve(&after, Solver::Multigrid, 1e-6).psi;
    let worst = domain.psi_of(after.region()).iter().zip(&fresh).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    // From room to room ψ falls by little a cell, and single precision has its say: solved on, neither comes closer.
    assert!(worst < 3e-5, "{worst}");
}

#[test]
fn a_layer_of_voxels_is_a_problem_in_the_plane() {
    // Between two sides that are fixed ψ falls evenly, whatever is in the plane's third direction.
    let n = 65;
    for (dim, turned) in [([n, n, 1], 0), ([1, n, n], 1), ([n, 1, n], 2)] {
        let plane = problem(Voxel::new(0, 0, 0), dim, |v| {
            let along = [v.x, v.y, v.z][turned];
            match along {
                0 => Cell::Source,
                x if x == n as i32 - 1 => Cell::Sink,
                _ => Cell::Inside,
            }
        });
        let mut domain = Domain::of(&plane);
        let iterations = domain.solve(1e-6, || false).iterations;
        assert!(iterations <= 20, "{iterations}");
        for x in 0..n as i32 {
            let mut voxel = [0; 3];
            voxel[turned] = x;
            let psi = f64::from(domain.psi(Voxel::new(voxel[0], voxel[1], voxel[2])));
            assert!((psi - 1.0 + f64::from(x) / (n - 1) as f64).abs() < 1e-4, "{dim:?} at {x}: {psi}");
        }
    }
}

#[test]
fn what_nothing_fixes_has_a_defined_answer() {
    let mut nothing = Domain::new();
    assert_eq!(nothing.solve(1e-6, || false), Convergence { iterations: 0, residual: 0.0 });
    assert_eq!((nothing.psi(Voxel::new(1, 2, 3)), nothing.unknowns()), (0.0, 0));
    assert_eq!((nothing.cascade(1e-2, || false), nothing.residual()), (0, 0.0));
    let around = Region::new(Voxel::new(-1, -1, -1), [22, 11, 9], 0.1);
    let of = |special: fn(Voxel) -> Cell| {
        let mut domain = Domain::of(&problem(Voxel::new(0, 0, 0), [20, 9, 7], special));
        let convergence = domain.solve(1e-6, || false);
        let solved = domain.psi_of(&around);
        domain.cascade(1e-6, || false);
        let near = domain.psi_of(&around);
        assert!(solved.iter().zip(&near).all(|(a, b)| (a - b).abs() < 0.05), "a cascade answers the same");
        domain.solve(1e-6, || false);
        (domain, convergence)
    };
    // Without a sink ψ is 1 wherever the source is connected to, without a source 0, and without either as well.
    let (domain, _) = of(|v| if v == Voxel::new(4, 4, 4) { Cell::Source } else { Cell::Inside });
    assert!((0..20).all(|x| (domain.psi(Voxel::new(x, 2, 2)) - 1.0).abs() < 1e-4));
    let (domain, convergence) = of(|v| if v.x == 19 { Cell::Sink } else { Cell::Inside });
    assert_eq!((convergence.iterations, domain.psi(Voxel::new(3, 3, 3))), (0, 0.0));
    let (domain, convergence) = of(|_| Cell::Inside);
    assert_eq!((convergence.iterations, domain.psi(Voxel::new(3, 3, 3))), (0, 0.0));
    // A robot that is walled in: nothing flows.
    let (domain, convergence) = of(|v| match v {
        Voxel { x: 0, y: 0, z: 0 } => Cell::Source,
        Voxel { x: 19, .. } => Cell::Sink,
        Voxel { x: 0..2, y: 0..2, z: 0..2 } => Cell::Outside,
        _ => Cell::Inside,
    });
    assert_eq!((convergence.iterations, domain.psi(Voxel::new(9, 3, 3))), (0, 0.0));
    assert_eq!(domain.psi(Voxel::new(0, 0, 0)), 1.0);
}

#[test]
fn iterations_do_not_depend_on_the_size() {
    let [small, large] = [3, 24].map(|n| solve(&rooms(n), Solver::Multigrid, 1e-6).iterations);
    assert!(large <= small + 6, "{small} and {large}");
}
