//! The fit of a periodic graph to what is seen of one part.
//!
//! In: colours at places of a part's surface, in metres ([`points::Point`]). Out: the graph that predicts held-out
//! points best, with its settings, or `paint` where none is better than one colour ([`choose::Fitter`]).
//!
//! The strongest waves of the colours ([`waves`]) suggest turns, periods and shifts of each graph; for each of these
//! starts the graph's colours are a linear least squares problem; the best starts are polished by Levenberg-Marquardt
//! steps.
//!
//! Twelve periodic graphs are fitted, which `periods` lists. Others, such as planks and parquet, are not. Neither is what
//! is random, such as grain, veins and the tone of single tiles: fitted graphs leave it out.

pub mod candidate;
mod category;
pub mod choose;
mod colors;
mod hypotheses;
mod lm;
mod model;
mod pattern;
mod periods;
pub mod points;
pub mod roles;
mod smooth;
mod system;
pub mod waves;
