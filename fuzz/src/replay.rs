//! The replay of a corpus by the tests.

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, Instant};

/// Longest time of one input; a hundred times what the slowest takes on a free machine.
const MAX_TIME: Duration = Duration::from_secs(10);

/// Checks every input of a target's corpus, and names those that fail.
///
/// # Panics
/// An input fails or takes too long, or there is none.
pub fn corpus(target: &str, check: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus").join(target);
    let mut paths: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} holds no inputs", folder.display());
    // The models are learnt outside of the time of the first input.
    check(&[]);
    let fails = |path: &&std::path::PathBuf| {
        let (bytes, start) = (fs::read(path).unwrap(), Instant::now());
        catch_unwind(|| check(&bytes)).is_err() || start.elapsed() > MAX_TIME
    };
    let failed: Vec<_> = paths.iter().filter(fails).collect();
    assert!(failed.is_empty(), "{} of {} inputs fail: {failed:?}", failed.len(), paths.len());
}
