//! Every public function of the core has an example that calls it and asserts something; no two public
//! types share a name; no public function takes more than six arguments.
//!
//! A method is shown by an example of its own or by the one of its type. `cargo test -p fogbow --doc
//! --features alloc` runs the examples; this test reads the source, as `cargo fmt` lays it out.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// Functions that need no example: `(file: function, reason)`.
const EXCEPTIONS: &[(&str, &str)] = &[];

// ---------------------------------------------------------------------------------------------
// The reader

#[derive(Debug, PartialEq)]
struct Function {
    /// Type or trait that it belongs to.
    owner: Option<String>,
    /// Whether that is a trait.
    of_trait: bool,
    name: String,
    /// Without the receiver.
    arguments: usize,
    docs: String,
}

impl Function {
    fn title(&self) -> String {
        self.owner.as_ref().map_or_else(|| self.name.clone(), |owner| format!("{owner}::{}", self.name))
    }
}

/// What is public in a file.
#[derive(Debug, Default)]
struct Public {
    functions: Vec<Function>,
    /// Types and traits with their doc comments.
    types: Vec<(String, String)>,
}

enum Scope {
    /// The inherent methods of a type.
    Methods(String),
    /// A public trait, all of whose functions are public.
    Trait(String),
    Module,
    /// Bodies, implementations of traits, tests.
    Hidden,
}

fn words_before_name<'a>(line: &'a str, modifiers: &[&str]) -> &'a str {
    let mut rest = line;
    while let Some(shorter) = modifiers.iter().find_map(|m| rest.strip_prefix(m)?.strip_prefix(' ')) {
        rest = shorter;
    }
    rest
}

fn first_word(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
    &text[..end]
}

/// What comes after a leading `<…>`; the `>` of an arrow closes nothing.
fn past_generics(text: &str) -> &str {
    if !text.starts_with('<') {
        return text;
    }
    let (mut depth, mut before) = (0, ' ');
    for (i, c) in text.char_indices() {
        match c {
            '<' => depth += 1,
            '>' if before != '-' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return &text[i + 1..];
        }
        before = c;
    }
    ""
}

/// Arguments without the receiver; `text` begins with the list's parenthesis.
fn arguments(text: &str) -> usize {
    let (mut depth, mut before) = (0_i32, ' ');
    let mut parts = vec![String::new()];
    for c in text.chars() {
        match c {
            '(' | '[' | '{' | '<' => depth += 1,
            ')' | ']' | '}' => depth -= 1,
            '>' if before != '-' => depth -= 1,
            ',' if depth == 1 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        if depth == 0 {
            break;
        }
        before = c;
        parts.last_mut().expect("never empty").push(c);
    }
    let is_argument = |part: &&String| {
        let part = part.trim_start_matches('(').trim();
        let part = part.trim_start_matches('&');
        let part = if part.starts_with('\'') { part.split_once(' ').map_or("", |(_, rest)| rest) } else { part };
        let part = words_before_name(part, &["mut"]);
        !part.is_empty() && first_word(part) != "self"
    };
    parts.iter().filter(is_argument).count()
}

fn read(source: &str) -> Public {
    let mut public = Public::default();
    let lines: Vec<&str> = source.lines().collect();
    let mut scopes: Vec<(usize, Scope)> = Vec::new();
    let (mut docs, mut only_tests) = (String::new(), false);
    let mut i = 0;
    while i < lines.len() {
        let line = lines[i].trim();
        let indent = lines[i].len() - lines[i].trim_start().len();
        i += 1;
        if line.starts_with('}') && scopes.last().is_some_and(|(at, _)| *at == indent) {
            scopes.pop();
            continue;
        }
        if matches!(scopes.last(), Some((_, Scope::Hidden))) {
            continue;
        }
        if let Some(text) = line.strip_prefix("///") {
            docs.push_str(text.strip_prefix(' ').unwrap_or(text));
            docs.push('\n');
            continue;
        }
        if line.starts_with("#[") {
            only_tests |= line.starts_with("#[cfg(test)]");
            let mut end = line;
            while !end.ends_with(']') && i < lines.len() {
                end = lines[i].trim();
                i += 1;
            }
            continue;
        }
        let docs = std::mem::take(&mut docs);
        let tested = std::mem::take(&mut only_tests);
        let is_public = line.starts_with("pub ") && !tested;
        let item = words_before_name(line, &["pub", "pub(crate)", "pub(super)", "const", "async", "unsafe"]);
        let keyword = first_word(item);
        if !["fn", "struct", "enum", "union", "trait", "type", "impl", "mod", "macro_rules"].contains(&keyword) {
            continue;
        }
        // The item's head, up to its body or its end.
        let mut head = item.to_owned();
        let mut last = line;
        while !last.ends_with(['{', '}', ';']) && i < lines.len() {
            last = lines[i].trim();
            head.push(' ');
            head.push_str(last);
            i += 1;
        }
        let name = first_word(head[keyword.len()..].trim_start());
        let after = &head[keyword.len()..].trim_start()[name.len()..];
        let mut scope = Scope::Hidden;
        match keyword {
            "fn" => {
                let owner = match scopes.last() {
                    Some((_, Scope::Methods(owner) | Scope::Trait(owner))) => Some(owner.clone()),
                    _ => None,
                };
                let of_trait = matches!(scopes.last(), Some((_, Scope::Trait(_))));
                if is_public || of_trait {
                    let arguments = arguments(past_generics(after));
                    public.functions.push(Function { owner, of_trait, name: name.to_owned(), arguments, docs });
                }
            }
            "struct" | "enum" | "union" | "trait" | "type" if is_public => {
                // A type of a trait's own is no type of the module.
                if matches!(scopes.last(), None | Some((_, Scope::Module))) {
                    public.types.push((name.to_owned(), docs));
                }
                if keyword == "trait" {
                    scope = Scope::Trait(name.to_owned());
                }
            }
            "impl" if !tested => {
                let subject = past_generics(head[keyword.len()..].trim_start().trim_end_matches(['{', '}'])).trim();
                if !subject.contains(" for ") {
                    let path = subject.split(['<', ' ']).next().unwrap_or_default();
                    scope = Scope::Methods(path.rsplit("::").next().unwrap_or_default().to_owned());
                }
            }
            "mod" if !tested => scope = Scope::Module,
            _ => {}
        }
        if last.ends_with('{') {
            scopes.push((indent, scope));
        }
    }
    public
}

/// The code of the Rust examples in a doc comment that are run and assert something, without comments
/// and imports.
fn examples(docs: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut lines = docs.lines();
    while let Some(line) = lines.next() {
        let Some(info) = line.trim().strip_prefix("```") else { continue };
        let code: Vec<&str> = lines.by_ref().take_while(|line| line.trim() != "```").collect();
        let runs = info.split(',').all(|word| ["", "rust", "should_panic"].contains(&word.trim()));
        let code: Vec<&str> = code
            .into_iter()
            .map(|line| line.trim().trim_start_matches("# ").split("//").next().unwrap_or_default())
            .filter(|line| !line.starts_with("use "))
            .collect();
        let code = code.join("\n");
        if runs && (code.contains("assert") || info.contains("should_panic")) {
            found.push(code);
        }
    }
    found
}

/// Places where `word` stands in `code`, by what stands before it.
fn before_word<'a>(code: &'a str, word: &str) -> Vec<&'a str> {
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    code.match_indices(word)
        .filter(|(at, _)| !code[at + word.len()..].starts_with(is_part) && !code[..*at].ends_with(is_part))
        .map(|(at, _)| &code[..at])
        .collect()
}

