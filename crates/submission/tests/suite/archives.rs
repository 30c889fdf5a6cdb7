//! Submissions as archives: sound ones are unpacked, others are refused with a code, and nothing is written elsewhere.

use std::path::{Path, PathBuf};

use mateval_submission::SubmissionError;
use mateval_submission::archive::{ALWAYS_ALLOWED, Opened, open};
use proptest::prelude::*;

use mateval_testkit::packed::{ZipEntry, end, files, gzip, tar_entry, tar_header, tarred, zip, zipped};

/// Opens these bytes and asserts that the work folder holds nothing but the opened submission.
fn opened(name: &str, bytes: &[u8]) -> (tempfile::TempDir, Result<Opened, SubmissionError>) {
    let folder = tempfile::tempdir().unwrap();
    let archive = folder.path().join(name);
    std::fs::write(&archive, bytes).unwrap();
    let work = folder.path().join("deep/work");
    std::fs::create_dir_all(&work).unwrap();
    let opened = open(&archive, &work);
    let mut there: Vec<PathBuf> = files(folder.path()).into_iter().map(|(name, _)| folder.path().join(name)).collect();
    there.retain(|path| {
        *path != archive && opened.as_ref().is_ok_and(|opened| !path.starts_with(opened.root().parent().unwrap()))
    });
    assert_eq!(there, Vec::<PathBuf>::new(), "written outside");
    if opened.is_err() {
        assert_eq!(std::fs::read_dir(&work).unwrap().count(), 0, "left behind");
    }
    (folder, opened)
}

/// The codes of the faults.
#[track_caller]
fn codes(bytes: &[u8]) -> Vec<String> {
    match opened("a.any", bytes).1 {
        Err(SubmissionError::Archive { findings, .. }) => findings.into_iter().map(|finding| finding.code).collect(),
        other => panic!("{other:?}"),
    }
}

fn submission() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("scenes/room/rug")).unwrap();
    std::fs::write(folder.path().join("submission.json"), "{}").unwrap();
    std::fs::write(folder.path().join("scenes/room/rug/base_color.png"), vec![7; 100_000]).unwrap();
    folder
}

#[test]
fn sound_archives_are_unpacked_and_removed_again() {
    let folder = submission();
    for prefix in ["", "./", "mine/"] {
        for bytes in [zipped(folder.path(), prefix), tarred(folder.path(), prefix)] {
            let (_work, opened) = opened("a.any", &bytes);
            let opened = opened.unwrap();
            assert_eq!(files(opened.root()), files(folder.path()));
            let root = opened.root().to_owned();
            drop(opened);
            assert!(!root.exists());
        }
    }
    // A folder is opened in place.
    assert_eq!(open(folder.path(), Path::new("nowhere")).unwrap().root(), folder.path());
}

#[test]
fn long_names_of_gnu_and_pax_are_read() {
    let long = format!("scenes/{}/a.png", "x".repeat(150));
    let gnu = [tar_entry("././@LongLink", b'L', format!("{long}\0").as_bytes()), tar_entry("cut", b'0', b"1")].concat();
    let record = format!("path={long}\n");
    let record = format!("{} {record}", record.len() + 4);
    let pax = [tar_entry("pax", b'x', record.as_bytes()), tar_entry("cut", b'0', b"1")].concat();
    for tar in [gnu, pax] {
        let (_work, opened) = opened("a.tgz", &gzip(&tar));
        assert_eq!(files(opened.unwrap().root()), [(long.clone(), b"1".to_vec())]);
    }
}

/// A value may hold line breaks, as extended attributes of macOS do; the path after it is read all the same.
#[test]
fn attributes_with_line_breaks_are_read() {
    let record = |text: &str| format!("{} {text}\n", text.len() + 4);
    let pax = [record("SCHILY.xattr.a=x\ny\n"), record("path=scenes/a.png")].concat();
    let tar = [tar_entry("pax", b'x', pax.as_bytes()), tar_entry("cut", b'0', b"1")].concat();
    let (_work, opened) = opened("a.tgz", &gzip(&tar));
    assert_eq!(files(opened.unwrap().root()), [("scenes/a.png".to_owned(), b"1".to_vec())]);
}

