use super::*;
use crate::problem::Cell;
use elk_geometry::{Region, Voxel};
use proptest::prelude::*;

/// A box of `inner` cells with a halo; `cell` says what each inner cell is.
fn problem(inner: [usize; 3], cell: impl Fn([usize; 3]) -> Cell) -> Problem {
    let dim = inner.map(|n| n + 2);
    let mut cells = vec![Cell::Outside; dim[0] * dim[1] * dim[2]];
    for z in 0..inner[2] {
        for y in 0..inner[1] {
            for x in 0..inner[0] {
                let i = ((z + 1) * dim[1] + y + 1) * dim[0] + x + 1;
                cells[i] = cell([x, y, z]);
            }
        }
    }
    Problem::new(Region::new(Voxel::new(0, 0, 0), dim, 1.0), cells).unwrap()
}

fn at(p: &Problem, [x, y, z]: [usize; 3]) -> usize {
    ((z + 1) * p.dim()[1] + y + 1) * p.dim()[0] + x + 1
}

const ALL: [Solver; 2] = [Solver::Multigrid, Solver::Jacobi];

#[test]
fn in_a_channel_psi_falls_linearly() {
    let n = 40;
    let p = problem([n, 3, 2], |[x, ..]| match x {
        0 => Cell::Source,
        x if x == n - 1 => Cell::Sink,
        _ => Cell::Inside,
    });
    for solver in ALL {
        let s = solve(&p, solver, 1e-6);
        for x in 0..n {
            let expected = 1.0 - x as f64 / (n - 1) as f64;
            let psi = f64::from(s.psi[at(&p, [x, 1, 1])]);
            assert!((psi - expected).abs() < 1e-4, "{solver:?} at {x}: {psi}");
        }
        assert!(s.residual < 1e-5, "{solver:?}: {}", s.residual);
    }
}

/// On a square with one side at 1 and the others at 0 the discrete solution is a sum of sines and hyperbolic sines.
#[test]
fn in_a_box_psi_is_the_series_of_the_discrete_equation() {
    let n = 23; // cells from wall to wall, walls included
    let p = problem([n, n, 1], |[x, y, _]| match (x, y) {
        (0, y) if y > 0 && y < n - 1 => Cell::Source,
        (x, y) if x == 0 || x == n - 1 || y == 0 || y == n - 1 => Cell::Sink,
        _ => Cell::Inside,
    });
    let m = (n - 1) as f64;
    let exact = |x: usize, y: usize| -> f64 {
        (1..n - 1)
            .map(|k| {
                let theta = std::f64::consts::PI * k as f64 / m;
                let mu = (2.0 - theta.cos()).acosh();
                let weight: f64 = (1..n - 1).map(|j| (theta * j as f64).sin()).sum::<f64>() * 2.0 / m;
                weight * (theta * y as f64).sin() * (mu * (m - x as f64)).sinh() / (mu * m).sinh()
            })
            .sum()
    };
    let s = solve(&p, Solver::Multigrid, 1e-7);
    for (x, y) in [(1, 1), (1, 11), (5, 11), (11, 11), (20, 3)] {
        let psi = f64::from(s.psi[at(&p, [x, y, 0])]);
        assert!((psi - exact(x, y)).abs() < 1e-5, "({x}, {y}): {psi} {}", exact(x, y));
    }
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

#[test]
fn multigrid_agrees_with_gauss_seidel_run_to_convergence() {
    let p = rooms([31, 14, 6]);
    let exact = relaxation::gauss_seidel(&p, 1e-12, || false).0;
    for solver in ALL {
        let s = solve(&p, solver, 1e-7);
        let worst = s.psi.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-4, "{solver:?}: {worst}");
    }
}

#[test]
fn multigrid_needs_few_iterations_whatever_the_size() {
    let [small, large] = [[31, 14, 6], [95, 46, 22]].map(|d| solve(&rooms(d), Solver::Multigrid, 1e-6));
    assert!(small.iterations <= 25, "{}", small.iterations);
    assert!(large.iterations <= 40, "{}", large.iterations);
    let jacobi = solve(&rooms([95, 46, 22]), Solver::Jacobi, 1e-6).iterations;
    assert!(jacobi > 8 * large.iterations, "{jacobi} and {}", large.iterations);
}

#[test]
fn a_robot_between_goals_needs_no_iteration() {
    let p = problem([3, 1, 1], |[x, ..]| [Cell::Sink, Cell::Source, Cell::Sink][x]);
    let s = solve(&p, Solver::Multigrid, 1e-6);
    assert_eq!((s.iterations, s.residual), (0, 0.0));
    assert_eq!(s.psi[at(&p, [1, 0, 0])], 1.0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    /// The maximum principle (thesis 6.2.4.1): no value beyond the boundary's, and no cell above or below all its
    /// neighbours; wherever the obstacles and goals are.
    #[test]
    fn the_maximum_principle_holds(kinds in prop::collection::vec(0..12u8, 9 * 7 * 5)) {
        let p = problem([9, 7, 5], |[x, y, z]| match ([x, y, z], kinds[(z * 7 + y) * 9 + x]) {
            ([4, 3, 2], _) => Cell::Source,
            (_, 0) => Cell::Sink,
            (_, 1..=4) => Cell::Outside,
            _ => Cell::Inside,
        });
        let p = connected(p);
        let s = solve(&p, Solver::Multigrid, 1e-7);
        for (i, c) in p.cells().iter().enumerate().filter(|(_, c)| **c == Cell::Inside) {
            let psi = s.psi[i];
            prop_assert!((-1e-5..=1.0 + 1e-5).contains(&psi), "{c:?} {psi}");
            let around: Vec<f32> = operator::strides(p.dim()).into_iter().flat_map(|d| [i - d, i + d])
                .filter(|n| p.cells()[*n] != Cell::Outside).map(|n| s.psi[n]).collect();
            let low = around.iter().copied().fold(f32::INFINITY, f32::min);
            let high = around.iter().copied().fold(f32::NEG_INFINITY, f32::max);
            prop_assert!(psi >= low - 1e-5 && psi <= high + 1e-5, "{low} {psi} {high}");
        }
    }
}

/// The part of a problem that is connected with its source; if no sink is, one of its cells becomes one.
fn connected(p: Problem) -> Problem {
    let mut cells = p.cells().to_vec();
    let source = cells.iter().position(|c| *c == Cell::Source).unwrap();
    let mut found = vec![false; cells.len()];
    let mut open = vec![source];
    found[source] = true;
    while let Some(i) = open.pop() {
        for n in operator::strides(p.dim()).into_iter().flat_map(|d| [i - d, i + d]) {
            if !found[n] && cells[n] != Cell::Outside {
                found[n] = true;
                open.push(n);
            }
        }
    }
    for (c, f) in cells.iter_mut().zip(&found) {
        if !f {
            *c = Cell::Outside;
        }
    }
    let none = !cells.contains(&Cell::Sink);
    if let Some(c) = cells.iter_mut().find(|c| none && **c == Cell::Inside) {
        *c = Cell::Sink;
    }
    Problem::new(p.region().clone(), cells).unwrap()
}

/// Regression: who was asked to stop in the midst of a long solution was killed.
#[test]
fn a_solution_is_given_up_once_nobody_waits_for_it() {
    let p = rooms([31, 14, 6]);
    for solver in [Solver::Thesis, Solver::Jacobi, Solver::Multigrid] {
        let looks = std::cell::Cell::new(0);
        let stopping = || looks.replace(looks.get() + 1) == 1;
        assert!(solve_unless(&p, solver, 0.0, stopping).iterations <= 2, "{solver:?}");
    }
}
