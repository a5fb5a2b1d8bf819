//! The committed header is the one that cbindgen generates from the sources.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;

use cbindgen::{Builder, Config};

#[test]
fn header_is_fresh() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = Config::from_file(root.join("cbindgen.toml")).unwrap();
    let sources = [
        "status",
        "buffers",
        "model",
        "command",
        "controller",
        "limits",
        "controller_copies",
        "trajectory",
        "passage",
        "recogniser",
        "two_arms",
    ];
    let builder = sources.iter().fold(Builder::new().with_config(config), |builder, name| {
        builder.with_src(root.join(format!("src/{name}.rs")))
    });
    let mut fresh = Vec::new();
    builder.generate().unwrap().write(&mut fresh);

    let header = root.join("include/pdmp.h");
    if std::env::var_os("PDMP_WRITE_HEADER").is_some() {
        fs::write(&header, &fresh).unwrap();
    }
    assert!(fs::read(&header).is_ok_and(|committed| committed == fresh), "include/pdmp.h is stale: run `make header`");
}
