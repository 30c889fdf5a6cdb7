//! Marks of results: what a board's keeper has verified, as signatures that nobody else can make.
//!
//! `eval verify --sign KEY` signs the verification `NAME.verified.json` with minisign (Ed25519) and writes
//! `NAME.verified.json.minisig` beside it. A board counts a verification only if one of the keys that its keeper trusts
//! has signed it, since results and verifications arrive from the same people; all other results are shown as claimed.

use std::io::Cursor;
use std::path::{Path, PathBuf};

use mateval_dataset::json;
use mateval_eval::result::ResultFile;
use mateval_eval::verify::{VERIFICATION_FORMAT, VerificationFile};
use mateval_files::FileError;
use mateval_files::untrusted::{read_at_most, sha256_of_bytes};
use mateval_files::whole::{write_private, write_whole};
use minisign::{KeyPair, PublicKey, PublicKeyBox, SecretKey, SecretKeyBox, SignatureBox};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::ReportError;

/// What a key's file holds, in its first line.
const COMMENT: &str = "MatEval leaderboard";

/// What is known about a result beyond its own statement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verified {
    /// Its numbers are claimed: no verification with the signature of a trusted key lies beside it.
    Claimed,
    /// `eval verify` computed the same numbers.
    Confirmed,
    /// `eval verify` computed different numbers.
    Refuted,
    /// The verification belongs to other bytes: the result, or what it was made from, has changed since.
    Stale,
}

/// `DIR/NAME.verified.json` of `DIR/NAME.json`.
pub fn sidecar(result: &Path) -> PathBuf {
    result.with_extension("verified.json")
}

/// The signature beside a file.
pub fn signature_of(file: &Path) -> PathBuf {
    with_ending(file, ".minisig")
}

/// The public key beside a secret one.
pub fn public_of(secret: &Path) -> PathBuf {
    with_ending(secret, ".pub")
}

