//! How long work tells how far it is.

/// Called with the step's name, how much of it is done, and how much there is. May be called from several threads.
pub type Progress<'a> = &'a (dyn Fn(&str, usize, usize) + Sync);
