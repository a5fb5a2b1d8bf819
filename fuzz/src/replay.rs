//! Replay of a corpus in the tests, and random search in the absence of libFuzzer.

use std::fs;
use std::panic::catch_unwind;
use std::path::Path;
use std::time::{Duration, Instant};

/// Time limit of one input: a hundred times that of the slowest input on an idle machine.
const MAX_TIME: Duration = Duration::from_secs(10);
/// Maximum length of an input of a search, in bytes.
const MAX_LENGTH: u64 = 160;

/// Checks every input in the corpus of a target. If PDMP_FUZZ_SECONDS is set, then checks random inputs for that time,
/// and writes those that fail to `fuzz/found/`.
///
/// # Panics
/// Panics if an input fails or exceeds the time limit, or if the corpus is empty.
pub fn corpus(target: &str, check: fn(&[u8])) {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz");
    let folder = fuzz.join("corpus").join(target);
    let mut paths: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    assert!(!paths.is_empty(), "{} holds no inputs", folder.display());
    // The models are fitted before the time of the first input is measured.
    check(&[]);
    let failed: Vec<_> = paths.iter().filter(|path| fails(check, &fs::read(path).unwrap())).collect();
    assert!(failed.is_empty(), "{} of {} inputs fail: {failed:?}", failed.len(), paths.len());
    if let Some(seconds) = std::env::var("PDMP_FUZZ_SECONDS").ok().and_then(|text| text.parse().ok()) {
        search(check, Duration::from_secs(seconds), &fuzz.join("found").join(target));
    }
}

/// Returns true if the check panics or exceeds the time limit.
fn fails(check: fn(&[u8]), bytes: &[u8]) -> bool {
    let start = Instant::now();
    catch_unwind(|| check(bytes)).is_err() || start.elapsed() > MAX_TIME
}

/// Checks random inputs for a time, and writes those that fail to a folder.
///
/// # Panics
/// Panics if an input fails.
fn search(check: fn(&[u8]), time: Duration, found: &Path) {
    // xorshift64 (Marsaglia 2003).
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let (start, mut executions, mut failures) = (Instant::now(), 0_usize, 0_usize);
    while start.elapsed() < time {
        // Short inputs make few edits, which are accepted more often.
        let length = random() % [8, 20, MAX_LENGTH][executions % 3];
        let bytes: Vec<u8> = (0..length).map(|_| (random() >> 32) as u8).collect();
        executions += 1;
        if fails(check, &bytes) {
            failures += 1;
            fs::create_dir_all(found).unwrap();
            fs::write(found.join(format!("{:08x}", hash(&bytes))), &bytes).unwrap();
        }
    }
    println!("{executions} inputs in {} s, {failures} failures", time.as_secs());
    assert_eq!(failures, 0, "failing inputs are in {}", found.display());
}

/// Returns the 32-bit FNV-1a hash of an input, which names its file.
fn hash(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}
