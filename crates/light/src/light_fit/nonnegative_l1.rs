//! The non-negative weights of columns whose sum is nearest to a target by the sum of absolute differences.
//!
//! min over r >= 0 of ||B r - t||_1. Of all best r the shortest is wanted, each column's weight counted by what it
//! brings to the sum, so that units do not matter: (eps / 2) ||r||^2 is added, where columns have mean 1. If eps is
//! small enough, the minimum is the shortest of the best exactly (Mangasarian and Meyer, "Nonlinear perturbation of
//! linear programs", SIAM J. Control Optim. 17, 1979). Solved by Mehrotra's primal-dual interior-point method ("On the
//! implementation of a primal-dual interior point method", SIAM J. Optim. 2, 1992); what is left to solve in each step
//! has as many unknowns as there are columns. The dual, max t.y over |y_i| <= 1 with B^T y <= 0, bounds the sum from
//! below and so certifies the answer: anybody can check it with two products.
//!
//! Only +, -, *, / and square roots of f64 in a fixed order: the same bytes on every machine.

/// Weights and the proof that they are the best ones.
#[derive(Clone, Debug, PartialEq)]
pub struct NonnegativeL1 {
    /// One a column, not negative.
    pub weights: Vec<f64>,
    /// One a row, within -1..1, with `B^T dual <= 0` to rounding.
    pub dual: Vec<f64>,
    /// The sum of absolute differences.
    pub sum: f64,
    /// `target . dual`: no weights have a smaller sum.
    pub bound: f64,
    /// Steps of the interior-point method.
    pub steps: u32,
}

impl NonnegativeL1 {
    /// By how much of the target's own sum the weights may at most be improved.
    pub fn relative_gap(&self, target: &[f64]) -> f64 {
        let size: f64 = target.iter().map(|v| v.abs()).sum();
        if size > 0.0 { (self.sum - self.bound) / size } else { 0.0 }
    }
}

/// The factor of half the squared length of the weights in the objective, for a target and columns of mean 1. The mean
/// absolute difference grows by at most this factor times half the squared length.
pub const SHORTNESS: f64 = 1e-6;
/// Mean complementarity at which the steps end, for a mean target of 1.
pub const TOLERANCE: f64 = 1e-12;
/// The largest number of steps.
pub const MOST_STEPS: u32 = 100;
/// The share of the way to the nearest bound that a step covers.
pub const STEP_SHARE: f64 = 0.9995;
/// A weight below this becomes 0 if its multiplier is the larger of the two.
pub const ZERO_BELOW: f64 = 1e-6;

/// Solves the problem for columns of one length, all finite and not negative, and a finite target.
pub fn solve(columns: &[Vec<f64>], target: &[f64]) -> NonnegativeL1 {
    let rows = target.len().max(1) as f64;
    let target_scale = target.iter().map(|v| v.abs()).sum::<f64>() / rows;
    let brightness: Vec<f64> = columns.iter().map(|column| column.iter().sum::<f64>() / rows).collect();
    let lit: Vec<usize> = (0..columns.len()).filter(|&e| brightness[e] > 0.0).collect();
    let mut weights = vec![0.0; columns.len()];
    // If no column has any light, no weights lower the error; the signs of the target are the dual that proves it.
    let mut found = Point { y: target.iter().map(|t| t.signum()).collect(), ..Default::default() };
    if target_scale > 0.0 && !lit.is_empty() {
        let scaled = |values: &[f64], scale: f64| values.iter().map(|v| v / scale).collect::<Vec<f64>>();
        let problem = Problem {
            columns: lit.iter().map(|&e| scaled(&columns[e], brightness[e])).collect(),
            target: scaled(target, target_scale),
        };
        found = problem.solve();
        for (&e, weight) in lit.iter().zip(problem.rounded_to_zero(&found)) {
            weights[e] = weight * target_scale / brightness[e];
        }
    }
    certify(columns, target, weights, &found)
}

