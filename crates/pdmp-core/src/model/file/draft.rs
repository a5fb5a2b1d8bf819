//! Temporary files for atomic replacement, in the folder of the file that they replace.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Maximum number of names to try: drafts of killed processes with the same id may exist.
const MAX_NAMES: u64 = 1000;

/// New file with a unique name, deleted on drop.
pub(super) struct Draft(PathBuf);

impl Draft {
    /// Creates a draft in a folder, with the default permissions of a new file.
    pub(super) fn create(folder: &Path) -> Result<(Self, File)> {
        static COUNT: AtomicU64 = AtomicU64::new(0);
        let mut tried = 0;
        loop {
            // The counter makes names unique among the threads of a process.
            let name = format!(".pdmp-{}-{}.draft", process::id(), COUNT.fetch_add(1, Relaxed));
            let path = folder.join(name);
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok((Self(path), file)),
                Err(error) if error.kind() == ErrorKind::AlreadyExists && tried < MAX_NAMES => tried += 1,
                Err(error) => return Err(error),
            }
        }
    }

    /// Renames the draft to `target`, replacing an existing file.
    pub(super) fn persist(self, target: &Path) -> Result<()> {
        fs::rename(&self.0, target)?;
        // The draft does not exist any more, so that drop must not delete it.
        std::mem::forget(self);
        Ok(())
    }
}

impl Drop for Draft {
    fn drop(&mut self) {
        // The caller reports the error because of which the draft is dropped.
        let _ = fs::remove_file(&self.0);
    }
}
