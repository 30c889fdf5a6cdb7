//! The non-negative multiples of a start whose sum of columns is nearest to a target, with a ridge towards the start.
//!
//! min over x >= 0 of sum_i f_i(t_i - (C x)_i) + w sum_e (x_e - 1)^2, where f_i(d) = |d| in ordinary rows and max(0, d)
//! in rows whose target is a lower bound. The second term is Tikhonov's regularisation towards a start (Hansen,
//! "Rank-Deficient and Discrete Ill-Posed Problems", SIAM 1998, section 5.1), so the minimum is unique. Solved by
//! Mehrotra's primal-dual interior-point method ("On the implementation of a primal-dual interior point method", SIAM
//! J. Optim. 2, 1992); each step solves for as many unknowns as there are columns.
//!
//! f_i(d) is the maximum of y d over y in -1..1, or in 0..1 for a lower bound. Swapping minimum and maximum gives the
//! dual: every such y bounds the objective from below by t.y + sum_e min over x_e >= 0 of (w (x_e - 1)^2 - g_e x_e), g
//! = C^T y. The inner minimum lies at x_e = max(0, 1 + g_e / 2w). So a dual certifies the answer: anybody can check it
//! with two products.
//!
//! Only +, -, *, / and square roots of f64 in a fixed order: the same bytes on every machine. The Cholesky solver also
//! serves `joint_fit`.

/// What is fitted: columns and a target of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct RidgeProblem {
    /// The columns at the start, finite and not negative.
    pub columns: Vec<Vec<f64>>,
    /// Finite.
    pub target: Vec<f64>,
    /// For each row, whether its target is a lower bound, so that larger sums cost nothing.
    pub at_least: Vec<bool>,
    /// The factor w of the ridge, finite and above 0.
    pub ridge: f64,
}

/// Multiples and the proof that they are the best ones.
#[derive(Clone, Debug, PartialEq)]
pub struct RidgeFit {
    /// One a column, not negative; 1 is the start.
    pub multiples: Vec<f64>,
    /// One a row, within -1..1, or 0..1 where the target is a lower bound.
    pub dual: Vec<f64>,
    /// The sum of absolute differences, or of what is missing to a lower bound.
    pub misfit: f64,
    /// The second term of the objective.
    pub ridge: f64,
    /// No multiples have a smaller sum of misfit and ridge.
    pub bound: f64,
    /// Steps of the interior-point method.
    pub steps: u32,
}

impl RidgeFit {
    /// The share of the target's own sum by which the objective may at most be improved.
    pub fn relative_gap(&self, target: &[f64]) -> f64 {
        let size = size(target);
        if size > 0.0 { (self.misfit + self.ridge - self.bound) / size } else { 0.0 }
    }
}

/// Mean complementarity at which the steps end, for a mean target of 1.
pub const TOLERANCE: f64 = 1e-12;
/// The largest number of steps.
pub const MOST_STEPS: u32 = 100;
/// The share of the way to the nearest bound that a step covers.
pub const STEP_SHARE: f64 = 0.9995;
/// A multiple below this becomes 0 if its multiplier is the larger of the two.
pub const ZERO_BELOW: f64 = 1e-6;

impl RidgeProblem {
    /// The best multiples. A target of zeros is fitted by zeros.
    pub fn fit(&self) -> RidgeFit {
        let scale = size(&self.target) / self.target.len().max(1) as f64;
        if scale == 0.0 || self.columns.is_empty() {
            // Without columns the best dual has the signs of the target.
            let sign = |(t, at_least): (&f64, &bool)| if *at_least { f64::from(*t > 0.0) } else { t.signum() };
            let y = self.target.iter().zip(&self.at_least).map(sign).collect();
            return self.certified(vec![0.0; self.columns.len()], y, 0);
        }
        let scaled = |values: &Vec<f64>| values.iter().map(|v| v / scale).collect::<Vec<f64>>();
        let problem = Scaled {
            columns: self.columns.iter().map(scaled).collect(),
            target: scaled(&self.target),
            least_dual: self.at_least.iter().map(|at_least| if *at_least { 0.0 } else { -1.0 }).collect(),
            curvature: 2.0 * self.ridge / scale,
        };
        let found = problem.solve();
        self.certified(problem.rounded_to_zero(&found), found.y, found.steps)
    }