/// Makes the dual feasible, and computes the objective and its lower bound.
///
/// A feasible dual lies within -1..1 and has a product of at most 0 with every column. Let d be the largest ratio of a
/// column's product with y to the column's sum, at least 0. Columns are not negative, so all products with y - d are at
/// most 0. Dividing by 1 + d brings the values back within -1..1.
fn certify(columns: &[Vec<f64>], target: &[f64], weights: Vec<f64>, found: &Point) -> NonnegativeL1 {
    let excess = |column: &Vec<f64>| {
        let sum: f64 = column.iter().sum();
        if sum > 0.0 { dot(column, &found.y) / sum } else { 0.0 }
    };
    let shift = columns.iter().map(excess).fold(0.0, f64::max);
    let dual: Vec<f64> = found.y.iter().map(|y| ((y - shift) / (1.0 + shift)).clamp(-1.0, 1.0)).collect();
    let sum = target.iter().zip(product(columns, &weights, target.len())).map(|(t, p)| (t - p).abs()).sum();
    NonnegativeL1 { weights, bound: dot(target, &dual), dual, sum, steps: found.steps }
}

/// With target and columns of mean 1.
struct Problem {
    columns: Vec<Vec<f64>>,
    target: Vec<f64>,
}

/// min sum(u + v) + (eps / 2) r.r, B r + u - v = t with multiplier y; r, u, v >= 0 with multipliers z, 1 - y, 1 + y.
#[derive(Clone, Debug, Default)]
struct Point {
    r: Vec<f64>,
    z: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
    y: Vec<f64>,
    steps: u32,
}

/// A change of a [`Point`].
struct Direction {
    r: Vec<f64>,
    z: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
    y: Vec<f64>,
}

/// What the products of each pair of a variable and its multiplier shall become, less what they are.
struct Aims {
    r: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
}

impl Problem {
    fn shortness(&self) -> f64 {
        SHORTNESS * self.target.len() as f64
    }

    fn solve(&self) -> Point {
        let mut at = self.start();
        while at.steps < MOST_STEPS {
            let complementarity = at.complementarity();
            if complementarity < TOLERANCE && self.dual_residual(&at).iter().all(|r| r.abs() < 1e-9 * at.y.len() as f64)
            {
                break;
            }
            let Some(step) = self.step(&at, complementarity) else { break };
            at.steps += 1;
            at.advance(&step, (STEP_SHARE * at.longest(&step)).min(1.0));
        }
        at
    }

    /// Weights that share the target's mean, with multipliers well inside their bounds.
    fn start(&self) -> Point {
        let (lights, rows) = (self.columns.len(), self.target.len());
        let r = vec![1.0 / lights as f64; lights];
        let rest: Vec<f64> = self.target.iter().zip(product(&self.columns, &r, rows)).map(|(t, p)| t - p).collect();
        let part = |sign: f64| rest.iter().map(|s| (sign * s).max(0.0) + 1.0).collect();
        Point { r, z: vec![rows as f64; lights], u: part(1.0), v: part(-1.0), y: vec![0.0; rows], steps: 0 }
    }

    /// z - eps r + B^T y.
    fn dual_residual(&self, at: &Point) -> Vec<f64> {
        let shortness = self.shortness();
        let each = self.columns.iter().zip(&at.r).zip(&at.z);
        each.map(|((column, r), z)| z - shortness * r + dot(column, &at.y)).collect()
    }

    /// Mehrotra's direction: one factor, two solutions. None where rounding has eaten the factor.
    fn step(&self, at: &Point, complementarity: f64) -> Option<Direction> {
        let factor = self.factor(at)?;
        let predicted = self.direction(at, &factor, &at.aims(0.0, None));
        let mut ahead = at.clone();
        ahead.advance(&predicted, at.longest(&predicted).min(1.0));
        let share = ahead.complementarity() / complementarity;
        let centre = share * share * share * complementarity;
        Some(self.direction(at, &factor, &at.aims(centre, Some(&predicted))))
    }

