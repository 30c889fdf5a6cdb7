//! The fit of graphs to what is seen of one part.
//!
//! In: colours at places of a part's surface, in metres ([`points::Point`]), and perhaps the category of the thing.
//! Out: the graph that explains them best, with its settings, or `paint` where none is better than one colour
//! ([`choose::Fitter`]). A [`candidate::Candidate`] shows its colours anywhere, with as much of what is random as
//! wanted.
//!
//! 1. Shading that is left is taken away, and a quarter of the points is held out.
//! 2. Periodic graphs: the strongest waves of the colours ([`waves`]), and those that stand out against waves of similar
//!    period, suggest turns, periods and shifts. Those whose waves agree best are judged by colours, which are a linear
//!    least squares problem. Cells such as tiles have random tones, and rows of boards begin anywhere. The most
//!    promising patterns are searched for the place of their cells and polished by Levenberg-Marquardt steps; sizes are
//!    then compared with their multiples and fractions.
//! 3. What is random, in all graphs: sizes, amplitudes and scattered colours are those whose statistics, from the same
//!    points and footprints, come closest to those seen: structure functions over distances and directions, their
//!    sparseness and asymmetry, quantiles and chromaticity. Its phase cannot be known. Textures are left out where a
//!    periodic graph is surely better.
//! 4. The choice.
//!
//! [`paper`] fits as PSDR-Room does, to be compared with.

pub mod candidate;
mod cells;
pub mod choose;
mod least_squares;
pub mod model;
pub mod paper;
pub mod points;
mod starts;
mod statistics;
mod texture;
pub mod waves;