/// Sparse files would need more disk space than the archive has bytes: both GNU's own and those in pax attributes.
#[test]
fn sparse_files_are_refused() {
    assert_eq!(codes(&gzip(&tar_entry("a", b'S', b""))), ["special_entry"]);
    let pax = [tar_entry("pax", b'x', b"22 GNU.sparse.major=1\n"), tar_entry("a", b'0', b"1")].concat();
    assert_eq!(codes(&gzip(&pax)), ["special_entry"]);
}

#[test]
fn names_that_lead_out_links_and_devices_are_refused() {
    let outside = tempfile::tempdir().unwrap();
    let absolute = outside.path().join("written").to_str().unwrap().to_owned();
    let cases: [(&str, &str); 5] = [
        ("../written", "name_leads_out"),
        ("a/../../../written", "name_leads_out"),
        (&absolute, "absolute_name"),
        ("C:\\written", "bad_name"),
        ("C:written", "absolute_name"),
    ];
    for (name, code) in cases {
        assert_eq!(codes(&zip(&[ZipEntry::new(name, b"1")], b"")), [code], "{name}");
        assert_eq!(codes(&gzip(&tar_entry(name, b'0', b"1"))), [code], "{name}");
    }
    assert_eq!(std::fs::read_dir(outside.path()).unwrap().count(), 0);
    for (mode, kind, code) in [(0o120_777, b'2', "link_in_archive"), (0o020_666, b'3', "special_entry")] {
        let entry = ZipEntry { mode, ..ZipEntry::stored("a", b"/etc/passwd") };
        assert_eq!(codes(&zip(&[entry], b"")), [code]);
        assert_eq!(codes(&gzip(&tar_entry("a", kind, b""))), [code]);
    }
    assert_eq!(codes(&gzip(&tar_entry("a", b'1', b""))), ["link_in_archive"]);
}

/// All faults of entries are reported at once.
#[test]
fn all_entries_are_checked() {
    let entries = [
        ZipEntry::new("../a", b"1"),
        ZipEntry { flags: 1, ..ZipEntry::new("b", b"1") },
        ZipEntry { method: 12, ..ZipEntry::new("c", b"1") },
        ZipEntry { checksum: 1, ..ZipEntry::new("d", b"1") },
        ZipEntry::new("e", b"1"),
        ZipEntry::new("./e", b"1"),
        ZipEntry::new("e/f", b"1"),
        ZipEntry { size: 5, ..ZipEntry::new("g", b"1") },
    ];
    let expected = [
        "damaged_archive",
        "duplicate_name",
        "duplicate_name",
        "encrypted",
        "name_leads_out",
        "unknown_compression",
        "wrong_size",
    ];
    assert_eq!(codes(&zip(&entries, b"")), expected);
    let tar = [tar_entry("a", b'0', b"1"), tar_entry("a", b'0', b"2"), tar_entry("a/b", b'0', b"3")].concat();
    assert_eq!(codes(&gzip(&tar)), ["duplicate_name", "duplicate_name"]);
}

/// Zips of less than a megabyte that would unpack to 100 GB: two hundred entries that share one of 500 MB of zeros; one
/// whose stated size is that large; a directory with only comments.
#[test]
fn bombs_in_zip() {
    let zeros = ZipEntry::new("0", &vec![0; 300 << 20]);
    let shared = |at: usize| ZipEntry { name: at.to_string().into(), shares: Some(0), ..zeros.clone() };
    let all: Vec<ZipEntry> = std::iter::once(zeros.clone()).chain((1..200).map(shared)).collect();
    let bomb = zip(&all, b"");
    assert!(bomb.len() < 4 << 20, "{} bytes", bomb.len());
    assert_eq!(codes(&bomb), ["overlapping_entries"]);
    assert_eq!(codes(&zip(&[ZipEntry { size: 100 << 30, ..ZipEntry::new("a", b"1") }], b"")), ["archive_too_large"]);
    assert_eq!(codes(&zip(std::slice::from_ref(&zeros), b"")), ["archive_bomb"]);
    // An entry with a small stated size is read up to that size.
    assert_eq!(codes(&zip(&[ZipEntry { size: 1000, ..zeros }], b"")), ["wrong_size"]);
    assert_eq!(codes(&[b"PK\x03\x04".to_vec(), end(9, 65 << 20, 0, b"")].concat()), ["directory_too_large"]);
    let long = [&[0xff; 20][..], &end(u16::MAX, u32::MAX, u32::MAX, b"")].concat();
    assert_eq!(codes(&[&b"PK\x03\x04"[..], &long].concat()), ["damaged_archive"]);
}

