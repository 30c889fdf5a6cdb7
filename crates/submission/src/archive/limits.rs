//! How much an archive may hold.

use super::fault::Fault;

/// Most files and folders of a submission, packed or not.
pub const MAX_ENTRIES: usize = 200_000;
/// Most bytes of all files together, once unpacked.
pub const MAX_UNPACKED: u64 = 64 << 30;
/// Bytes that any archive may unpack to, however small it is.
pub const ALWAYS_ALLOWED: u64 = 256 << 20;
/// Beyond [`ALWAYS_ALLOWED`], most bytes that may be unpacked from each byte of the archive.
pub const MAX_RATIO: u64 = 200;

/// What has been unpacked from an archive so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Budget {
    pub(super) entries: usize,
    unpacked: u64,
}

impl Budget {
    /// Counts an entry.
    pub(super) fn add_entry(&mut self) -> Result<(), Fault> {
        self.entries += 1;
        if self.entries <= MAX_ENTRIES {
            return Ok(());
        }
        let message = format!("more than {MAX_ENTRIES} files and folders");
        Err(Fault::refused("too_many_files", message, "pack submission.json and the maps only"))
    }

    /// Counts bytes that were unpacked from the first `packed` bytes of the archive.
    pub(super) fn add_bytes(&mut self, bytes: u64, packed: u64) -> Result<(), Fault> {
        self.unpacked = self.unpacked.saturating_add(bytes);
        if self.unpacked > MAX_UNPACKED {
            let message = format!("more than {MAX_UNPACKED} bytes once unpacked");
            return Err(Fault::refused(
                "archive_too_large",
                message,
                "pack fewer scenes, and score them in several runs",
            ));
        }
        if self.unpacked > ALWAYS_ALLOWED && self.unpacked > packed.saturating_mul(MAX_RATIO) {
            let message = format!(
                "{packed} bytes of the archive unpack to {} bytes or more; expected at most {MAX_RATIO} times the packed size",
                self.unpacked
            );
            return Err(Fault::refused(
                "archive_bomb",
                message,
                "store maps as compressed PNG or EXR files, then pack them",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_archives_are_not_held_to_the_ratio_and_large_ones_are() {
        let mut budget = Budget::default();
        budget.add_bytes(ALWAYS_ALLOWED, 1).unwrap();
        budget.add_bytes(1, ALWAYS_ALLOWED).unwrap();
        assert!(matches!(budget.add_bytes(1, 1), Err(Fault::Refused(_))));
        assert!(matches!(budget.add_bytes(MAX_UNPACKED, u64::MAX), Err(Fault::Refused(_))));
        budget.entries = MAX_ENTRIES - 1;
        budget.add_entry().unwrap();
        assert!(budget.add_entry().is_err());
    }
}
