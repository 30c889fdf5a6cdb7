//! What long work reports while it runs.

/// One report of long work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Report<'a> {
    /// Work on a part of the whole begins, such as a scene.
    Part {
        /// What a user reads.
        name: &'a str,
        /// Number of finished parts.
        done: usize,
        /// Number of all parts.
        total: usize,
    },
    /// Pieces of a step are finished. A step belongs to the part that began last, and to the whole work where there are
    /// no parts.
    Step {
        /// What a user reads.
        name: &'a str,
        /// Number of finished pieces.
        done: usize,
        /// Number of all pieces.
        total: usize,
    },
    /// A sentence for the user, which must not be lost.
    Message(&'a str),
}

impl<'a> Report<'a> {
    /// A report of a part of the whole.
    pub fn part(name: &'a str, done: usize, total: usize) -> Self {
        Self::Part { name, done, total }
    }

    /// A report of a step.
    pub fn step(name: &'a str, done: usize, total: usize) -> Self {
        Self::Step { name, done, total }
    }
}

/// The callback by which long work reports. Several threads may call it.
pub type Progress<'a> = &'a (dyn Fn(Report<'_>) + Sync);
