//! Graphs as `.mtlx` files: the reader, which reports everything that it finds, and the writer.

mod document;
mod integers;
mod material;
mod nodes;
mod order;
mod parameters;
mod read;
mod write;

pub use read::{read_file, read_text};
pub use write::{to_text, to_text_of_all};
