//! Sets the SONAME of the shared library to the version of its ABI.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let variable = |name| std::env::var(name).unwrap_or_default();
    let elf = ["linux", "android", "freebsd", "netbsd", "openbsd", "dragonfly"];
    if elf.contains(&variable("CARGO_CFG_TARGET_OS").as_str()) {
        // Structs may grow between major versions, and before 1.0 between minor versions: a program must be run with the
        // library that it was built against.
        let version = match variable("CARGO_PKG_VERSION_MAJOR").as_str() {
            "0" => format!("0.{}", variable("CARGO_PKG_VERSION_MINOR")),
            major => major.to_string(),
        };
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libpdmp.so.{version}");
    }
}
