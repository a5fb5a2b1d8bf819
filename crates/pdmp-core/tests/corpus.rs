//! Inputs that the fuzz target of model files found keep its claim.
#![allow(missing_docs, unreachable_pub, dead_code)]

#[path = "../../../fuzz/src/input.rs"]
mod input;
#[path = "../../../fuzz/src/model_file.rs"]
mod model_file;
#[path = "../../../fuzz/src/replay.rs"]
mod replay;

/// A forged model file with a valid checksum is refused, or moves in finite numbers; either takes its time in seconds.
#[test]
fn forged_model_files_are_refused_or_move_in_finite_numbers() {
    replay::corpus("model_file", model_file::check);
}
