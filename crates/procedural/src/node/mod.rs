//! The supported nodes of MaterialX' standard library.

pub mod catalog;
pub mod kind;
pub mod signature;
