//! The callback by which long work reports its progress.

/// Called with the step's name, the number of its parts that are done, and their total. Several threads may call it.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);