    /// Cholesky factor of z / r + eps + B^T D^-1 B, D = u / (1 - y) + v / (1 + y).
    fn factor(&self, at: &Point) -> Option<Vec<Vec<f64>>> {
        let inverse = at.inverse_diagonal();
        let mut matrix: Vec<Vec<f64>> = Vec::with_capacity(self.columns.len());
        for (i, column) in self.columns.iter().enumerate() {
            let scaled: Vec<f64> = column.iter().zip(&inverse).map(|(b, d)| b * d).collect();
            let mut row: Vec<f64> = self.columns[..=i].iter().map(|other| dot(&scaled, other)).collect();
            row[i] += at.z[i] / at.r[i] + self.shortness();
            matrix.push(row);
        }
        cholesky(matrix)
    }

    fn direction(&self, at: &Point, factor: &[Vec<f64>], aims: &Aims) -> Direction {
        let rows = self.target.len();
        let inverse = at.inverse_diagonal();
        let reached = product(&self.columns, &at.r, rows);
        // What dy has to make up for if r stays: the primal residual and the changes of u and v.
        let rest: Vec<f64> = (0..rows)
            .map(|i| {
                let primal = self.target[i] - reached[i] - at.u[i] + at.v[i];
                primal - aims.u[i] / (1.0 - at.y[i]) + aims.v[i] / (1.0 + at.y[i])
            })
            .collect();
        let residual = self.dual_residual(at);
        let weighted: Vec<f64> = rest.iter().zip(&inverse).map(|(r, d)| r * d).collect();
        let right = |e: usize| aims.r[e] / at.r[e] + residual[e] + dot(&self.columns[e], &weighted);
        let r = back_substitute(factor, (0..self.columns.len()).map(right).collect());
        let change = product(&self.columns, &r, rows);
        let y: Vec<f64> = (0..rows).map(|i| inverse[i] * (rest[i] - change[i])).collect();
        let z = (0..r.len()).map(|e| (aims.r[e] - at.z[e] * r[e]) / at.r[e]).collect();
        let u = (0..rows).map(|i| (aims.u[i] + at.u[i] * y[i]) / (1.0 - at.y[i])).collect();
        let v = (0..rows).map(|i| (aims.v[i] - at.v[i] * y[i]) / (1.0 + at.y[i])).collect();
        Direction { r, z, u, v, y }
    }

    /// The weights, with 0 for those that the multipliers hold there.
    fn rounded_to_zero(&self, at: &Point) -> Vec<f64> {
        let rows = at.y.len() as f64;
        at.r.iter().zip(&at.z).map(|(&r, &z)| if r < z / rows && r < ZERO_BELOW { 0.0 } else { r }).collect()
    }
}

impl Point {
    fn complementarity(&self) -> f64 {
        let residuals = self.y.iter().zip(self.u.iter().zip(&self.v));
        let sum = dot(&self.r, &self.z) + residuals.map(|(y, (u, v))| (1.0 - y) * u + (1.0 + y) * v).sum::<f64>();
        sum / (self.r.len() + 2 * self.y.len()) as f64
    }

    fn inverse_diagonal(&self) -> Vec<f64> {
        (0..self.y.len()).map(|i| 1.0 / (self.u[i] / (1.0 - self.y[i]) + self.v[i] / (1.0 + self.y[i]))).collect()
    }

    /// For products of `centre`, with the second-order terms of `predicted` taken off.
    fn aims(&self, centre: f64, predicted: Option<&Direction>) -> Aims {
        let second = |of: fn(&Direction, usize) -> f64, i: usize| predicted.map_or(0.0, |p| of(p, i));
        Aims {
            r: (0..self.r.len()).map(|e| centre - self.r[e] * self.z[e] - second(|p, e| p.r[e] * p.z[e], e)).collect(),
            u: (0..self.y.len())
                .map(|i| centre - self.u[i] * (1.0 - self.y[i]) + second(|p, i| p.u[i] * p.y[i], i))
                .collect(),
            v: (0..self.y.len())
                .map(|i| centre - self.v[i] * (1.0 + self.y[i]) - second(|p, i| p.v[i] * p.y[i], i))
                .collect(),
        }
    }

