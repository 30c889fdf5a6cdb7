//! The fit with a ridge: planted multiples are recovered, and every answer carries a proof that holds.

use super::*;

/// Numbers in [0, 1) that look random.
fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..count).map(|_| next()).collect()
}

/// Overlapping blobs of light along a line of pixels, on a faint haze.
fn columns(lights: usize, rows: usize) -> Vec<Vec<f64>> {
    let noise = numbers(lights as u64, lights * rows);
    let blob = |e: usize, i: usize| {
        let at = (i as f64 / rows as f64 - (e as f64 + 0.5) / lights as f64) * lights as f64;
        (0.02 + 0.01 * noise[e * rows + i] + 1.0 / (1.0 + at * at)) * 0.1_f64.powi((e % 4) as i32)
    };
    (0..lights).map(|e| (0..rows).map(|i| blob(e, i)).collect()).collect()
}

fn planted(lights: usize) -> Vec<f64> {
    numbers(77, lights).iter().map(|v| if *v < 0.2 { 0.0 } else { 3.0 * v }).collect()
}

/// A problem whose rows all count both ways; `share` of the target is the ridge's weight for each column.
fn problem(columns: Vec<Vec<f64>>, target: Vec<f64>, share: f64) -> RidgeProblem {
    let ridge = share * size(&target);
    RidgeProblem { ridge, at_least: vec![false; target.len()], columns, target }
}

/// The problem of planted multiples with noise.
fn noisy(lights: usize, rows: usize, share: f64) -> RidgeProblem {
    let columns = columns(lights, rows);
    let mut target = product(&columns, &planted(lights), rows);
    target.iter_mut().zip(numbers(9, rows)).for_each(|(t, n)| *t += 0.3 * (n - 0.5));
    problem(columns, target, share)
}

/// The largest error, against the largest multiple.
fn error(found: &[f64], expected: &[f64]) -> f64 {
    let largest = expected.iter().copied().fold(0.0, f64::max);
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
}

/// The objective by its definition alone.
fn objective(problem: &RidgeProblem, multiples: &[f64]) -> f64 {
    let sum = |i: usize| problem.columns.iter().zip(multiples).map(|(c, x)| c[i] * x).sum::<f64>();
    let cost = |i: usize| match (problem.target[i] - sum(i), problem.at_least[i]) {
        (rest, true) => rest.max(0.0),
        (rest, false) => rest.abs(),
    };
    let misfit: f64 = (0..problem.target.len()).map(cost).sum();
    misfit + problem.ridge * multiples.iter().map(|x| (x - 1.0) * (x - 1.0)).sum::<f64>()
}

/// Checks multiples and dual by their definitions alone; returns the first violation.
fn check(problem: &RidgeProblem, found: &RidgeFit) -> Result<(), String> {
    let least = |i: usize| if problem.at_least[i] { 0.0 } else { -1.0 };
    let outside = |(i, y): (usize, &f64)| *y > 1.0 || *y < least(i);
    if found.multiples.iter().any(|&x| x < 0.0) || found.dual.iter().enumerate().any(outside) {
        return Err("out of bounds".into());
    }
    let mut bound: f64 = problem.target.iter().zip(&found.dual).map(|(t, y)| t * y).sum();
    for column in &problem.columns {
        let slope: f64 = column.iter().zip(&found.dual).map(|(c, y)| c * y).sum();
        // The least of w (x - 1)^2 - slope x over x >= 0: at 0, or where the derivative is 0.
        let inner = -slope - slope * slope / (4.0 * problem.ridge);
        bound += if slope > -2.0 * problem.ridge { inner } else { problem.ridge };
    }
    let gap = (objective(problem, &found.multiples) - bound) / size(&problem.target);
    if (-1e-9..1e-6).contains(&gap) { Ok(()) } else { Err(format!("gap {gap}")) }
}

/// Without noise the misfit outweighs a small ridge, which then moves nothing: L1 is an exact penalty.
#[test]
fn planted_multiples_are_recovered() {
    for (lights, rows) in [(1, 40), (5, 100), (16, 2040), (64, 2040)] {
        let columns = columns(lights, rows);
        let multiples = if lights == 1 { vec![0.7] } else { planted(lights) };
        let target = product(&columns, &multiples, rows);
        let problem = problem(columns, target, 1e-7);
        let found = problem.fit();
        assert!(error(&found.multiples, &multiples) < 1e-6, "{lights}: {}", error(&found.multiples, &multiples));
        let pairs = found.multiples.iter().zip(&multiples);
        assert!(pairs.into_iter().all(|(found, planted)| *planted > 0.0 || *found == 0.0));
        check(&problem, &found).unwrap();
    }
}

#[test]
fn outliers_are_shrugged_off() {
    let (columns, multiples) = (columns(16, 1000), planted(16));
    let mut target = product(&columns, &multiples, 1000);
    for (i, number) in numbers(5, 1000).into_iter().enumerate().filter(|(_, v)| *v < 0.1) {
        target[i] += 100.0 * number;
    }
    let problem = problem(columns, target, 1e-9);
    let found = problem.fit();
    check(&problem, &found).unwrap();
    assert!(error(&found.multiples, &multiples) < 1e-5);
}

