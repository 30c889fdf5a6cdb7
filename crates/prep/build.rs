//! Refuses a build whose xatlas would have a pool of threads of its own.

fn main() {
    println!("cargo::rerun-if-env-changed=CXXFLAGS");
    // The pool can miss its last wake-up, and then hangs for ever. The project's own `.cargo/config.toml` sets the
    // flag; `cargo install --git` and dependants of this crate do not read that file.
    let flags = std::env::var("CXXFLAGS").unwrap_or_default();
    assert!(
        flags.contains("-DXA_MULTITHREADED=0"),
        "xatlas must be compiled without its threads, which can hang; \
         set CXXFLAGS=\"-DXA_MULTITHREADED=0 -std=c++17\" and build again"
    );
}
