//! The header is what cbindgen makes of the source.

use std::fs;
use std::path::Path;

fn made() -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    // In the order in which one would read them.
    let files = [
        "status",
        "host",
        "medium",
        "light",
        "world",
        "work",
        "view",
        "caches",
        "readers",
        "audit",
        "probes",
        "phase",
        "transmittance",
        "covariance",
        "records",
        "compensation",
    ];
    let builder = cbindgen::Builder::new().with_config(config);
    let builder = files.iter().fold(builder, |builder, file| builder.with_src(folder.join(format!("src/{file}.rs"))));
    let mut header = Vec::new();
    builder.generate().unwrap().write(&mut header);
    String::from_utf8(header).unwrap()
}

#[test]
fn the_header_is_what_the_source_says() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/fogbow.h");
    let made = made();
    if std::env::var_os("FOGBOW_WRITE_HEADER").is_some() {
        fs::write(&path, &made).unwrap();
    }
    let there = fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    assert!(there == made, "include/fogbow.h is stale: FOGBOW_WRITE_HEADER=1 cargo test -p fogbow-c header");
    // Each function of the source is there, once.
    let functions = fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap().flat_map(|file| {
        let source = fs::read_to_string(file.unwrap().path()).unwrap();
        let after = source.split("#[unsafe(no_mangle)]").skip(1).map(str::to_owned).collect::<Vec<_>>();
        after.into_iter().map(|text| text.split("fn ").nth(1).unwrap().split('(').next().unwrap().to_owned())
    });
    let functions: Vec<String> = functions.collect();
    assert!(functions.len() > 40);
    let code: Vec<&str> = made.split("#ifdef __cplusplus\nextern").nth(1).unwrap().lines().collect();
    let misuse = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/misuse.c")).unwrap();
    for function in functions {
        assert!(misuse.contains(&format!("{function}(")), "tests/misuse.c does not misuse {function}");
        let is_declared = |line: &&&str| !line.starts_with("//") && line.contains(&format!("{function}("));
        assert_eq!(code.iter().filter(is_declared).count(), 1, "{function}");
    }
}
