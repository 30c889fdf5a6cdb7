//! Compares nodes and graphs with MaterialX' own.
//!
//! `tools/test_materialx.sh` installs MaterialX and Blender, sets `MATEVAL_MATERIALX_PYTHON` and
//! `MATEVAL_PEERS_BLENDER` to the Python interpreters that have them, and runs these tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up has failed")]
#![allow(clippy::print_stderr, reason = "measurements are printed")]

mod peers {
    mod graphs;
    mod nodes;
    mod osl;
}
