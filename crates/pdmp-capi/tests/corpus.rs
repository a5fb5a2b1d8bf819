//! Inputs that the fuzz target of the C ABI found keep its claim.
#![allow(missing_docs, unreachable_pub, dead_code, unsafe_code)]

#[path = "../../../fuzz/src/c_abi.rs"]
mod c_abi;
#[path = "../../../fuzz/src/input.rs"]
mod input;
#[path = "../../../fuzz/src/replay.rs"]
mod replay;

/// No sequence of calls panics, reaches past a buffer, or makes a motion that is not finite.
#[test]
fn odd_calls_are_answered_and_every_motion_is_finite() {
    replay::corpus("c_abi", c_abi::check);
}
