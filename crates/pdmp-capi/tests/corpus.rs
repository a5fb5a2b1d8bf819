//! Replay of the corpus of the fuzz target for the C ABI.
#![allow(missing_docs, unreachable_pub, dead_code, unsafe_code)]

#[path = "../../../fuzz/src/c_abi.rs"]
mod c_abi;
#[path = "../../../fuzz/src/input.rs"]
mod input;
#[path = "../../../fuzz/src/replay.rs"]
mod replay;

#[test]
fn no_sequence_of_calls_panics_or_writes_numbers_that_are_not_finite() {
    replay::corpus("c_abi", c_abi::check);
}
