//! What a hidden split says about files that it withholds: their names and one commitment, and no hash of any.
//!
//! A hash of a map can be looked up: it is that of a constant colour, or of a map of a public dataset. In place of
//! hashes the manifest therefore holds lines that `sha256sum -c` skips:
//!
//! ```text
//! # withheld scenes/room/ground_truth/lights.json
//! # commitment HMAC-SHA256 5d41...
//! ```
//!
//! The hashes are in [`WITHHELD`], which lies with the withheld files, and the commitment is its HMAC-SHA256 (RFC 2104)
//! under [`SECRET`], 32 random bytes in hexadecimal beside it. Whoever is given both can check that nothing has changed
//! since the split was published; without the secret nobody can try out what the files may be.

use std::fmt;
use std::path::Path;

use hmac::{Hmac, KeyInit, Mac};
use mateval_files::FileError;
use mateval_files::untrusted::{hex, read_at_most};
use sha2::Sha256;

use crate::DatasetError;

/// The hashes of the withheld files, in the format of the manifest.
pub const WITHHELD: &str = "withheld.sha256";
/// The secret of the commitment.
pub const SECRET: &str = "commitment.secret";

const NAME: &str = "# withheld ";
const COMMITMENT: &str = "# commitment HMAC-SHA256 ";
/// No list of hashes is larger, in bytes.
const MOST_BYTES: u64 = 1 << 28;

/// What a line of the manifest that is not about a public file states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Line<'a> {
    Name(&'a str),
    Commitment(&'a str),
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(file) => write!(f, "{NAME}{file}"),
            Self::Commitment(hash) => write!(f, "{COMMITMENT}{hash}"),
        }
    }
}

impl<'a> Line<'a> {
    pub(super) fn parse(line: &'a str) -> Option<Self> {
        let is_hash = |text: &&str| text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
        let commitment = || line.strip_prefix(COMMITMENT).filter(is_hash).map(Self::Commitment);
        line.strip_prefix(NAME).map(Self::Name).or_else(commitment)
    }
}

/// The secret of a commitment, as its file holds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Secret(String);

impl Secret {
    /// A new one from the system's random numbers.
    pub fn random() -> Result<Self, DatasetError> {
        let mut bytes = [0; 32];
        getrandom::fill(&mut bytes).map_err(|error| {
            let what = format!("the system gives no random numbers: {error}");
            DatasetError::Unsupported { path: SECRET.into(), what }
        })?;
        Ok(Self(hex(&bytes)))
    }

    /// Reads the secret of a split; fails unless it is 32 bytes in hexadecimal.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        let bytes = read_at_most(path, MOST_BYTES).map_err(FileError::io("read", path))?;
        let text = String::from_utf8_lossy(&bytes).trim().to_owned();
        if text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Ok(Self(text.to_ascii_lowercase()));
        }
        let what = "expected the secret of a split: 64 hexadecimal digits".to_owned();
        Err(DatasetError::Unsupported { path: path.to_owned(), what })
    }

    pub fn file_bytes(&self) -> Vec<u8> {
        format!("{}\n", self.0).into_bytes()
    }

    /// The commitment to a list of hashes, in hexadecimal.
    pub fn commitment(&self, list: &[u8]) -> String {
        let mut mac = Hmac::<Sha256>::new_from_slice(self.0.as_bytes()).expect("HMAC takes keys of any length");
        mac.update(list);
        hex(&mac.finalize().into_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commitment_is_hmac_sha256() {
        // RFC 4231, test case 2, whose key is the text "Jefe".
        let secret = Secret("Jefe".to_owned());
        let expected = "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843";
        assert_eq!(secret.commitment(b"what do ya want for nothing?"), expected);
        assert_ne!(Secret::random().unwrap(), Secret::random().unwrap());
    }

    #[test]
    fn lines_are_read_as_they_are_written() {
        let hash = "0f".repeat(32);
        for line in [Line::Name("b c"), Line::Commitment(&hash)] {
            assert_eq!(Line::parse(&line.to_string()), Some(line));
        }
        assert_eq!([Line::parse("# commitment HMAC-SHA256 12"), Line::parse(&format!("{hash}  b"))], [None, None]);
    }
}
