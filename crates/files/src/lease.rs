//! A lease: the right of one process to change a scene, on file systems that several hosts share.
//!
//! It is a file that names its holder and is put in place by a hard link, which succeeds for one process alone, also on
//! network file systems, where `flock` often does not hold. The holder touches it; one that has not been touched for
//! long belongs to a lost host and may be broken.

use std::collections::BTreeSet;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::error::FileError;
use crate::owner::Owner;
use crate::{whole, work_folder};

/// How often a holder gives a sign of life.
const BEAT: Duration = Duration::from_secs(30);

/// How long a holder on another host may be silent: twenty beats.
const LOST_AFTER: Duration = Duration::from_secs(600);

/// How long a process waits for a lease that others hold for a moment.
const PATIENCE: Duration = Duration::from_secs(30);

/// A lease that this process holds until it is dropped.
#[derive(Debug)]
pub struct Lease {
    path: PathBuf,
    text: String,
    heart: Option<(Sender<()>, JoinHandle<()>)>,
}

impl Lease {
    /// Takes the lease that the file `path` stands for. `what` is what it allows to change, as in "scene 'room'". Fails
    /// where another process holds it, or this one does already.
    pub fn take(path: &Path, what: &str) -> Result<Self, FileError> {
        whole::abandoned_beside(path).iter().try_for_each(|left| work_folder::remove(left))?;
        let claim = Claim::new(path)?;
        while !claim.put_at(path)? {
            claim.break_lost(path, what)?;
        }
        // From here on dropping it removes the file.
        let mut lease = Self { path: path.to_owned(), text: claim.text.clone(), heart: None };
        let (sender, stopped) = channel();
        let (beaten, text) = (path.to_owned(), claim.text.clone());
        let beat = move || {
            while stopped.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
                // Another's lease is left alone.
                if std::fs::read_to_string(&beaten).is_ok_and(|found| found == text) {
                    let _ = write_over(&beaten, &text);
                }
            }
        };
        let heart = std::thread::Builder::new().name("lease".to_owned()).spawn(beat);
        lease.heart = Some((sender, heart.map_err(FileError::io("start a thread for", path))?));
        Ok(lease)
    }

    /// Like [`Lease::take`], but waits for a holder that lets go of it soon.
    pub fn wait(path: &Path, what: &str) -> Result<Self, FileError> {
        let start = std::time::Instant::now();
        loop {
            match Self::take(path, what) {
                Err(FileError::InUse { .. }) if start.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                taken => return taken,
            }
        }
    }
}

