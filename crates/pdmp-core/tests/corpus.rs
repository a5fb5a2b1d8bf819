//! Regression test of inputs that the fuzz target of model files found.
#![cfg(feature = "learning")]
#![allow(missing_docs, unreachable_pub, dead_code)]

#[path = "../../../fuzz/src/input.rs"]
mod input;
#[path = "../../../fuzz/src/model_file.rs"]
mod model_file;
#[path = "../../../fuzz/src/replay.rs"]
mod replay;

/// A forged model file with a valid checksum is rejected or moves in finite numbers, and either takes seconds at most.
#[test]
fn forged_model_files_are_rejected_or_move_in_finite_numbers() {
    replay::corpus("model_file", model_file::check);
}