#[test]
fn noise_has_a_proof_too() {
    for (lights, share) in [(3, 1e-2), (20, 1e-7), (20, 1e-3), (64, 1e-3)] {
        let problem = noisy(lights, 2040, share);
        check(&problem, &problem.fit()).unwrap();
    }
}

/// The larger the ridge, the nearer the start, until nothing else counts.
#[test]
fn the_ridge_pulls_towards_the_start() {
    let distance = |share: f64| {
        let found = noisy(16, 1000, share).fit();
        found.multiples.iter().map(|x| (x - 1.0) * (x - 1.0)).sum::<f64>()
    };
    let distances = [1e-7, 1e-4, 1e-3, 1e-2, 1e-1, 1e3].map(distance);
    assert!(distances.windows(2).all(|pair| pair[1] < pair[0]), "{distances:?}");
    assert!(distances[5] < 1e-6 && distances[0] > 1.0, "{distances:?}");
}

/// Rows of a lower bound cost nothing where the sum is larger; counted both ways they pull every multiple down.
#[test]
fn more_than_a_lower_bound_costs_nothing() {
    let (columns, multiples) = (columns(5, 200), planted(5));
    let sums = product(&columns, &multiples, 200);
    let mut problem = problem(columns, sums.iter().map(|sum| sum.min(0.5)).collect(), 1e-7);
    assert!(problem.target.iter().filter(|t| **t == 0.5).count() > 20);
    let twin = problem.fit();
    problem.at_least = sums.iter().map(|sum| *sum >= 0.5).collect();
    let found = problem.fit();
    check(&problem, &found).unwrap();
    assert!(error(&found.multiples, &multiples) < 1e-5, "{:?}", found.multiples);
    assert!(error(&twin.multiples, &multiples) > 0.05, "the twin passes: {:?}", twin.multiples);
    // Too little light costs as much as in other rows.
    let brighter: Vec<f64> = problem.target.iter().map(|t| 2.0 * t).collect();
    let bounds_alone = RidgeProblem { target: brighter, at_least: vec![true; 200], ..problem };
    let found = bounds_alone.fit();
    check(&bounds_alone, &found).unwrap();
    assert!(found.multiples.iter().sum::<f64>() > 5.0 && found.misfit < 1e-2, "{found:?}");
}

const HIGHS_SUM: f64 = 6.277_777_777_777_778;
const HIGHS_MULTIPLES: [f64; 3] = [1.717_171_717_171_717, 0.151_515_151_515_151_5, 0.0];

/// A small problem solved by SciPy 1.17's `linprog` (HiGHS), without a ridge.
#[test]
fn agrees_with_highs() {
    let column = |e: usize| (0..12).map(|i| ((7 * e + 3) * (i + 1) % 11) as f64 / 10.0).collect();
    let columns: Vec<Vec<f64>> = (0..3).map(column).collect();
    let problem = problem(columns, (0..12).map(|i| ((5 * i + 2) % 7) as f64 / 3.0).collect(), 1e-9);
    let found = problem.fit();
    check(&problem, &found).unwrap();
    assert!((found.misfit / HIGHS_SUM - 1.0).abs() < 1e-6 && found.bound < HIGHS_SUM * (1.0 + 1e-6), "{found:?}");
    assert!(error(&found.multiples, &HIGHS_MULTIPLES) < 1e-5, "{:?}", found.multiples);
}

/// Multiples off by a hundredth, a dual turned round, and multiples below 0 do not pass as proven.
#[test]
fn what_is_not_best_has_no_proof() {
    let problem = noisy(5, 100, 1e-3);
    let found = problem.fit();
    check(&problem, &found).unwrap();
    let passes = |change: fn(&mut RidgeFit)| {
        let mut changed = found.clone();
        change(&mut changed);
        check(&problem, &changed).is_ok()
    };
    assert!(!passes(|f| f.multiples[0] *= 1.01));
    assert!(!passes(|f| f.dual.iter_mut().for_each(|y| *y = -*y)));
    assert!(!passes(|f| f.dual.fill(0.0)));
    assert!(!passes(|f| f.multiples[0] = -1.0));
}

/// Equal columns share their light, and a column without light stays at the start.
#[test]
fn equals_share_and_darkness_keeps_the_start() {
    let mut columns = columns(4, 300);
    let target = product(&columns, &[1.0, 4.0, 0.5, 1.5], 300);
    columns.push(columns[1].clone());
    columns.insert(0, vec![0.0; 300]);
    let problem = problem(columns, target, 1e-7);
    let found = problem.fit();
    assert!(error(&found.multiples, &[1.0, 1.0, 2.0, 0.5, 1.5, 2.0]) < 1e-5, "{:?}", found.multiples);
    check(&problem, &found).unwrap();
}
