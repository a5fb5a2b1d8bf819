#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| pdmp_fuzz::model_file::check(data));
