//! A graph as a list of scalar instructions.

mod argument;
pub mod builder;
pub mod compile;
mod lower;
pub mod op;
mod pattern;
mod vector;
