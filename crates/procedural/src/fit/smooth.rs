//! The smooth part of what is seen: shading that is left, which is no pattern.

use super::points::{Point, extent};
use super::system::Normal;

/// Keeps the logarithm of black finite.
pub(super) const FLOOR: f64 = 0.01;

/// The logarithm of a point's brightness.
pub(super) fn log_grey(point: &Point) -> f64 {
    libm::log(point.grey() + FLOOR)
}

/// A cubic polynomial of the place that comes closest to [`log_grey`], at each point; zeros where the points are too
/// few.
pub(super) fn smooth_part(points: &[Point]) -> Vec<f64> {
    smooth_part_of(points, &points.iter().map(log_grey).collect::<Vec<_>>())
}

/// A cubic polynomial of the place that comes closest to a number at each point; zeros where the points are too few.
pub(super) fn smooth_part_of(points: &[Point], values: &[f64]) -> Vec<f64> {
    let Some(first) = points.first() else { return Vec::new() };
    let [width, height] = extent(points);
    let scale = 1.0 / width.max(height).max(1e-9);
    let rows: Vec<[f64; 10]> =
        points.iter().map(|point| cubic((point.u - first.u) * scale, (point.v - first.v) * scale)).collect();
    let mut normal = Normal::new(10);
    for ((row, value), point) in rows.iter().zip(values).zip(points) {
        normal.add(row, *value, point.weight);
    }
    let total: f64 = points.iter().map(|point| point.weight).sum();
    let solved = normal.solve(|_, _| 1e-9 * total).unwrap_or(vec![0.0; 10]);
    rows.iter().map(|row| row.iter().zip(&solved).map(|(a, b)| a * b).sum()).collect()
}

/// The monomials of degree up to three.
fn cubic(x: f64, y: f64) -> [f64; 10] {
    [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y]
}

/// The points with their smooth part replaced by its mean.
pub(super) fn flattened(points: &[Point]) -> Vec<Point> {
    let smooth = smooth_part(points);
    let total: f64 = points.iter().map(|point| point.weight).sum();
    let mean = points.iter().zip(&smooth).map(|(point, smooth)| point.weight * smooth).sum::<f64>() / total;
    let flat = |(point, smooth): (&Point, &f64)| {
        let gain = libm::exp(mean - smooth);
        Point { albedo: point.albedo.map(|channel| channel * gain), ..*point }
    };
    points.iter().zip(&smooth).map(flat).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checks under light that falls off: the shading goes, the checks stay.
    #[test]
    fn shading_is_taken_away_and_pattern_is_kept() {
        let checks = |u: f64, v: f64| if (u.floor() + v.floor()).rem_euclid(2.0) < 1.0 { 0.6 } else { 0.2 };
        let at = |i: u32, light: f64| {
            let (u, v) = (f64::from(i % 97) * 0.171, f64::from(i / 97) * 0.171);
            let albedo = [checks(u, v) * (1.0 + light * (u - 8.0) / 8.0); 3];
            Point { u, v, footprint: 0.1, albedo, weight: 1.0 }
        };
        let spread = |points: &[Point]| {
            let light_fields =
                points.iter().filter(|point| checks(point.u, point.v) > 0.5).map(|point| point.albedo[0]);
            let (least, most) = light_fields.fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
            most / least
        };
        let points: Vec<Point> = (0..97 * 97).map(|i| at(i, 0.4)).collect();
        let flat = spread(&flattened(&points));
        assert!(flat < 1.15, "{flat}");
        // The twin: before.
        assert!(spread(&points) > 2.0);
    }
}