    /// Computes the objective and its lower bound.
    fn certified(&self, multiples: Vec<f64>, y: Vec<f64>, steps: u32) -> RidgeFit {
        let rows = self.target.len();
        let inside = |(y, at_least): (&f64, &bool)| y.clamp(if *at_least { 0.0 } else { -1.0 }, 1.0);
        let dual: Vec<f64> = y.iter().zip(&self.at_least).map(inside).collect();
        let sums = product(&self.columns, &multiples, rows);
        let cost = |row: usize| {
            let rest = self.target[row] - sums[row];
            if self.at_least[row] { rest.max(0.0) } else { rest.abs() }
        };
        let away = |multiple: f64| self.ridge * (multiple - 1.0) * (multiple - 1.0);
        let least = |column: &Vec<f64>| {
            let product = dot(column, &dual);
            let multiple = (1.0 + product / (2.0 * self.ridge)).max(0.0);
            away(multiple) - product * multiple
        };
        // Zeros fit a black target exactly; there is nothing that a start could be.
        let is_black = size(&self.target) == 0.0;
        RidgeFit {
            misfit: (0..rows).map(cost).sum(),
            ridge: if is_black { 0.0 } else { multiples.iter().map(|multiple| away(*multiple)).sum() },
            bound: if is_black { 0.0 } else { dot(&self.target, &dual) + self.columns.iter().map(least).sum::<f64>() },
            multiples,
            dual,
            steps,
        }
    }
}

/// The sum of absolute values.
fn size(values: &[f64]) -> f64 {
    values.iter().map(|v| v.abs()).sum()
}

/// A [`RidgeProblem`] whose target has a mean absolute value of 1.
struct Scaled {
    columns: Vec<Vec<f64>>,
    target: Vec<f64>,
    /// The least dual of each row: -1, or 0 where the target is a lower bound.
    least_dual: Vec<f64>,
    /// Twice the factor of the ridge.
    curvature: f64,
}

/// min sum(u - l v) + (c / 2) |r - 1|^2, C r + u - v = t with multiplier y; r, u, v >= 0 with multipliers z, 1 - y and
/// y - l, where l is the least dual and c the curvature.
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

/// For each pair of a variable and its multiplier: the target of their product minus its value.
struct Aims {
    r: Vec<f64>,
    u: Vec<f64>,
    v: Vec<f64>,
}

impl Scaled {
    fn solve(&self) -> Point {
        let mut at = self.start();
        while at.steps < MOST_STEPS {
            let complementarity = self.complementarity(&at);
            if complementarity < TOLERANCE && self.dual_residual(&at).iter().all(|r| r.abs() < 1e-9 * at.y.len() as f64)
            {
                break;
            }
            let Some(step) = self.step(&at, complementarity) else { break };
            at.steps += 1;
            at.advance(&step, (STEP_SHARE * self.longest(&at, &step)).min(1.0));
        }
        at
    }

    /// The start of the ridge, with multipliers well inside their bounds.
    fn start(&self) -> Point {
        let (lights, rows) = (self.columns.len(), self.target.len());
        let r = vec![1.0; lights];
        let rest: Vec<f64> = self.target.iter().zip(product(&self.columns, &r, rows)).map(|(t, p)| t - p).collect();
        let part = |sign: f64| rest.iter().map(|s| (sign * s).max(0.0) + 1.0).collect();
        let y = self.least_dual.iter().map(|least| (1.0 + least) / 2.0).collect();
        Point { r, z: vec![rows as f64; lights], u: part(1.0), v: part(-1.0), y, steps: 0 }
    }

    /// z - c (r - 1) + C^T y.
    fn dual_residual(&self, at: &Point) -> Vec<f64> {
        let residual = |e: usize| at.z[e] - self.curvature * (at.r[e] - 1.0) + dot(&self.columns[e], &at.y);
        (0..self.columns.len()).map(residual).collect()
    }

    /// Mehrotra's direction: one factor, two solutions. None where rounding has eaten the factor.
    fn step(&self, at: &Point, complementarity: f64) -> Option<Direction> {
        let factor = self.factor(at)?;
        let predicted = self.direction(at, &factor, &self.aims(at, 0.0, None));
        let mut ahead = at.clone();
        ahead.advance(&predicted, self.longest(at, &predicted).min(1.0));
        let share = self.complementarity(&ahead) / complementarity;
        let centre = share * share * share * complementarity;
        Some(self.direction(at, &factor, &self.aims(at, centre, Some(&predicted))))
    }

    /// Cholesky factor of z / r + c + C^T D^-1 C, D = u / (1 - y) + v / (y - l).
    fn factor(&self, at: &Point) -> Option<Vec<Vec<f64>>> {
        let inverse = self.inverse_diagonal(at);
        let mut matrix: Vec<Vec<f64>> = Vec::with_capacity(self.columns.len());
        for (i, column) in self.columns.iter().enumerate() {
            let scaled: Vec<f64> = column.iter().zip(&inverse).map(|(b, d)| b * d).collect();
            let mut row: Vec<f64> = self.columns[..=i].iter().map(|other| dot(&scaled, other)).collect();
            row[i] += at.z[i] / at.r[i] + self.curvature;
            matrix.push(row);
        }
        cholesky(matrix)
    }