    /// How far the point may go along the direction before a variable or a multiplier is 0.
    fn longest(&self, step: &Direction) -> f64 {
        let limit = |value: f64, change: f64| if change < 0.0 { -value / change } else { f64::INFINITY };
        let least = |values: &[f64], changes: &[f64]| {
            values.iter().zip(changes).map(|(&v, &c)| limit(v, c)).fold(f64::INFINITY, f64::min)
        };
        let bounded = self.y.iter().zip(&step.y).map(|(&y, &c)| limit(1.0 - y, -c).min(limit(1.0 + y, c)));
        bounded
            .fold(f64::INFINITY, f64::min)
            .min(least(&self.r, &step.r))
            .min(least(&self.z, &step.z))
            .min(least(&self.u, &step.u))
            .min(least(&self.v, &step.v))
    }

    fn advance(&mut self, step: &Direction, length: f64) {
        let along = |values: &mut Vec<f64>, changes: &[f64]| {
            values.iter_mut().zip(changes).for_each(|(value, change)| *value += length * change);
        };
        along(&mut self.r, &step.r);
        along(&mut self.z, &step.z);
        along(&mut self.u, &step.u);
        along(&mut self.v, &step.v);
        along(&mut self.y, &step.y);
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four sums, so that four products can be under way at a time; in a fixed order.
    let (fours_a, fours_b) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = fours_a.remainder().iter().zip(fours_b.remainder()).map(|(a, b)| a * b).sum();
    let mut sums = [0.0; 4];
    for (a, b) in fours_a.zip(fours_b) {
        for k in 0..4 {
            sums[k] += a[k] * b[k];
        }
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

/// B r.
fn product(columns: &[Vec<f64>], weights: &[f64], rows: usize) -> Vec<f64> {
    let mut sums = vec![0.0; rows];
    for (column, weight) in columns.iter().zip(weights) {
        sums.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
    }
    sums
}

/// The lower triangular L with L L^T = `matrix`; none if the matrix is not positive definite. Only its lower triangle
/// is read.
fn cholesky(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    for i in 0..matrix.len() {
        let (done, rest) = matrix.split_at_mut(i);
        let row = &mut rest[0];
        for (j, other) in done.iter().enumerate() {
            row[j] = (row[j] - dot(&row[..j], &other[..j])) / other[j];
        }
        let square = row[i] - dot(&row[..i], &row[..i]);
        if square.is_nan() || square <= 0.0 {
            return None;
        }
        row[i] = square.sqrt();
    }
    Some(matrix)
}

/// x of L L^T x = `right`.
fn back_substitute(factor: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
    for (i, row) in factor.iter().enumerate() {
        right[i] = (right[i] - dot(&row[..i], &right[..i])) / row[i];
    }
    for i in (0..right.len()).rev() {
        right[i] /= factor[i][i];
        let value = right[i];
        factor[i][..i].iter().zip(&mut right).for_each(|(l, x)| *x -= l * value);
    }
    right
}

#[cfg(test)]
mod tests {
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

    /// The largest error, against the largest weight.
    fn error(found: &[f64], expected: &[f64]) -> f64 {
        let largest = expected.iter().copied().fold(0.0, f64::max);
        found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
    }

    /// Checks weights and dual by their definitions alone; returns the first violation.
    fn check(columns: &[Vec<f64>], target: &[f64], found: &NonnegativeL1) -> Result<(), String> {
        if found.weights.iter().any(|&r| r < 0.0) || found.dual.iter().any(|y| y.abs() > 1.0) {
            return Err("out of bounds".into());
        }
        for (e, column) in columns.iter().enumerate() {
            let (inner, size) =
                (column.iter().zip(&found.dual).map(|(b, y)| b * y).sum::<f64>(), column.iter().sum::<f64>());
            if inner > 1e-12 * size {
                return Err(format!("column {e}: {inner}"));
            }
        }
        let rest = |i: usize| target[i] - columns.iter().zip(&found.weights).map(|(b, r)| b[i] * r).sum::<f64>();
        let sum: f64 = (0..target.len()).map(|i| rest(i).abs()).sum();
        let bound: f64 = target.iter().zip(&found.dual).map(|(t, y)| t * y).sum();
        let size: f64 = target.iter().map(|t| t.abs()).sum();
        if (sum - bound) / size > 1e-6 { Err(format!("gap {}", (sum - bound) / size)) } else { Ok(()) }
    }

    #[test]
    fn planted_weights_are_recovered() {
        for (lights, rows) in [(1, 40), (5, 100), (16, 2040), (64, 2040)] {
            let columns = columns(lights, rows);
            let weights = if lights == 1 { vec![0.7] } else { planted(lights) };
            let target = product(&columns, &weights, rows);
            let found = solve(&columns, &target);
            assert!(error(&found.weights, &weights) < 1e-6);
            assert!(found.weights.iter().zip(&weights).all(|(found, planted)| *planted > 0.0 || *found == 0.0));
            check(&columns, &target, &found).unwrap();
        }
    }

    #[test]
    fn outliers_are_shrugged_off() {
        let (columns, weights) = (columns(16, 1000), planted(16));
        let mut target = product(&columns, &weights, 1000);
        for (i, number) in numbers(5, 1000).into_iter().enumerate().filter(|(_, v)| *v < 0.1) {
            target[i] += 100.0 * number;
        }
        let found = solve(&columns, &target);
        check(&columns, &target, &found).unwrap();
        assert!(error(&found.weights, &weights) < 1e-5);
    }

    #[test]
    fn noise_has_a_proof_too() {
        for lights in [3, 20, 64] {
            let columns = columns(lights, 2040);
            let noise = numbers(9, 2040);
            let mut target = product(&columns, &planted(lights), 2040);
            target.iter_mut().zip(&noise).for_each(|(t, n)| *t += 0.3 * (n - 0.5));
            let found = solve(&columns, &target);
            check(&columns, &target, &found).unwrap();
        }
    }

    const HIGHS_SUM: f64 = 6.277_777_777_777_778;
    const HIGHS_WEIGHTS: [f64; 3] = [1.717_171_717_171_717, 0.151_515_151_515_151_5, 0.0];

    /// A small problem solved by SciPy 1.17's `linprog` (HiGHS).
    #[test]
    fn agrees_with_highs() {
        let column = |e: usize| (0..12).map(|i| ((7 * e + 3) * (i + 1) % 11) as f64 / 10.0).collect();
        let columns: Vec<Vec<f64>> = (0..3).map(column).collect();
        let target: Vec<f64> = (0..12).map(|i| ((5 * i + 2) % 7) as f64 / 3.0).collect();
        let found = solve(&columns, &target);
        check(&columns, &target, &found).unwrap();
        assert!((found.sum / HIGHS_SUM - 1.0).abs() < 1e-6 && found.bound <= HIGHS_SUM * (1.0 + 1e-12), "{found:?}");
        assert!(error(&found.weights, &HIGHS_WEIGHTS) < 1e-5, "{:?}", found.weights);
    }

    /// Weights off by a hundredth, a dual turned round, and weights below 0 do not pass as proven.
    #[test]
    fn what_is_not_best_has_no_proof() {
        let columns = columns(5, 100);
        let mut target = product(&columns, &planted(5), 100);
        target.iter_mut().zip(numbers(9, 100)).for_each(|(t, n)| *t += 0.3 * (n - 0.5));
        let found = solve(&columns, &target);
        check(&columns, &target, &found).unwrap();
        let passes = |change: fn(&mut NonnegativeL1)| {
            let mut changed = found.clone();
            change(&mut changed);
            check(&columns, &target, &changed).is_ok()
        };
        assert!(!passes(|f| f.weights[0] *= 1.01));
        assert!(!passes(|f| f.dual.iter_mut().for_each(|y| *y = -*y)));
        assert!(!passes(|f| f.dual.fill(0.0)));
        assert!(!passes(|f| f.weights[0] = -1.0));
    }

    #[test]
    fn equals_share_and_darkness_gets_nothing() {
        let mut columns = columns(4, 300);
        let weights = [1.0, 2.0, 0.5, 1.5];
        let target = product(&columns, &weights, 300);
        columns.push(columns[1].clone());
        columns.insert(0, vec![0.0; 300]);
        let found = solve(&columns, &target);
        assert!(error(&found.weights, &[0.0, 1.0, 1.0, 0.5, 1.5, 1.0]) < 1e-5, "{:?}", found.weights);
        assert_eq!(found.weights[0], 0.0);
        check(&columns, &target, &found).unwrap();
    }
}
