//! The built-in graphs: 28 `.mtlx` files, CC0, in the folder `library` of this crate.

use crate::error::ProceduralError;
use crate::graph::Graph;
use crate::mtlx::read_text;
use crate::value::words;

words! {
    /// What kind of pattern a graph makes.
    pub enum Class {
        /// One colour.
        Flat = "flat",
        /// Random, and alike in all directions.
        Isotropic = "isotropic",
        /// Random, with a direction.
        Oriented = "oriented",
        /// Periodic in one direction.
        Stripe = "stripe",
        /// Periodic in two directions.
        Lattice = "lattice",
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Entry {
    pub name: &'static str,
    pub class: Class,
    pub text: &'static str,
}

macro_rules! entries {
    ($($class:ident $name:literal),* $(,)?) => {
        [$(Entry {
            name: $name,
            class: Class::$class,
            text: include_str!(concat!("../library/", $name, ".mtlx")),
        }),*]
    };
}

pub const LIBRARY: [Entry; 28] = entries![
    Flat "paint",
    Isotropic "plaster",
    Isotropic "roughcast",
    Isotropic "concrete",
    Isotropic "terrazzo",
    Isotropic "granite",
    Oriented "marble",
    Oriented "travertine",
    Oriented "veneer",
    Lattice "plank",
    Lattice "strip_parquet",
    Lattice "herringbone",
    Lattice "basket_parquet",
    Lattice "tile",
    Lattice "brick",
    Lattice "hexagon",
    Lattice "mosaic",
    Lattice "checks",
    Stripe "stripes",
    Lattice "plaid",
    Lattice "houndstooth",
    Lattice "dots",
    Lattice "trellis",
    Lattice "weave",
    Stripe "corduroy",
    Isotropic "carpet",
    Isotropic "leather",
    Oriented "metal",
];

pub fn entry(name: &str) -> Option<&'static Entry> {
    LIBRARY.iter().find(|entry| entry.name == name)
}

impl Entry {
    /// The graph. Fails only where the built-in file is faulty, which a test rules out.
    pub fn graph(&self) -> Result<Graph, ProceduralError> {
        read_text(self.name, self.text)
    }
}