impl Drop for Lease {
    fn drop(&mut self) {
        if let Some((sender, heart)) = self.heart.take() {
            drop(sender);
            let _ = heart.join();
        }
        // Otherwise it was broken, and belongs to somebody else.
        if std::fs::read_to_string(&self.path).is_ok_and(|found| found == self.text) {
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Writes the same text again: a write rather than a new time, so that the server's clock counts and not this host's,
/// and in place, so that a full disk does not empty the file and a removed one is not made again.
fn write_over(path: &Path, text: &str) -> std::io::Result<()> {
    std::fs::File::options().write(true).open(path)?.write_all(text.as_bytes())
}

/// Fails where a process holds the lease.
fn check_not_held(path: &Path, what: &str) -> Result<(), FileError> {
    // The claim comes first: it makes a network client look at the folder anew.
    Claim::new(path)?.check_lost(path, what)
}

/// The leases of a whole and of its parts, which may be changed side by side, but neither twice nor during a change of
/// the whole.
pub struct LeaseSet {
    /// The folder of the leases; those of parts are in `<part>s`, as in `scenes`.
    pub folder: PathBuf,
    /// The word for a part, as in "scene".
    pub part: &'static str,
    /// What the lease of the whole allows to change.
    pub whole: &'static str,
}

impl LeaseSet {
    /// The right to change a part. Fails where another process changes it or the whole.
    pub fn part(&self, name: &str) -> Result<Lease, FileError> {
        let lease = Lease::take(&self.file(name), &self.what(name))?;
        check_not_held(&self.folder.join("whole"), self.whole)?;
        Ok(lease)
    }

    /// The right to change the whole. Fails where another process does or changes a part. The parts in `known` are
    /// looked for by name too: a network client may list a folder late.
    pub fn whole<'a>(&self, known: impl IntoIterator<Item = &'a str>) -> Result<Lease, FileError> {
        // Taken before parts are looked for: one that is taken from here on finds it.
        let lease = Lease::take(&self.folder.join("whole"), self.whole)?;
        let entries = std::fs::read_dir(self.folder.join(format!("{}s", self.part))).into_iter().flatten().flatten();
        let found = entries.filter_map(|entry| entry.file_name().into_string().ok());
        // Names with a dot are claims, or files of the file system's own.
        let found = found.filter(|name| !name.starts_with('.'));
        let names: BTreeSet<String> = known.into_iter().map(str::to_owned).chain(found).collect();
        names.iter().try_for_each(|name| check_not_held(&self.file(name), &self.what(name)))?;
        Ok(lease)
    }

    fn file(&self, part: &str) -> PathBuf {
        self.folder.join(format!("{}s", self.part)).join(part)
    }

    fn what(&self, part: &str) -> String {
        format!("{} '{part}'", self.part)
    }
}

/// A file beside a lease's place that names this process, to be linked there.
struct Claim {
    file: PathBuf,
    text: String,
}

impl Claim {
    fn new(path: &Path) -> Result<Self, FileError> {
        let folder = path.parent().unwrap_or(Path::new("."));
        work_folder::make_folder(folder)?;
        let file = whole::beside(path).expect("a lease's file has a name");
        // Two leases of one process differ too.
        let text = format!("{}\n{}\n", Owner::this_process(), file.display());
        // Made first, so that it removes its file where the disk is full.
        let claim = Self { file, text };
        std::fs::write(&claim.file, &claim.text).map_err(FileError::io("write", path))?;
        Ok(claim)
    }

    /// Links the claim to `path`; false where a file exists.
    fn put_at(&self, path: &Path) -> Result<bool, FileError> {
        match std::fs::hard_link(&self.file, path) {
            Ok(()) => Ok(true),
            // An answer of a network server may be lost although it made the link.
            Err(_) if std::fs::read_to_string(path).is_ok_and(|found| found == self.text) => Ok(true),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => Ok(false),
            Err(error) => Err(FileError::io("make a hard link at", path)(error)),
        }
    }

    /// Removes the lease at `path` if its holder is lost; fails where it is not.
    fn break_lost(&self, path: &Path, what: &str) -> Result<(), FileError> {
        self.check_lost(path, what)?;
        // Of several processes that find it lost, one removes it: another might remove the lease that follows.
        let guard = path.with_extension("break");
        if !self.put_at(&guard)? {
            self.check_lost(&guard, what)?;
            return work_folder::remove(&guard);
        }
        let removed = match self.check_lost(path, what) {
            Ok(()) => work_folder::remove(path),
            held => held,
        };
        work_folder::remove(&guard)?;
        removed
    }

    /// Fails unless the holder of the lease at `path` is lost.
    fn check_lost(&self, path: &Path, what: &str) -> Result<(), FileError> {
        let text = match std::fs::read_to_string(path) {
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
            found => found.map_err(FileError::io("read", path))?,
        };
        // The claim was written a moment ago, so its time is the file system's present, whatever the hosts' clocks say.
        let time = |path: &Path| std::fs::metadata(path).and_then(|found| found.modified()).ok();
        let silence = match (time(&self.file), time(path)) {
            (Some(now), Some(last)) => now.duration_since(last).unwrap_or_default(),
            _ => Duration::ZERO,
        };
        let Some(holder) = text.lines().next().and_then(Owner::parse) else {
            // Left half-written by a full disk: a lease is linked whole.
            return Ok(());
        };
        if holder.is_gone().unwrap_or(silence > LOST_AFTER) {
            return Ok(());
        }
        Err(FileError::InUse { what: what.to_owned(), holder: Box::new(holder), silence, path: path.to_owned() })
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.file);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::SystemTime;

    use super::*;

    fn planted(holder: &str, silence: Duration) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("leases/room");
        std::fs::create_dir(folder.path().join("leases")).unwrap();
        std::fs::write(&path, holder).unwrap();
        std::fs::File::options().write(true).open(&path).unwrap().set_modified(SystemTime::now() - silence).unwrap();
        (folder, path)
    }

    fn files(path: &Path) -> usize {
        std::fs::read_dir(path.parent().unwrap()).unwrap().count()
    }

    #[test]
    fn the_second_is_refused_until_the_first_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("leases/room");
        let first = Lease::take(&path, "scene 'room'").unwrap();
        let text = Lease::take(&path, "scene 'room'").unwrap_err().to_string();
        let own = Owner::this_process();
        let expected = format!("process {} on {} is at work on scene 'room'", own.process, own.host);
        assert!(text.starts_with(&expected) && text.contains("leases/room"), "{text}");
        assert!(check_not_held(&path, "x").is_err());
        drop(first);
        check_not_held(&path, "x").unwrap();
        drop(Lease::take(&path, "scene 'room'").unwrap());
        assert_eq!(files(&path), 0);
    }