/// The same as streams: a file whose stated size is 100 GB; ten megabytes that would unpack to ten gigabytes, as files
/// or as skipped entries; a name of 100 GB.
#[test]
fn bombs_in_tar_gz() {
    let zeros = gzip(&vec![0; 64 << 20]);
    let ten_megabytes = zeros.repeat((10 << 20) / zeros.len());
    let bomb = |header: Vec<u8>| [gzip(&header), ten_megabytes.clone()].concat();
    let most = 8_589_934_591;
    assert_eq!(codes(&bomb(tar_header("a", b'0', most))), ["file_too_large"]);
    assert_eq!(codes(&bomb(tar_header("a", b'0', 500 << 20))), ["archive_bomb"]);
    assert_eq!(codes(&bomb(tar_header("a", b'2', most))), ["archive_bomb"]);
    assert_eq!(codes(&bomb(tar_header("a", b'L', most))), ["directory_too_large"]);
    // Only attributes, each of the largest allowed size.
    let attributes = gzip(&tar_entry("a", b'g', &vec![0; 1 << 16]).repeat(64));
    assert_eq!(codes(&attributes.repeat(80)), ["archive_bomb"]);
    // The twin: the ratio that is always allowed.
    let least = [gzip(&tar_header("a", b'0', 64 << 20)), zeros.clone()].concat();
    let (_work, opened) = opened("a.tgz", &least);
    assert_eq!(files(opened.unwrap().root())[0].1.len(), 64 << 20);
    const { assert!(ALWAYS_ALLOWED > 64 << 20) };
}

#[test]
fn truncated_and_changed_archives_are_errors_with_a_reason() {
    let folder = submission();
    for bytes in [zipped(folder.path(), ""), tarred(folder.path(), "")] {
        for length in (4..bytes.len()).step_by(7) {
            assert!(!codes(&bytes[..length]).is_empty(), "{length}");
        }
    }
    // In a stream only the checksum at the end reveals a change.
    let mut changed = tarred(folder.path(), "");
    let checksum = changed.len() - 8;
    changed[checksum] ^= 1;
    assert_eq!(codes(&changed), ["damaged_archive"]);
    assert!(matches!(opened("a.zip", b"no archive").1, Err(SubmissionError::UnknownKind { .. })));
    assert!(matches!(opened("a.zip", b"").1, Err(SubmissionError::UnknownKind { .. })));
}

#[test]
fn what_stands_in_place_of_an_archive_is_named() {
    let tar = [tar_header("a", b'0', 0), vec![0; 1024]].concat();
    let pointer = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n";
    let page = b"<!DOCTYPE html><html>";
    let kinds: [(&[u8], &str); 5] = [
        (pointer, "git lfs pull"),
        (page, "a web page"),
        (b"", "an empty file"),
        (&tar, "a .tar;"),
        (b"Rar!", "a RAR"),
    ];
    for (bytes, words) in kinds {
        let error = opened("a.zip", bytes).1.unwrap_err().to_string();
        assert!(error.contains("expected a folder, a .zip or a .tar.gz; it is ") && error.contains(words), "{error}");
    }
}

proptest! {
    /// Any change is unpacked inside the folder or refused.
    #[test]
    fn any_change_ends(places in prop::collection::vec((0_usize..1 << 16, any::<u8>()), 1..6), is_zip: bool) {
        let folder = submission();
        let mut bytes = if is_zip { zipped(folder.path(), "") } else { tarred(folder.path(), "") };
        let length = bytes.len();
        for (at, value) in places {
            bytes[at % length] = value;
        }
        drop(opened("a.any", &bytes));
    }
}
