//! Gives the shared library the name that programs look for: until 1.0, minor versions break.

use std::env;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        let number = |part: &str| env::var(format!("CARGO_PKG_VERSION_{part}")).unwrap_or_default();
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libfogbow.so.{}.{}", number("MAJOR"), number("MINOR"));
    }
}
