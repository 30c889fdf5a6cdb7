//! Submissions from untrusted makers: archives, pictures and folders with planted faults.

#![allow(
    clippy::unwrap_used,
    reason = "tests unwrap; clippy exempts only functions marked as tests, not what they call"
)]

mod suite {
    mod archives;
    mod lint;
    mod maps;
}