    /// The twin of a process that lives, and of a host that is silent for a shorter time.
    #[test]
    fn only_the_lease_of_a_lost_process_is_broken() {
        let (own, hour) = (Owner::this_process(), Duration::from_secs(3600));
        let cases = [
            (format!("{}-{}-1\n", own.host, own.process), Duration::ZERO, true),
            (format!("{own}\n"), hour, false),
            ("node7-12-ff\n".to_owned(), hour, true),
            ("node7-12-ff\n".to_owned(), LOST_AFTER / 2, false),
            // Its clock is ahead.
            ("node7-12-ff\n".to_owned(), Duration::ZERO, false),
            (String::new(), Duration::ZERO, true),
        ];
        for (holder, silence, lost) in cases {
            let (_folder, path) = planted(&holder, silence);
            let taken = Lease::take(&path, "scene 'room'");
            assert_eq!(taken.is_ok(), lost, "{holder:?} {silence:?}: {taken:?}");
            drop(taken);
            assert_eq!(files(&path), usize::from(!lost), "{holder:?}");
        }
    }

    #[test]
    fn of_many_at_once_one_breaks_a_lost_lease_and_holds_it() {
        for _ in 0..20 {
            let (_folder, path) = planted("node7-12-ff\n", Duration::from_secs(3600));
            let (held, barrier) = (AtomicUsize::new(0), std::sync::Barrier::new(8));
            std::thread::scope(|scope| {
                for _ in 0..8 {
                    scope.spawn(|| {
                        barrier.wait();
                        let lease = Lease::take(&path, "scene 'room'");
                        held.fetch_add(usize::from(lease.is_ok()), Ordering::SeqCst);
                        barrier.wait();
                    });
                }
            });
            assert_eq!((held.into_inner(), files(&path)), (1, 0));
        }
    }

    /// A lease that somebody removed by hand and another took is not removed by the first.
    #[test]
    fn a_broken_lease_is_left_to_its_new_holder() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("room");
        let first = Lease::take(&path, "scene 'room'").unwrap();
        std::fs::remove_file(&path).unwrap();
        let second = Lease::take(&path, "scene 'room'").unwrap();
        drop(first);
        assert!(path.exists());
        drop(second);
        assert!(!path.exists());
    }

    #[test]
    fn a_part_and_the_whole_exclude_each_other() {
        let place = tempfile::tempdir().unwrap();
        let leases = LeaseSet { folder: place.path().join("leases"), part: "house", whole: "the survey" };
        let (first, second) = (leases.part("a").unwrap(), leases.part("b").unwrap());
        assert!(leases.part("a").unwrap_err().to_string().contains("is at work on house 'a'"));
        assert!(leases.whole([]).unwrap_err().to_string().contains("is at work on house 'a'"));
        drop((first, second));
        let whole = leases.whole(["a", "c"]).unwrap();
        assert!(leases.part("a").unwrap_err().to_string().contains("is at work on the survey"));
        assert!(leases.whole([]).is_err());
        drop(whole);
        leases.part("a").unwrap();
    }
}
