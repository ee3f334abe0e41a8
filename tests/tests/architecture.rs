//! The core keeps to the layers of `core/ARCHITECTURE.md`, to `no_std` and to its five
//! dependencies; the repository keeps to itself.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{fs, iter};

/// Crates that the core may use, and no others.
const DEPENDENCIES: [&str; 5] = ["bytemuck", "glam", "heapless", "libm", "rand_core"];

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").to_path_buf()
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

// ---------------------------------------------------------------------------------------------
// Source text

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Word(String),
    PathSeparator,
    Sign(char),
}

#[derive(Debug, Clone)]
struct Token {
    kind: Kind,
    line: usize,
}

impl Token {
    fn word(&self) -> Option<&str> {
        if let Kind::Word(word) = &self.kind { Some(word) } else { None }
    }
}

/// Words and signs of Rust source: comments, strings and character literals are left out.
fn tokens(source: &str) -> Vec<Token> {
    let text: Vec<char> = source.chars().collect();
    let at = |i: usize| text.get(i).copied().unwrap_or('\0');
    let mut found = Vec::new();
    let (mut i, mut line) = (0, 1);
    while i < text.len() {
        let start = i;
        let c = text[i];
        if c == '/' && at(i + 1) == '/' {
            while i < text.len() && text[i] != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            loop {
                if at(i) == '/' && at(i + 1) == '*' {
                    depth += 1;
                    i += 2;
                } else if at(i) == '*' && at(i + 1) == '/' {
                    depth -= 1;
                    i += 2;
                } else {
                    i += 1;
                }
                if depth == 0 || i >= text.len() {
                    break;
                }
            }
        } else if let Some(hashes) = raw_string(&text[i..]) {
            i += text[i..].iter().position(|&c| c == '"').unwrap_or(0) + 1;
            let end: Vec<char> = iter::once('"').chain(iter::repeat_n('#', hashes)).collect();
            while i < text.len() && !text[i..].starts_with(&end) {
                i += 1;
            }
            i += end.len();
        } else if c == '"' {
            i += 1;
            while i < text.len() && text[i] != '"' {
                i += if text[i] == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && (at(i + 1) == '\\' || at(i + 2) == '\'') {
            // A character; otherwise a lifetime, whose quote is a sign like any other.
            i += if at(i + 1) == '\\' { 3 } else { 2 };
            while i < text.len() && text[i] != '\'' {
                i += 1;
            }
            i += 1;
        } else if c.is_alphanumeric() || c == '_' {
            while i < text.len() && (text[i].is_alphanumeric() || text[i] == '_') {
                i += 1;
            }
            found.push(Token { kind: Kind::Word(text[start..i].iter().collect()), line });
        } else if c == ':' && at(i + 1) == ':' {
            i += 2;
            found.push(Token { kind: Kind::PathSeparator, line });
        } else {
            i += 1;
            if !c.is_whitespace() {
                found.push(Token { kind: Kind::Sign(c), line });
            }
        }
        line += text[start..i.min(text.len())].iter().filter(|&&c| c == '\n').count();
    }
    found
}

/// Number of hashes if a raw (byte, C) string starts here.
fn raw_string(text: &[char]) -> Option<usize> {
    let prefix = text.iter().take_while(|c| matches!(c, 'b' | 'c' | 'r')).count();
    if prefix == 0 || text[prefix - 1] != 'r' {
        return None;
    }
    let hashes = text[prefix..].iter().take_while(|&&c| c == '#').count();
    (text.get(prefix + hashes) == Some(&'"')).then_some(hashes)
}

/// Paths that start at `tokens[from]`, nested braces unfolded; each with its line.
fn paths(tokens: &[Token], from: usize) -> Vec<(Vec<String>, usize)> {
    let mut found = Vec::new();
    let mut i = from;
    unfold(tokens, &mut i, &mut Vec::new(), &mut found);
    found
}

fn unfold(tokens: &[Token], i: &mut usize, prefix: &mut Vec<String>, found: &mut Vec<(Vec<String>, usize)>) {
    let depth = prefix.len();
    let line = tokens.get(*i).map_or(0, |t| t.line);
    loop {
        match tokens.get(*i).map(|t| &t.kind) {
            Some(Kind::Word(word)) => {
                prefix.push(word.clone());
                *i += 1;
                if tokens.get(*i).map(|t| &t.kind) == Some(&Kind::PathSeparator) {
                    *i += 1;
                    continue;
                }
                found.push((prefix.clone(), line));
            }
            Some(Kind::Sign('{')) => {
                *i += 1;
                while tokens.get(*i).is_some_and(|t| t.kind != Kind::Sign('}')) {
                    let before = *i;
                    unfold(tokens, i, prefix, found);
                    // Past `as name` and the comma.
                    while tokens.get(*i).is_some_and(|t| !matches!(t.kind, Kind::Sign(',' | '}'))) {
                        *i += 1;
                    }
                    if tokens.get(*i).is_some_and(|t| t.kind == Kind::Sign(',')) || *i == before {
                        *i += 1;
                    }
                }
                *i += 1;
            }
            // `*`, or the `<` of generic arguments: what came before is the path.
            _ => found.push((prefix.clone(), line)),
        }
        break;
    }
    prefix.truncate(depth);
}

/// Every path into the crate that a file names, as seen from the crate's root: `(path, line)`.
fn crate_paths(source: &str, module: &[String]) -> Vec<(Vec<String>, usize)> {
    let tokens = tokens(source);
    let mut found = Vec::new();
    // Modules written inside this file, each with the depth of braces outside it.
    let mut inner: Vec<(String, usize)> = Vec::new();
    let mut depth = 0;
    for i in 0..tokens.len() {
        match &tokens[i].kind {
            Kind::Sign('{') => {
                depth += 1;
                let word = |back: usize| i.checked_sub(back).and_then(|at| tokens[at].word());
                if let (Some("mod"), Some(name)) = (word(2), word(1)) {
                    inner.push((name.to_owned(), depth - 1));
                }
            }
            Kind::Sign('}') => {
                depth -= 1;
                if inner.last().is_some_and(|(_, outside)| *outside == depth) {
                    inner.pop();
                }
            }
            Kind::Word(word) if word == "crate" || word == "super" => {
                let starts = i == 0 || tokens[i - 1].kind != Kind::PathSeparator || self_before(&tokens, i);
                if !starts || tokens.get(i + 1).map(|t| &t.kind) != Some(&Kind::PathSeparator) {
                    continue;
                }
                let mut home: Vec<String> = module.to_vec();
                home.extend(inner.iter().map(|(name, _)| name.clone()));
                for (path, line) in paths(&tokens, i) {
                    found.push((resolve(&home, &path), line));
                }
            }
            _ => {}
        }
    }
    found
}

/// Whether the path before `i` is `self::`, which leads nowhere.
fn self_before(tokens: &[Token], i: usize) -> bool {
    i >= 2 && tokens[i - 2].word() == Some("self")
}

fn resolve(home: &[String], path: &[String]) -> Vec<String> {
    let mut resolved = home.to_vec();
    for step in path {
        match step.as_str() {
            "crate" => resolved.clear(),
            "super" => {
                resolved.pop();
            }
            "self" => {}
            name => resolved.push(name.to_owned()),
        }
    }
    resolved
}

// ---------------------------------------------------------------------------------------------
// The core

/// `(path from core/src, module path, text)` of every file but `lib.rs`.
fn core_files() -> Vec<(String, Vec<String>, String)> {
    let source = repository().join("core/src");
    let mut files = Vec::new();
    let mut folders = vec![source.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("core/src can be listed") {
            let path = entry.expect("core/src can be listed").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let name = path.strip_prefix(&source).expect("listed there").to_string_lossy().replace('\\', "/");
            if !name.ends_with(".rs") || name == "lib.rs" {
                continue;
            }
            let module = name.trim_end_matches(".rs").trim_end_matches("/mod");
            files.push((name.clone(), module.split('/').map(str::to_owned).collect(), read(&path)));
        }
    }
    files.sort();
    files
}

/// Module → layer (`0a`, `1`, …, ordered as text) from the table of `ARCHITECTURE.md`.
fn layers() -> BTreeMap<String, String> {
    let page = read(&repository().join("core/ARCHITECTURE.md"));
    let mut layers = BTreeMap::new();
    for row in page.lines().skip_while(|line| !line.starts_with("| layer | module |")).skip(2) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let [_, layer, module, ..] = cells[..] else { break };
        let layer = layer.split(' ').next().unwrap_or_default().to_owned();
        assert!(layer.starts_with(|c: char| c.is_ascii_digit()), "no layer number in: {row}");
        let before = layers.insert(module.trim_matches('`').to_owned(), layer);
        assert!(before.is_none(), "twice in the table: {row}");
    }
    layers
}

/// What is wrong with one file, given the layers.
fn violations(name: &str, module: &[String], source: &str, layers: &BTreeMap<String, String>) -> Vec<String> {
    let mut found = Vec::new();
    let own = &module[0];
    let Some(layer) = layers.get(own) else { return found };
    for (path, line) in crate_paths(source, module) {
        let Some(target) = path.first() else { continue };
        if target == own {
            continue;
        }
        match layers.get(target) {
            None => found.push(format!("core/src/{name}:{line}: `{target}` is no module of the core")),
            Some(other) if other >= layer => found.push(format!(
                "core/src/{name}:{line}: `{own}` (layer {layer}) must not import `{target}` (layer {other})"
            )),
            Some(_) => {}
        }
    }
    found
}

#[test]
fn modules_import_from_lower_layers_only() {
    let layers = layers();
    let complaints: Vec<String> =
        core_files().iter().flat_map(|(name, module, source)| violations(name, module, source, &layers)).collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn every_module_says_its_layer_as_the_table_does() {
    let layers = layers();
    let tops = core_files()
        .into_iter()
        .filter(|(name, module, _)| module.len() == 1 && (name.ends_with("mod.rs") || !name.contains('/')));
    for (name, module, source) in tops {
        let due = format!("//! Layer {}: ", layers[&module[0]]);
        assert!(source.starts_with(&due), "core/src/{name} must begin with `{due}`");
    }
}

#[test]
fn the_table_names_every_module_and_no_other() {
    let table: BTreeSet<String> = layers().into_keys().collect();
    let modules: BTreeSet<String> = core_files().into_iter().map(|(_, module, _)| module[0].clone()).collect();
    assert!(table.len() > 10, "the table was not read: {table:?}");
    assert_eq!(modules, table, "modules in core/src (left), in core/ARCHITECTURE.md (right)");
}

#[test]
fn the_core_has_no_std_and_no_unsafe() {
    let mut complaints = String::new();
    for (name, _, source) in core_files() {
        let tokens = tokens(&source);
        for (i, token) in tokens.iter().enumerate() {
            let path = tokens.get(i + 1).is_some_and(|next| next.kind == Kind::PathSeparator);
            match token.word() {
                Some("std") if path => _ = writeln!(complaints, "core/src/{name}:{}: `std::`", token.line),
                Some("unsafe") => _ = writeln!(complaints, "core/src/{name}:{}: `unsafe`", token.line),
                _ => {}
            }
        }
    }
    assert!(complaints.is_empty(), "\n{complaints}");

    let root = read(&repository().join("core/src/lib.rs"));
    assert!(root.contains("#![no_std]"), "core/src/lib.rs must be unconditionally no_std");
    assert!(!tokens(&root).iter().any(|t| matches!(t.word(), Some("std" | "unsafe"))), "core/src/lib.rs");
    let manifest = read(&repository().join("Cargo.toml"));
    assert!(manifest.contains("unsafe_code = \"forbid\""), "the workspace must forbid unsafe code");
}

#[test]
fn the_core_depends_on_five_crates() {
    let manifest = read(&repository().join("core/Cargo.toml"));
    let mut found = BTreeSet::new();
    let mut section = "";
    for line in manifest.lines().map(str::trim) {
        if let Some(header) = line.strip_prefix('[') {
            section = header.trim_end_matches(']');
            let other = section.contains("dependencies") && section != "dependencies";
            assert!(!other || section == "dev-dependencies", "core/Cargo.toml: [{section}]");
        } else if section == "dependencies" && line.contains('=') && !line.starts_with('#') {
            let name = line.split(['.', ' ', '=']).next().unwrap_or_default();
            found.insert(name.to_owned());
        }
    }
    assert_eq!(found, DEPENDENCIES.map(str::to_owned).into());
}

// ---------------------------------------------------------------------------------------------
// Threads, locks and clocks

/// The one file that may use [`DRIVER_WORDS`] and atomics.
const DRIVER: &str = "std-adapter/src/threads.rs";

/// Words that none but the adapter's driver may use.
const DRIVER_WORDS: [&str; 10] =
    ["Mutex", "RwLock", "Condvar", "Once", "OnceLock", "Barrier", "rayon", "thread", "Instant", "SystemTime"];

/// What other files may use of these, or of atomics, and why.
const EXCEPTIONS: [(&str, &str, &str); 3] = [
    ("std-adapter/src/stats.rs", "Instant", "the stopwatch, which all others ask for the time"),
    ("std-adapter/src/progress.rs", "AtomicBool", "the flag by which a host cancels"),
    ("examples/src/cli/render.rs", "AtomicBool", "that flag, set by Ctrl-C"),
];

/// The most lines of the adapter.
const ADAPTER_LINES: usize = 1800;

/// Where a file that is neither the driver nor excepted uses words that only the driver may use. Paths are whole, from the repository's root.
fn driver_words(path: &str, source: &str) -> Vec<String> {
    if path == DRIVER {
        return Vec::new();
    }
    let is_allowed = |word: &str| EXCEPTIONS.iter().any(|&(file, allowed, _)| file == path && allowed == word);
    let is_forbidden = |word: &str| DRIVER_WORDS.contains(&word) || word.starts_with("Atomic");
    let found = tokens(source).into_iter().filter_map(|token| Some((token.word()?.to_owned(), token.line)));
    found
        .filter(|(word, _)| is_forbidden(word) && !is_allowed(word))
        .map(|(word, line)| format!("{path}:{line}: `{word}`"))
        .collect()
}

/// What is wrong with an adapter of these files.
fn thickness(files: &[(String, String)], most_lines: usize) -> Vec<String> {
    let mut found = Vec::new();
    let lines: usize = files.iter().map(|(_, source)| source.lines().count()).sum();
    if lines > most_lines {
        found.push(format!("the adapter has {lines} lines, {most_lines} at most"));
    }
    let names_rayon = |source: &str| tokens(source).iter().any(|token| token.word() == Some("rayon"));
    let with_rayon: Vec<&str> =
        files.iter().filter(|(_, source)| names_rayon(source)).map(|(path, _)| path.as_str()).collect();
    if with_rayon != [DRIVER] {
        found.push(format!("rayon is named in {with_rayon:?}, not in {DRIVER:?} alone"));
    }
    found
}

/// `(path from the repository's root, text)` of every Rust file in one of its folders.
fn rust_files(folder: &str) -> Vec<(String, String)> {
    let root = repository();
    let (mut files, mut folders) = (Vec::new(), vec![root.join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("sources can be listed") {
            let path = entry.expect("sources can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|kind| kind == "rs") {
                let name = path.strip_prefix(&root).expect("listed there").to_string_lossy().replace('\\', "/");
                files.push((name, read(&path)));
            }
        }
    }
    assert!(!files.is_empty(), "no sources in {folder}");
    files
}

#[test]
fn only_the_driver_knows_threads_locks_and_clocks() {
    let files: Vec<_> = ["core/src", "std-adapter/src", "examples/src/cli"].into_iter().flat_map(rust_files).collect();
    let complaints: Vec<String> = files.iter().flat_map(|(path, source)| driver_words(path, source)).collect();
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
    // What the rule lets pass is there: it reads the files, and no exception has outlived its reason.
    let uses = |path: &str, word: &str| {
        let source = files.iter().find(|(name, _)| name == path).map(|(_, source)| source.as_str());
        tokens(source.unwrap_or_default()).iter().any(|token| token.word() == Some(word))
    };
    assert!(uses(DRIVER, "rayon"), "{DRIVER}");
    for (path, word, reason) in EXCEPTIONS {
        assert!(uses(path, word), "{path} does not use `{word}`, {reason}: no exception is needed");
    }
}

#[test]
fn the_adapter_is_thin_and_names_rayon_in_one_file() {
    let complaints = thickness(&rust_files("std-adapter/src"), ADAPTER_LINES);
    assert!(complaints.is_empty(), "\n{}", complaints.join("\n"));
}

#[test]
fn words_of_the_driver_are_found_in_code_outside_of_the_driver() {
    let each = DRIVER_WORDS.iter().map(|word| format!("use x::{word};\n")).collect::<String>();
    assert_eq!(driver_words("core/src/x.rs", &each).len(), DRIVER_WORDS.len());
    assert_eq!(driver_words("core/src/x.rs", "\nuse std::sync::Mutex;"), ["core/src/x.rs:2: `Mutex`"]);
    assert_eq!(driver_words("core/src/x.rs", "fn f(a: &AtomicU64) {}"), ["core/src/x.rs:1: `AtomicU64`"]);
    // Words, not parts of words, and neither comments nor text.
    assert!(driver_words("core/src/x.rs", "fn threads(a: Threads, instant_on: u8) { thread_count(); }").is_empty());
    assert!(driver_words("core/src/x.rs", "// a Mutex\nconst A: &str = \"rayon\";").is_empty());
}

#[test]
fn exceptions_are_files_and_not_names_of_files() {
    for word in DRIVER_WORDS {
        assert!(driver_words(DRIVER, word).is_empty());
        for other in ["core/src/threads.rs", "std-adapter/src/x/threads.rs", "std-adapter/src/threads/mod.rs"] {
            assert_eq!(driver_words(other, word).len(), 1, "{other}: {word}");
        }
    }
    for (path, word, _) in EXCEPTIONS {
        assert!(driver_words(path, word).is_empty(), "{path}");
        assert_eq!(driver_words(path, "RwLock").len(), 1, "{path}");
        assert_eq!(driver_words(&format!("core/{path}"), word).len(), 1, "{path}");
    }
}

#[test]
fn a_thick_adapter_and_rayon_elsewhere_are_told() {
    let check = |files: &[(&str, &str)], most: usize| {
        let files: Vec<_> = files.iter().map(|&(path, source)| (path.to_owned(), source.to_owned())).collect();
        thickness(&files, most)
    };
    let (driver, other) = ((DRIVER, "use rayon::join;\n"), "std-adapter/src/x.rs");
    assert!(check(&[driver, (other, "// rayon\n")], 2).is_empty());
    assert_eq!(check(&[driver, (other, "\n\n")], 2), ["the adapter has 3 lines, 2 at most"]);
    assert_eq!(check(&[driver, (other, "fn f() { rayon::spawn(|| {}) }")], 9).len(), 1);
    assert_eq!(check(&[(other, "use rayon;")], 9).len(), 1);
    assert_eq!(check(&[(DRIVER, "fn f() {}")], 9).len(), 1);
}

// ---------------------------------------------------------------------------------------------
// The repository

/// Every file git tracks; without git (a downloaded archive), every file outside `target`.
fn tracked_files() -> Vec<PathBuf> {
    let root = repository();
    let git = std::process::Command::new("git").args(["ls-files", "-z"]).current_dir(&root).output();
    if let Ok(listing) = git
        && listing.status.success()
    {
        let names = String::from_utf8_lossy(&listing.stdout).into_owned();
        return names.split('\0').filter(|name| !name.is_empty()).map(|name| root.join(name)).collect();
    }
    let mut files = Vec::new();
    let mut folders = vec![root];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("the repository can be listed").flatten() {
            let path = entry.path();
            if !path.is_dir() {
                files.push(path);
            } else if !["target", ".git"].iter().any(|name| path.ends_with(name)) {
                folders.push(path);
            }
        }
    }
    files
}

/// Absolute paths of somebody's machine in `text`: line by line.
fn machine_paths(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        for folder in ["work", "root", "home", "Users"] {
            let needle = format!("/{folder}/");
            for (at, _) in line.match_indices(&needle) {
                // In the middle of a longer path or an address it is somebody else's folder.
                let before = line[..at].chars().next_back();
                if !before.is_some_and(|c| c.is_alphanumeric() || "._-~}/$".contains(c)) {
                    found.push((number + 1, needle.clone()));
                }
            }
        }
    }
    found
}

#[test]
fn no_file_names_a_path_of_somebodys_machine() {
    let mut complaints = String::new();
    for path in tracked_files() {
        // Pictures and grids are no text; a file deleted but still in the index is gone.
        let Ok(text) = fs::read_to_string(&path) else { continue };
        for (line, folder) in machine_paths(&text) {
            _ = writeln!(complaints, "{}:{line}: {folder}", path.strip_prefix(repository()).unwrap_or(&path).display());
        }
    }
    assert!(complaints.is_empty(), "\n{complaints}");
}

/// Decisions whose title is not in the index, as a link to their file, and lines that a merge has left.
fn index_complaints(index: &str, decisions: &[(String, String)]) -> Vec<String> {
    let missing = decisions.iter().filter_map(|(file, text)| {
        let title = text.lines().next()?.split_once(". ").map_or("", |(_, title)| title);
        (title.is_empty() || !index.contains(&format!("[{title}]({file})"))).then(|| file.clone())
    });
    let merged =
        index.lines().filter(|line| ["<<<<<<<", "=======", ">>>>>>>"].iter().any(|mark| line.starts_with(mark)));
    missing.chain(merged.map(str::to_owned)).collect()
}

#[test]
fn the_index_of_decisions_has_every_one_by_its_title() {
    let folder = repository().join("core/decisions");
    let files = fs::read_dir(&folder).expect("decisions can be listed").flatten().map(|entry| entry.path());
    let numbered =
        files.filter(|path| path.file_name().is_some_and(|name| name.as_encoded_bytes()[0].is_ascii_digit()));
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let decisions: Vec<_> = numbered.map(|path| (name(&path), read(&path))).collect();
    assert!(decisions.len() > 50);
    let complaints = index_complaints(&read(&folder.join("README.md")), &decisions);
    assert!(complaints.is_empty(), "{complaints:#?}");
}

#[test]
fn decisions_without_an_entry_and_marks_of_merges_are_told() {
    let decision = |file: &str, text: &str| (file.to_owned(), text.to_owned());
    let decisions = [decision("1-a.md", "# 1. Light\n"), decision("2-b.md", "# 2. Fog\n"), decision("3-c.md", "Smoke")];
    let index = "| 1 | [Light](1-a.md) |\n<<<<<<< HEAD\n| 2 | [Mist](2-b.md) |\n";
    assert_eq!(index_complaints(index, &decisions), ["2-b.md", "3-c.md", "<<<<<<< HEAD"]);
}

/// The programs outside the workspace have lock files of their own; they must name the same
/// versions, or CI would prove something about other crates than the ones in use.
#[test]
fn lock_files_outside_the_workspace_agree_with_it() {
    fn packages(lock: &str) -> BTreeSet<(String, String)> {
        let values = |key: &str| -> Vec<String> {
            let prefix = format!("{key} = \"");
            lock.lines().filter_map(|l| l.strip_prefix(&prefix)?.strip_suffix('"').map(str::to_owned)).collect()
        };
        values("name").into_iter().zip(values("version")).collect()
    }
    let ours = packages(&read(&repository().join("Cargo.lock")));
    for program in ["no_alloc", "wasm"] {
        let lock = repository().join("tests").join(program).join("Cargo.lock");
        let theirs: BTreeSet<_> = packages(&read(&lock))
            .into_iter()
            .filter(|(name, _)| name != &format!("fogbow-{program}").replace('_', "-"))
            .collect();
        let stray: Vec<_> = theirs.difference(&ours).collect();
        assert!(
            stray.is_empty(),
            "tests/{program}/Cargo.lock has {stray:?}. Mend it: cp Cargo.lock tests/{program}/ && \
             cargo metadata --format-version 1 --manifest-path tests/{program}/Cargo.toml > /dev/null"
        );
    }
}

/// A file that `tests/main.rs` does not name is never compiled, and its tests never fail.
#[test]
fn every_file_of_tests_belongs_to_the_program_of_its_package() {
    for package in ["tests", "examples"] {
        let folder = repository().join(package).join("tests");
        let program = tokens(&read(&folder.join("main.rs")));
        let named: BTreeSet<&str> =
            program.windows(2).filter(|pair| pair[0].word() == Some("mod")).filter_map(|pair| pair[1].word()).collect();
        for entry in fs::read_dir(&folder).expect("tests can be listed") {
            let path = entry.expect("tests can be listed").path();
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let is_module = path.extension().is_some_and(|kind| kind == "rs") || path.join("mod.rs").is_file();
            assert!(
                !is_module || name == "main" || named.contains(name.as_str()),
                "{package}/tests/main.rs lacks `mod {name};`"
            );
        }
    }
}

// ---------------------------------------------------------------------------------------------
// The reader of source text itself: a check that cannot fail proves nothing.

fn seen(source: &str, module: &[&str]) -> Vec<String> {
    let module: Vec<String> = module.iter().map(|&m| m.to_owned()).collect();
    crate_paths(source, &module).into_iter().map(|(path, line)| format!("{line} {}", path.join("::"))).collect()
}

#[test]
fn imports_are_read_through_braces_super_chains_and_inner_modules() {
    let nested = "use crate::{\n    math::{Ray, float::{self, PI}},\n    light::*,\n};";
    assert_eq!(seen(nested, &["path"]), ["2 math::Ray", "2 math::float", "2 math::float::PI", "3 light"]);
    assert_eq!(seen("use super::super::light::Light as L;", &["medium", "grid"]), ["1 light::Light"]);
    assert_eq!(seen("mod tests { use super::*; }\nuse super::x::{a, b};", &["path", "walk"]).join(" "), {
        "1 path::walk 2 path::x::a 2 path::x::b"
    });
    assert_eq!(seen("fn f() -> f32 { crate::path::trace::<f32>(1.0) }", &["light"]), ["1 path::trace"]);
    assert_eq!(seen("pub(crate) fn f<'a>(x: &'a str) {} // use crate::path;", &["light"]), [""; 0]);
    let literals = "/* use crate::a; /* */ */ const A: (char, &str) = ('\"', \"use crate::b;\"); use crate::c;";
    assert_eq!(seen(literals, &["light"]), ["1 c"]);
    assert_eq!(seen("const A: &str = r#\"\" use crate::a;\"#;\nuse crate::b;", &["light"]), ["2 b"]);
}

#[test]
fn upward_sideways_and_unknown_imports_are_violations() {
    let layers: BTreeMap<String, String> =
        [("math", "0a"), ("spectrum", "0b"), ("light", "4"), ("medium", "4"), ("path", "6")]
            .map(|(module, layer)| (module.to_owned(), layer.to_owned()))
            .into();
    let check = |source: &str| violations("light/x.rs", &["light".to_owned(), "x".to_owned()], source, &layers);
    assert!(check("use crate::math::Ray;\nuse crate::spectrum::Spectrum;\nuse super::mean;").is_empty());
    assert_eq!(check("\nuse crate::path::Radiance;").len(), 1);
    assert!(check("\nuse crate::path::Radiance;")[0].starts_with("core/src/light/x.rs:2: `light` (layer 4)"));
    assert_eq!(check("use super::super::medium::{Grid, Noise};").len(), 2);
    assert_eq!(check("use crate::glam::Vec3;").len(), 1);
}

#[test]
fn paths_of_machines_are_told_from_others() {
    let root = ["/ro", "ot/x"].concat();
    let work = ["= \"/wo", "rk/x\""].concat();
    assert_eq!((machine_paths(&root).len(), machine_paths(&work).len()), (1, 1));
    let harmless = ["../wo", "rk/x https://example.org/ho", "me/ ${HOME}/wo", "rk/"].concat();
    assert!(machine_paths(&harmless).is_empty());
}
