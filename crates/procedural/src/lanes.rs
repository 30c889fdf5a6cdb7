//! Numbers of a batch of points side by side.

/// The number of points that are evaluated together.
pub const LANES: usize = 64;

/// One number for each point of a batch.
pub type Lanes = [f64; LANES];

/// The places of a batch. Fewer than [`LANES`] points are filled up with copies of any.
#[derive(Clone, Debug)]
pub struct Points {
    /// First coordinates in metres.
    pub u: Lanes,
    /// Second coordinates in metres.
    pub v: Lanes,
    /// Extents of the points' pixels or texels in metres; 0 for exact points.
    pub footprint: Lanes,
}
