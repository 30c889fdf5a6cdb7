//! Submissions as archives: `.zip` and `.tar.gz`, unpacked to a folder of their own within limits.
//!
//! An archive is untrusted input. Nothing is written outside its folder: absolute names, names that lead out, links,
//! devices and repeated names all refuse the archive. Bytes are counted while they are unpacked; the sizes that the
//! archive states are not relied on. Memory does not grow with the archive.

mod entry;
mod fault;
mod limits;
mod opened;
mod tar_gz;
mod zip;

pub use fault::Fault;
pub use limits::{ALWAYS_ALLOWED, MAX_ENTRIES, MAX_RATIO, MAX_UNPACKED};
pub use opened::{Opened, open};
pub use tar_gz::unpack_tar_gz;
pub use zip::unpack_zip;
