//! Everything about disks and processes: what is written appears whole or not at all, what several processes write is
//! guarded, and what comes from elsewhere is read within limits.
//!
//! [`whole`] writes files, [`work_folder`] folders, beside their place before they are renamed. A [`lease`] is the
//! right of one process, its [`owner`], to change something that several hosts share. A [`cache`] holds what can be
//! made again. [`untrusted`] reads and hashes files of unknown origin, and [`source_folder`] those that other files
//! name. Whatever the disk refuses is a [`FileError`].

pub mod cache;
pub mod error;
pub mod lease;
pub mod owner;
pub mod source_folder;
pub mod untrusted;
pub mod whole;
pub mod work_folder;

pub use error::FileError;