/// Whether an example of its own names the function, or one of its type calls it; that of a trait may implement it.
fn is_shown(function: &Function, docs_of_owner: &str) -> bool {
    let own = examples(&function.docs).iter().any(|code| !before_word(code, &function.name).is_empty());
    let calls = |before: &str| {
        before.ends_with('.') || before.ends_with("::") || (function.of_trait && before.ends_with("fn "))
    };
    let by_owner = function.owner.is_some()
        && examples(docs_of_owner).iter().any(|code| before_word(code, &function.name).into_iter().any(calls));
    own || by_owner
}

// ---------------------------------------------------------------------------------------------
// The core

/// `(path from core/src, what is public in it)`, in order.
fn core() -> Vec<(String, Public)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ lies in the repository").join("core/src");
    let mut files = Vec::new();
    let mut folders = vec![root.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("core/src can be listed") {
            let path = entry.expect("core/src can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let name = path.strip_prefix(&root).expect("listed there").to_string_lossy().replace('\\', "/");
                let source = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                files.push((name, read(&source)));
            }
        }
    }
    files.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(files.len() > 50, "core/src was not read");
    files
}

/// The module of the first level that a file belongs to.
fn module(file: &str) -> &str {
    file.split(['/', '.']).next().unwrap_or_default()
}

#[test]
fn every_public_function_has_an_example() {
    let core = core();
    // Types are looked up in their module: methods may stand in another file.
    let mut docs: BTreeMap<(&str, &str), String> = BTreeMap::new();
    for (file, public) in &core {
        for (name, text) in &public.types {
            docs.entry((module(file), name)).or_default().push_str(text);
        }
    }
    let mut missing: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let mut exceptions: BTreeSet<&str> = EXCEPTIONS.iter().map(|(function, _)| *function).collect();
    let mut count = 0;
    for (file, public) in &core {
        for function in &public.functions {
            count += 1;
            let owner = function.owner.as_deref().and_then(|owner| docs.get(&(module(file), owner)));
            if is_shown(function, owner.map_or("", String::as_str)) {
                continue;
            }
            if !exceptions.remove(format!("{file}: {}", function.title()).as_str()) {
                missing.entry(file).or_default().push(function.title());
            }
        }
    }
    assert!(count > 500, "only {count} functions were found");
    assert!(EXCEPTIONS.iter().all(|(_, reason)| reason.len() > 10), "an exception without a reason");
    assert!(exceptions.is_empty(), "no exceptions any more, or no functions: {exceptions:?}");

    let mut complaints = String::new();
    for (file, functions) in &missing {
        _ = writeln!(complaints, "core/src/{file}: {}", functions.join(", "));
    }
    assert!(complaints.is_empty(), "without an example:\n{complaints}");
}

