//! Patterns with known graphs and settings, as a camera would see them, and how well a fit recovers them.

#![allow(dead_code, reason = "tests and the bench use different parts")]

pub mod draw;
pub mod lattice;
pub mod outcome;
pub mod view;