fn with_ending(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

/// Makes a pair of keys: `path`, which only its owner can read and which has no password, and `path.pub`, as the
/// command `minisign` reads them. Returns the public key as one word.
pub fn new_key(path: &Path) -> Result<String, ReportError> {
    let fault = |error| key_fault(path, &error);
    let KeyPair { pk, sk } = KeyPair::generate_unencrypted_keypair().map_err(fault)?;
    let secret = sk.to_box(Some(COMMENT)).map_err(fault)?.into_string();
    let public = pk.to_box().map_err(fault)?.into_string();
    write_private(path, secret.as_bytes())?;
    write_whole(&public_of(path), public.as_bytes())?;
    Ok(pk.to_base64())
}

/// Reads a secret key without a password.
pub fn secret_key(path: &Path) -> Result<SecretKey, ReportError> {
    let read = SecretKeyBox::from_string(&text_of(path)?).and_then(SecretKeyBox::into_unencrypted_secret_key);
    read.map_err(|error| key_fault(path, &error))
}

/// Signs a verification's file; `when` is the day, and becomes part of what is signed.
pub fn sign(verification: &Path, key: &SecretKey, when: &str) -> Result<(), ReportError> {
    let fault = |error| key_fault(verification, &error);
    let bytes = read_file(verification)?;
    let public = PublicKey::from_secret_key(key).map_err(fault)?;
    let comment = format!("verified on {when}, sha256 {}", sha256_of_bytes(&bytes));
    let signature = minisign::sign(Some(&public), key, Cursor::new(bytes), Some(&comment), Some(COMMENT));
    write_whole(&signature_of(verification), signature.map_err(fault)?.into_string().as_bytes())?;
    Ok(())
}

/// The keys whose verifications a board counts.
#[derive(Clone, Debug, Default)]
pub struct TrustedKeys(Vec<PublicKey>);

impl TrustedKeys {
    /// Reads public keys, as [`new_key`] and `minisign -G` write them.
    pub fn read(paths: &[PathBuf]) -> Result<Self, ReportError> {
        let key = |path: &PathBuf| {
            let read = PublicKeyBox::from_string(&text_of(path)?).and_then(PublicKeyBox::into_public_key);
            read.map_err(|error| key_fault(path, &error))
        };
        Ok(Self(paths.iter().map(key).collect::<Result<_, _>>()?))
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether one of the keys has signed the bytes. A signature that cannot be read is none.
    fn have_signed(&self, bytes: &[u8], signature: &str) -> bool {
        let Ok(signature) = SignatureBox::from_string(signature) else { return false };
        self.0.iter().any(|key| minisign::verify(key, &signature, Cursor::new(bytes), true, false, false).is_ok())
    }

    /// What the verification beside the result in the file `path` states, if a trusted key has signed it; `result` is
    /// the content of that file. Fails if a trusted key has signed something else.
    pub(super) fn mark(&self, path: &Path, result: &ResultFile) -> Result<Verified, ReportError> {
        let sidecar = sidecar(path);
        let (true, Ok(signature)) = (sidecar.exists(), text_of(&signature_of(&sidecar))) else {
            return Ok(Verified::Claimed);
        };
        if !self.have_signed(&read_file(&sidecar)?, &signature) {
            return Ok(Verified::Claimed);
        }
        let file: VerificationFile = json::read_format(&sidecar, VERIFICATION_FORMAT)?;
        let is_of_these_bytes = file.result_sha256 == sha256_of_bytes(&read_file(path)?)
            && file.submission_sha256 == result.submission.sha256
            && file.dataset_manifest_sha256 == result.dataset.manifest_sha256;
        Ok(match (is_of_these_bytes, file.confirmed) {
            (false, _) => Verified::Stale,
            (true, true) => Verified::Confirmed,
            (true, false) => Verified::Refuted,
        })
    }
}

/// No key, signature, verification or result is larger, in bytes.
const MOST_BYTES: u64 = 1 << 30;

fn read_file(path: &Path) -> Result<Vec<u8>, ReportError> {
    Ok(read_at_most(path, MOST_BYTES).map_err(FileError::io("read", path))?)
}

fn text_of(path: &Path) -> Result<String, ReportError> {
    Ok(String::from_utf8_lossy(&read_file(path)?).into_owned())
}

fn key_fault(path: &Path, error: &minisign::PError) -> ReportError {
    ReportError::BadKey { path: path.to_owned(), reason: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranking::tests::{result, scores};

    /// A folder with a result, its verification with these numbers of differences, and two pairs of keys.
    struct Case {
        folder: tempfile::TempDir,
        result: ResultFile,
    }

    impl Case {
        fn new() -> Self {
            let folder = tempfile::tempdir().unwrap();
            let result = result("a", &scores(30.0, 0.0));
            json::write(&folder.path().join("a.json"), &result).unwrap();
            for name in ["keeper", "author"] {
                new_key(&folder.path().join(name)).unwrap();
            }
            Self { folder, result }
        }

        fn path(&self, name: &str) -> PathBuf {
            self.folder.path().join(name)
        }

        fn verify(&self, format: &str, result_sha256: &str, confirmed: bool) {
            let file = serde_json::json!({
                "format": format, "tool": "mateval", "result_sha256": result_sha256, "confirmed": confirmed,
                "differences": 0, "findings": [], "submission_sha256": self.result.submission.sha256,
                "dataset_manifest_sha256": self.result.dataset.manifest_sha256,
            });
            json::write(&sidecar(&self.path("a.json")), &file).unwrap();
        }

        fn sign(&self, key: &str) {
            sign(&sidecar(&self.path("a.json")), &secret_key(&self.path(key)).unwrap(), "2026-11-27").unwrap();
        }

        fn mark(&self) -> Result<Verified, ReportError> {
            let trust = TrustedKeys::read(&[self.path("keeper.pub")]).unwrap();
            trust.mark(&self.path("a.json"), &self.result)
        }
    }

    #[test]
    fn only_a_trusted_key_makes_a_mark() {
        let case = Case::new();
        let sha256 = sha256_of_bytes(&std::fs::read(case.path("a.json")).unwrap());
        assert_eq!(case.mark().unwrap(), Verified::Claimed);
        // A pull request brings its own verification, without a signature, and with one of its own.
        case.verify(VERIFICATION_FORMAT, &sha256, true);
        assert_eq!(case.mark().unwrap(), Verified::Claimed);
        case.sign("author");
        assert_eq!(case.mark().unwrap(), Verified::Claimed);
        case.sign("keeper");
        assert_eq!(case.mark().unwrap(), Verified::Confirmed);
        // Nobody is trusted who was not named.
        assert_eq!(TrustedKeys::default().mark(&case.path("a.json"), &case.result).unwrap(), Verified::Claimed);
        // The verification is changed after it was signed.
        case.verify(VERIFICATION_FORMAT, &sha256, false);
        assert_eq!(case.mark().unwrap(), Verified::Claimed);
        case.sign("keeper");
        assert_eq!(case.mark().unwrap(), Verified::Refuted);
        // The result is changed after it was verified.
        case.verify(VERIFICATION_FORMAT, &sha256, true);
        case.sign("keeper");
        std::fs::write(case.path("a.json"), std::fs::read_to_string(case.path("a.json")).unwrap() + " ").unwrap();
        assert_eq!(case.mark().unwrap(), Verified::Stale);
        case.verify("mateval-verification/9", &sha256, true);
        case.sign("keeper");
        assert!(case.mark().is_err());
    }

    #[test]
    fn a_secret_key_stays_with_its_owner_and_is_named_where_it_cannot_be_read() {
        use std::os::unix::fs::PermissionsExt as _;
        let case = Case::new();
        assert_eq!(std::fs::metadata(case.path("keeper")).unwrap().permissions().mode() & 0o777, 0o600);
        let error = TrustedKeys::read(&[case.path("a.json")]).unwrap_err().to_string();
        assert!(error.contains("a.json") && error.contains("is not a key"), "{error}");
        assert!(secret_key(&case.path("keeper.pub")).is_err());
        assert!(secret_key(&case.path("none")).is_err());
    }
}
