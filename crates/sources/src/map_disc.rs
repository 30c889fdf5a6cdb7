//! Discs in latitude-longitude maps of the light from outside: the sun.

use std::f64::consts::PI;

use glam::DVec3;

/// Rows of a map; it has twice as many columns, so a texel is 0.35 degrees high.
pub(crate) const ROWS: usize = 512;

/// The texels that a disc covers.
pub(crate) struct MapDisc {
    /// Indices of texels, row by row, each with the fraction of it that the disc covers.
    pub(crate) shares: Vec<(usize, f64)>,
    /// The solid angle of the covered fractions, in steradians; above 0.
    pub(crate) solid_angle: f64,
}

impl MapDisc {
    /// The disc around a unit vector in the map's frame. One smaller than a texel is enlarged to a texel. None where no
    /// texel's sample lies in it.
    pub(crate) fn new(center: DVec3, diameter_deg: f64) -> Option<Self> {
        // The fraction of a texel that the disc covers, by 16 x 16 samples.
        const PARTS: usize = 16;
        let radius = (diameter_deg / 2.0).to_radians().max(PI / ROWS as f64 / 2.0);
        let least_cos = libm::cos(radius);
        let columns = 2 * ROWS;
        let covered = |index: usize| {
            let inside = |part: usize| {
                let (right, down) = ((part % PARTS) as f64 + 0.5, (part / PARTS) as f64 + 0.5);
                let at = texel_direction(index % columns, index / columns, right / PARTS as f64, down / PARTS as f64);
                at.dot(center) >= least_cos
            };
            (0..PARTS * PARTS).filter(|&part| inside(part)).count() as f64 / (PARTS * PARTS) as f64
        };
        // Only texels near the disc are sampled; a texel reaches at most 0.36 degrees from its centre.
        let near = libm::cos((radius + 0.01).min(PI));
        let close = |index: usize| texel_direction(index % columns, index / columns, 0.5, 0.5).dot(center) >= near;
        let shares: Vec<(usize, f64)> = (0..columns * ROWS).filter(|&i| close(i)).map(|i| (i, covered(i))).collect();
        let solid_angle: f64 = shares.iter().map(|(index, share)| share * texel_solid_angle(index / columns)).sum();
        (solid_angle > 0.0).then_some(Self { shares, solid_angle })
    }
}

/// The direction of a point in a texel. `right` and `down` run from 0 to 1 over the texel.
pub(crate) fn texel_direction(column: usize, row: usize, right: f64, down: f64) -> DVec3 {
    let phi = 2.0 * PI * (column as f64 + right) / (2 * ROWS) as f64;
    let theta = PI * (row as f64 + down) / ROWS as f64;
    let (sin_phi, cos_phi) = libm::sincos(phi);
    let (sin_theta, cos_theta) = libm::sincos(theta);
    DVec3::new(sin_phi * sin_theta, cos_theta, -cos_phi * sin_theta)
}

/// The solid angle of a texel of this row, in steradians.
pub(crate) fn texel_solid_angle(row: usize) -> f64 {
    let edge = |row: usize| libm::cos(PI * row as f64 / ROWS as f64);
    PI / ROWS as f64 * (edge(row) - edge(row + 1))
}
