//! Procedural materials: graphs of MaterialX nodes, read, evaluated and written.
//!
//! In: a `.mtlx` file, which is untrusted input ([`mtlx`]), or a graph of the built-in library ([`library`]). Out: a
//! checked [`Graph`], its material at any point of a plane in metres, derivatives in its parameters, pictures, and the
//! graph as a `.mtlx` file again.
//!
//! In between, the graph becomes a list of scalar instructions ([`program`]), which an [`Evaluator`] carries out for 64
//! points at once. [`node`] lists the supported nodes with the defaults of their inputs, [`noise`] has the noises, and
//! [`Settings`] hold the values of a graph's parameters.
//!
//! [`fit`] finds the graph and the settings that show what is seen of a part; [`unfolding`] lays parts out flat.
//!
//! A graph has the outputs `base_color` (linear), `roughness` and `metallic`. Its texture coordinates are metres. An
//! input called `footprint` is set at every point to the extent of its pixel or texel, so that edges and lines are as
//! blurred as the pixel needs.

pub mod error;
pub mod evaluator;
pub mod fit;
pub mod graph;
pub mod library;
pub mod mtlx;
pub mod node;
pub mod noise;
pub mod program;
pub mod unfolding;
pub mod value;

pub use error::ProceduralError;
pub use evaluator::Evaluator;
pub use graph::{Graph, Settings};
pub use program::Program;
