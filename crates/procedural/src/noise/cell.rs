//! Cell noise: one random number for each square of the unit lattice.

use super::hash::{cell_of, hash2, hash3, to_unit};

/// A number from 0 to 1 that is constant in each cell.
pub fn cell(x: f64, y: f64) -> f64 {
    to_unit(hash2(cell_of(x).0, cell_of(y).0))
}

/// Component 0, 1 or 2 of a vector from 0 to 1 that is constant in each cell.
pub fn cell_component(x: f64, y: f64, component: i32) -> f64 {
    component_at(cell_of(x).0, cell_of(y).0, component)
}

/// As [`cell_component`], of the cell's whole numbers.
pub(super) fn component_at(x: i32, y: i32, component: i32) -> f64 {
    to_unit(hash3(x, y, component))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_constant_and_differs_from_its_neighbour() {
        assert_eq!(cell(2.01, -3.99), cell(2.99, -3.01));
        assert_ne!(cell(2.5, 0.5), cell(3.5, 0.5));
    }

    #[test]
    fn numbers_are_uniform() {
        let numbers: Vec<f64> = (0..10_000).map(|i| cell(f64::from(i % 100), f64::from(i / 100))).collect();
        let mean = numbers.iter().sum::<f64>() / 1e4;
        let variance = numbers.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / 1e4;
        // Standard errors: 0.003 and 0.0007.
        assert!((mean - 0.5).abs() < 0.012 && (variance - 1.0 / 12.0).abs() < 0.003, "{mean} {variance}");
    }
}
