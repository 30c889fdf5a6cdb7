//! A triangle of an atlas, clipped along the rows and columns of texels.

use glam::DVec2;

/// A triangle clipped by at most four lines.
#[derive(Clone, Copy)]
pub(crate) struct Polygon {
    corners: [DVec2; 8],
    count: usize,
}

impl Polygon {
    /// The whole triangle.
    pub(crate) fn new([a, b, c]: [DVec2; 3]) -> Self {
        let mut polygon = Self { corners: [DVec2::ZERO; 8], count: 0 };
        [a, b, c].into_iter().for_each(|corner| polygon.push(corner));
        polygon
    }

    /// Its corners in order; none where everything was cut off.
    pub(crate) fn corners(&self) -> &[DVec2] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: DVec2) {
        self.corners[self.count] = corner;
        self.count += 1;
    }

    /// The part whose dot product with `axis` (along x or y, of either sign) is at least `least` (Sutherland and
    /// Hodgman, 1974). New corners lie exactly on the line.
    pub(crate) fn clipped(&self, axis: DVec2, least: f64) -> Self {
        let mut clipped = Self { corners: [DVec2::ZERO; 8], count: 0 };
        for (at, corner) in self.corners().iter().enumerate() {
            let next = self.corners[(at + 1) % self.count];
            let (height, next_height) = (corner.dot(axis) - least, next.dot(axis) - least);
            if height >= 0.0 {
                clipped.push(*corner);
            }
            if (height > 0.0 && next_height < 0.0) || (height < 0.0 && next_height > 0.0) {
                let cut = *corner + (next - *corner) * (height / (height - next_height));
                let on_line = axis * least;
                clipped.push(if axis.x == 0.0 { DVec2::new(cut.x, on_line.y) } else { DVec2::new(on_line.x, cut.y) });
            }
        }
        clipped
    }

    /// Area and centroid; no area for less than three corners.
    pub(crate) fn measured(&self) -> (f64, DVec2) {
        let Some((first, others)) = self.corners().split_first() else { return (0.0, DVec2::ZERO) };
        let (mut twice, mut moment) = (0.0, DVec2::ZERO);
        for pair in others.windows(2) {
            let (b, c) = (pair[0] - *first, pair[1] - *first);
            twice += b.perp_dot(c);
            moment += (b + c) * b.perp_dot(c);
        }
        if twice == 0.0 { (0.0, *first) } else { (twice.abs() / 2.0, *first + moment / (3.0 * twice)) }
    }
}