#[test]
fn no_two_public_types_share_a_name() {
    let core = core();
    let mut places: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (file, public) in &core {
        for (name, _) in &public.types {
            // `Settings` goes by its module, so one in each is allowed.
            let title = if name == "Settings" { module(file) } else { name.as_str() };
            places.entry(title).or_default().push(file);
        }
    }
    places.retain(|_, files| files.len() > 1);
    assert!(places.is_empty(), "types that share a name, and where they are: {places:#?}");
}

#[test]
fn no_public_function_takes_more_than_six_arguments() {
    let found: Vec<String> = core()
        .iter()
        .flat_map(|(file, public)| public.functions.iter().map(move |function| (file, function)))
        .filter(|(_, function)| function.arguments > 6)
        .map(|(file, function)| format!("{file}: {}", function.title()))
        .collect();
    assert!(found.is_empty(), "functions above six arguments: {found:#?}");
}

// ---------------------------------------------------------------------------------------------
// The reader itself: a check that cannot fail proves nothing.

#[test]
fn public_functions_are_read_with_their_docs_and_arguments() {
    let source = r#"
/// A pair.
///
/// ```
/// assert_eq!(Pair::new(1).first(), 1);
/// ```
pub struct Pair<T> {
    /// First.
    pub first: T,
}

impl<T: Fn(f32) -> f32> Pair<T> {
    /// New.
    #[expect(
        clippy::all,
        reason = "long"
    )]
    pub const fn new(a: (f32, f32), b: &dyn Fn(f32, f32) -> f32) -> Self {
        pub fn hidden() {}
    }

    pub(crate) fn internal(&self) {}

    fn private(&self) {}

    pub fn first<'a>(&'a self) -> f32 {
        1.0
    }
}

impl<T> Clone for Pair<T> {
    fn clone(&self) -> Self {}
}

/// A trait.
pub trait Host {
    type Output;
    /// Asked.
    fn asked(&mut self, x: [f32; 3]);
}

pub fn free<F: Fn(f32) -> f32, const N: usize>(
    mut a: [f32; N],
    f: F,
) -> Pair<F>
where
    F: Clone,
{
    a
}

#[cfg(test)]
mod tests {
    pub fn not_this() {}
}
"#;
    let public = read(source);
    let found: Vec<(String, usize)> = public.functions.iter().map(|f| (f.title(), f.arguments)).collect();
    let expected = [("Pair::new", 2), ("Pair::first", 0), ("Host::asked", 1), ("free", 2)];
    assert_eq!(found, expected.map(|(name, arguments)| (name.to_owned(), arguments)));
    assert_eq!(public.functions[0].docs, "New.\n");
    let types: Vec<&str> = public.types.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(types, ["Pair", "Host"]);
    let shown: Vec<bool> = public.functions.iter().map(|f| is_shown(f, &public.types[0].1)).collect();
    assert_eq!(shown, [true, true, false, false]);
}

#[test]
fn an_example_is_run_asserts_something_and_names_the_function() {
    let method = |docs: &str| {
        let (owner, name, docs) = (Some("T".to_owned()), "f".to_owned(), docs.to_owned());
        Function { owner, of_trait: false, name, arguments: 0, docs }
    };
    let shown = |docs: &str| is_shown(&method(docs), "");
    assert!(shown("```\n# use x::f;\nassert_eq!(f(1), 1);\n```"));
    assert!(shown("Text.\n```rust\nlet a = [1].map(f);\nassert!(a[0] > 0);\n```\nText."));
    assert!(!shown("```text\nassert_eq!(f(1), 1);\n```"));
    assert!(!shown("```no_run\nassert_eq!(f(1), 1);\n```"));
    assert!(!shown("```\n# use x::f;\nlet _ = f(1);\n```"));
    assert!(!shown("```\n# use x::f;\nassert_eq!(half(1), 1); // f(1)\n```"));
    assert!(!shown("f(1)"));
    let by_type = |code: &str| is_shown(&method(""), &format!("```\n{code}\n```"));
    assert!(by_type("assert_eq!(T::new().f(), 1);") && by_type("assert_eq!(T::f(), 1);"));
    let implemented = "```\nimpl T for U { fn f() {} }\nassert!(ask(&U));\n```";
    assert!(is_shown(&Function { of_trait: true, ..method("") }, implemented) && !is_shown(&method(""), implemented));
    assert!(!by_type("assert_eq!(f(1), 1);") && !by_type("assert_eq!(T::new().fs(), 1);"));
}
