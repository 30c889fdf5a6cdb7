//! The linear equations of a step: dense between lights, diagonal between colours, which are eliminated first, so that rooms
//! of thousands of parts cost little.

use crate::cholesky::{back_substitute, cholesky, dot};

/// Half the Hessian and half the gradient of the objective.
pub(super) struct NormalEquations {
    /// Between lights: the lower triangle.
    pub(super) lights: Vec<Vec<f64>>,
    /// For each colour its entries with all lights.
    pub(super) cross: Vec<Vec<f64>>,
    /// The diagonal of the colours.
    pub(super) colors: Vec<f64>,
    /// Of the lights, then of the colours.
    pub(super) gradient: Vec<f64>,
}

impl NormalEquations {
    pub(super) fn zero(lights: usize, colors: usize) -> Self {
        Self {
            lights: (0..lights).map(|i| vec![0.0; i + 1]).collect(),
            cross: vec![vec![0.0; lights]; colors],
            colors: vec![0.0; colors],
            gradient: vec![0.0; lights + colors],
        }
    }

    /// The step that solves the equations with the diagonal raised by a share of itself; none if they are singular.
    pub(super) fn step(&self, damping: f64) -> Option<Vec<f64>> {
        let damped = |value: f64| value + damping * (value + 1e-9);
        let (light_gradient, color_gradient) = self.gradient.split_at(self.lights.len());
        let mut matrix = self.lights.clone();
        for (i, row) in matrix.iter_mut().enumerate() {
            row[i] = damped(row[i]);
        }
        let mut right: Vec<f64> = light_gradient.iter().map(|g| -g).collect();
        for ((cross, color), gradient) in self.cross.iter().zip(&self.colors).zip(color_gradient) {
            let color = damped(*color);
            for (i, row) in matrix.iter_mut().enumerate() {
                let factor = cross[i] / color;
                right[i] += factor * gradient;
                row.iter_mut().zip(cross).for_each(|(value, other)| *value -= factor * other);
            }
        }
        let mut step = back_substitute(&cholesky(matrix)?, right);
        let colors: Vec<f64> = { self.cross.iter().zip(&self.colors).zip(color_gradient) }
            .map(|((cross, color), gradient)| (-gradient - dot(cross, &step)) / damped(*color))
            .collect();
        step.extend(colors);
        Some(step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The equations hold for the step, without damping.
    #[test]
    fn the_step_solves_the_equations() {
        let equations = NormalEquations {
            lights: vec![vec![5.0], vec![1.0, 4.0]],
            cross: vec![vec![1.0, 0.5], vec![-0.3, 0.7], vec![0.2, 0.0]],
            colors: vec![2.0, 3.0, 1.5],
            gradient: vec![1.0, -2.0, 0.5, 0.25, -1.0],
        };
        let step = equations.step(0.0).unwrap();
        let [a, b] = [step[0], step[1]];
        let light = |row: usize, own: f64| own + (0..3).map(|c| equations.cross[c][row] * step[2 + c]).sum::<f64>();
        let mut sums = vec![light(0, 5.0 * a + b), light(1, a + 4.0 * b)];
        sums.extend((0..3).map(|c| dot(&equations.cross[c], &step[..2]) + equations.colors[c] * step[2 + c]));
        let errors = sums.iter().zip(&equations.gradient).map(|(sum, gradient)| (sum + gradient).abs());
        assert!(errors.fold(0.0, f64::max) < 1e-12, "{sums:?}");
    }
}
