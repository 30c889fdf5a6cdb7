//! The non-negative multiples of a start whose sum of columns is nearest to a target, with a ridge towards the start.
//!
//! min over x >= 0 of sum_i f_i(t_i - (C x)_i) + w sum_e (x_e - 1)^2, where f_i(d) = |d| in ordinary rows and max(0, d) in
//! rows whose target is a lower bound. The second term is Tikhonov's regularisation towards a start (Hansen, "Rank-Deficient
//! and Discrete Ill-Posed Problems", SIAM 1998, section 5.1), so the minimum is unique. Solved by Mehrotra's primal-dual
//! interior-point method ("On the implementation of a primal-dual interior point method", SIAM J. Optim. 2, 1992); each step
//! solves for as many unknowns as there are columns.
//!
//! f_i(d) is the maximum of y d over y in -1..1, or in 0..1 for a lower bound. Swapping minimum and maximum gives the dual:
//! every such y bounds the objective from below by t.y + sum_e min over x_e >= 0 of (w (x_e - 1)^2 - g_e x_e), g = C^T y. The
//! inner minimum lies at x_e = max(0, 1 + g_e / 2w). So a dual certifies the answer: anybody can check it with two products.
//!
//! Only +, -, *, / and square roots of f64 in a fixed order: the same bytes on every machine.

use crate::cholesky::{back_substitute, cholesky, dot};

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

/// min sum(u - l v) + (c / 2) |r - 1|^2, C r + u - v = t with multiplier y; r, u, v >= 0 with multipliers z, 1 - y and y - l,
/// where l is the least dual and c the curvature.
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

#[cfg(test)]
mod tests;
