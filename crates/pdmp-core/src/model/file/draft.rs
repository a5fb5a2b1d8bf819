//! Drafts of files, written beside the place that they then take.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Names tried before a folder counts as unusable: drafts of killed processes with the same id may be in the way.
const MAX_NAMES: u64 = 1000;

/// A new file with a name of its own, deleted when dropped.
pub(super) struct Draft(PathBuf);

impl Draft {
    /// Creates a draft in a folder, with the permissions of any new file.
    pub(super) fn create(folder: &Path) -> Result<(Self, File)> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let mut tried = 0;
        loop {
            // No two threads of a process draw the same number.
            let name = format!(".pdmp-{}-{}.draft", process::id(), COUNT.fetch_add(1, Relaxed));
            let path = folder.join(name);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok((Self(path), file)),
                Err(error) if error.kind() == ErrorKind::AlreadyExists && tried < MAX_NAMES => tried += 1,
                Err(error) => return Err(error),
            }
        }
    }

    /// Moves the draft to its place, replacing what is there.
    pub(super) fn persist(self, place: &Path) -> Result<()> {
        fs::rename(&self.0, place)?;
        // Nothing is left to delete.
        std::mem::forget(self);
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // The error that led here is reported already.
        let _ = fs::remove_file(&self.0);
    }
}
