//! The lattice of a pattern: the translations that leave it the same.
//!
//! The same dots are described by many settings: rows may be taken along any of the lattice's vectors, and shifts from
//! row to row count up to a whole one. So two fits are compared by their lattices, of which each has to hold the
//! vectors of the other, and not by the values of parameters. A pattern of one length scales and turns a square, or of
//! hexagons a triangular, lattice with it; rows and stripes repeat along one vector only.

use mateval_procedural::{Graph, Settings};

use super::draw::value;

/// The vectors of a lattice in metres, of the least lengths.
struct Lattice {
    vectors: Vec<[f64; 2]>,
}

impl Lattice {
    fn of(graph: &Graph, periods: &[&str], settings: &Settings) -> Self {
        let number = |name: &str| value(graph, settings, name);
        let first = number(periods[0]);
        let second = periods.get(1).map(|name| number(name));
        let vectors = match graph.name.as_str() {
            "stripes" | "corduroy" => vec![[first, 0.0]],
            "plank" | "strip_parquet" => vec![[0.0, first]],
            "hexagon" => vec![[first, 0.0], [0.5 * first, 0.75_f64.sqrt() * first]],
            "brick" => vec![[first, 0.0], [-number("row_shift") * first, second.unwrap()]],
            "dots" => vec![[first, 0.0], [-number("stagger") * first, second.unwrap()]],
            _ => vec![[first, 0.0], [0.0, second.unwrap_or(first)]],
        };
        let (sin, cos) = number("theta").to_radians().sin_cos();
        let turned = |[u, v]: [f64; 2]| [u * cos - v * sin, u * sin + v * cos];
        Self { vectors: reduced(vectors.into_iter().map(turned).collect()) }
    }

    /// The area of a cell in square metres, or the period along the one vector in metres.
    fn size(&self) -> f64 {
        match self.vectors.as_slice() {
            [a, b] => (a[0] * b[1] - a[1] * b[0]).abs(),
            all => length(all[0]),
        }
    }

    /// The vector of the lattice that is nearest to this one or its opposite, turned to its side.
    fn nearest(&self, to: [f64; 2]) -> [f64; 2] {
        let (a, b) = (self.vectors[0], self.vectors.get(1).copied().unwrap_or_default());
        let combined = |i: i32, j: i32| [0, 1].map(|axis| f64::from(i) * a[axis] + f64::from(j) * b[axis]);
        let all = (-3..=3).flat_map(|i| (-3..=3).map(move |j| combined(i, j)));
        let apart = |from: &[f64; 2]| length([from[0] - to[0], from[1] - to[1]]);
        all.min_by(|p, q| apart(p).total_cmp(&apart(q))).unwrap()
    }
}

/// Two vectors of the same lattice, of the least lengths (Lagrange and Gauss).
fn reduced(mut vectors: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    if let [a, b] = vectors.as_mut_slice() {
        for _ in 0..64 {
            if length(*a) > length(*b) {
                std::mem::swap(a, b);
            }
            let times = ((a[0] * b[0] + a[1] * b[1]) / (a[0] * a[0] + a[1] * a[1])).round();
            if times == 0.0 {
                break;
            }
            *b = [b[0] - times * a[0], b[1] - times * a[1]];
        }
    }
    vectors
}

fn length([u, v]: [f64; 2]) -> f64 {
    u.hypot(v)
}

/// How far two lattices of a graph are apart: the greatest relative error of a length, and the greatest angle in
/// degrees. Multiples of the planted lengths count as the errors that they are.
pub fn lattice_errors(graph: &Graph, periods: &[&str], found: &Settings, planted: &Settings) -> [f64; 2] {
    let [found, planted] = [found, planted].map(|settings| Lattice::of(graph, periods, settings));
    let mut errors = [(found.size() / planted.size()).ln().abs() / planted.vectors.len() as f64, 0.0];
    for vector in &planted.vectors {
        let nearest = found.nearest(*vector);
        let cross = vector[0] * nearest[1] - vector[1] * nearest[0];
        let dot = vector[0] * nearest[0] + vector[1] * nearest[1];
        errors[0] = errors[0].max((length(nearest) / length(*vector) - 1.0).abs());
        errors[1] = errors[1].max(cross.atan2(dot).to_degrees().abs());
    }
    errors
}