    fn direction(&self, at: &Point, factor: &[Vec<f64>], aims: &Aims) -> Direction {
        let rows = self.target.len();
        let inverse = self.inverse_diagonal(at);
        let reached = product(&self.columns, &at.r, rows);
        // What dy has to make up for if r stays: the primal residual and the changes of u and v.
        let rest: Vec<f64> = (0..rows)
            .map(|i| {
                let primal = self.target[i] - reached[i] - at.u[i] + at.v[i];
                primal - aims.u[i] / (1.0 - at.y[i]) + aims.v[i] / (at.y[i] - self.least_dual[i])
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
        let v = (0..rows).map(|i| (aims.v[i] - at.v[i] * y[i]) / (at.y[i] - self.least_dual[i])).collect();
        Direction { r, z, u, v, y }
    }

    /// The weights, with 0 for those that the multipliers hold there.
    fn rounded_to_zero(&self, at: &Point) -> Vec<f64> {
        let rows = at.y.len() as f64;
        at.r.iter().zip(&at.z).map(|(&r, &z)| if r < z / rows && r < ZERO_BELOW { 0.0 } else { r }).collect()
    }

    fn complementarity(&self, at: &Point) -> f64 {
        let products = |i: usize| (1.0 - at.y[i]) * at.u[i] + (at.y[i] - self.least_dual[i]) * at.v[i];
        let sum = dot(&at.r, &at.z) + (0..at.y.len()).map(products).sum::<f64>();
        sum / (at.r.len() + 2 * at.y.len()) as f64
    }

    fn inverse_diagonal(&self, at: &Point) -> Vec<f64> {
        let diagonal = |i: usize| at.u[i] / (1.0 - at.y[i]) + at.v[i] / (at.y[i] - self.least_dual[i]);
        (0..at.y.len()).map(|i| 1.0 / diagonal(i)).collect()
    }

    /// For products of `centre`, with the second-order terms of `predicted` taken off.
    fn aims(&self, at: &Point, centre: f64, predicted: Option<&Direction>) -> Aims {
        let second = |of: fn(&Direction, usize) -> f64, i: usize| predicted.map_or(0.0, |p| of(p, i));
        let below = |i: usize| at.y[i] - self.least_dual[i];
        Aims {
            r: (0..at.r.len()).map(|e| centre - at.r[e] * at.z[e] - second(|p, e| p.r[e] * p.z[e], e)).collect(),
            u: (0..at.y.len())
                .map(|i| centre - at.u[i] * (1.0 - at.y[i]) + second(|p, i| p.u[i] * p.y[i], i))
                .collect(),
            v: (0..at.y.len()).map(|i| centre - at.v[i] * below(i) - second(|p, i| p.v[i] * p.y[i], i)).collect(),
        }
    }

    /// How far the point may go along the direction before a variable or a multiplier is 0.
    fn longest(&self, at: &Point, step: &Direction) -> f64 {
        let limit = |value: f64, change: f64| if change < 0.0 { -value / change } else { f64::INFINITY };
        let least = |values: &[f64], changes: &[f64]| {
            values.iter().zip(changes).map(|(&v, &c)| limit(v, c)).fold(f64::INFINITY, f64::min)
        };
        let bounded = (0..at.y.len()).map(|i| {
            let change = step.y[i];
            limit(1.0 - at.y[i], -change).min(limit(at.y[i] - self.least_dual[i], change))
        });
        bounded
            .fold(f64::INFINITY, f64::min)
            .min(least(&at.r, &step.r))
            .min(least(&at.z, &step.z))
            .min(least(&at.u, &step.u))
            .min(least(&at.v, &step.v))
    }
}

impl Point {
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

/// C r.
fn product(columns: &[Vec<f64>], weights: &[f64], rows: usize) -> Vec<f64> {
    let mut sums = vec![0.0; rows];
    for (column, weight) in columns.iter().zip(weights) {
        sums.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
    }
    sums
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
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

/// The lower triangular L with L L^T = `matrix`; none if the matrix is not positive definite. Only its lower triangle
/// is read.
pub(crate) fn cholesky(mut matrix: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
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
pub(crate) fn back_substitute(factor: &[Vec<f64>], mut right: Vec<f64>) -> Vec<f64> {
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

/// Planted multiples are recovered, and every answer carries a proof that holds.
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
}
