//! Words of a pbrt file, and directives with their parameters.

use core::cell::Cell;

/// A word with its line, counted from 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Token<'t> {
    pub(super) word: Word<'t>,
    pub(super) line: u32,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Word<'t> {
    Number(f64),
    /// In quotes.
    Text(&'t str),
    /// A directive, `true` or `false`.
    Bare(&'t str),
    Open,
    Close,
}

/// Reads words one by one.
#[derive(Debug)]
pub(super) struct Words<'t> {
    rest: &'t str,
    line: u32,
    peeked: Option<Token<'t>>,
}

impl<'t> Words<'t> {
    pub(super) fn new(text: &'t str) -> Self {
        Self { rest: text, line: 1, peeked: None }
    }

    /// The line that was reached.
    pub(super) fn line(&self) -> u32 {
        self.peeked.as_ref().map_or(self.line, |token| token.line)
    }

    pub(super) fn peek(&mut self) -> Result<Option<&Token<'t>>, String> {
        if self.peeked.is_none() {
            self.peeked = self.read()?;
        }
        Ok(self.peeked.as_ref())
    }

    pub(super) fn next(&mut self) -> Result<Option<Token<'t>>, String> {
        match self.peeked.take() {
            Some(token) => Ok(Some(token)),
            None => self.read(),
        }
    }

    fn skip(&mut self, bytes: usize) -> &'t str {
        let (skipped, rest) = self.rest.split_at(bytes);
        self.line = self.line.saturating_add(skipped.bytes().filter(|b| *b == b'\n').count() as u32);
        self.rest = rest;
        skipped
    }

    fn read(&mut self) -> Result<Option<Token<'t>>, String> {
        loop {
            let blank = self.rest.len() - self.rest.trim_start().len();
            self.skip(blank);
            if !self.rest.starts_with('#') {
                break;
            }
            self.skip(self.rest.find('\n').unwrap_or(self.rest.len()));
        }
        let line = self.line;
        let word = match self.rest.as_bytes().first() {
            None => return Ok(None),
            Some(b'[') => {
                self.skip(1);
                Word::Open
            }
            Some(b']') => {
                self.skip(1);
                Word::Close
            }
            Some(b'"') => {
                let end = self.rest[1..].find('"').ok_or("a quotation mark is not closed")?;
                let quoted = self.skip(end + 2);
                Word::Text(&quoted[1..=end])
            }
            Some(_) => {
                let ends = |c: char| c.is_whitespace() || matches!(c, '[' | ']' | '"' | '#');
                let word = self.skip(self.rest.find(ends).unwrap_or(self.rest.len()));
                // NaN and infinity are words here.
                match word.parse::<f64>() {
                    Ok(number) if number.is_finite() => Word::Number(number),
                    _ => Word::Bare(word),
                }
            }
        };
        Ok(Some(Token { word, line }))
    }
}

/// `"float fov" [ 37 ]`.
#[derive(Debug, Clone)]
pub(super) struct Parameter {
    /// `float`, `rgb`, …
    pub(super) kind: String,
    pub(super) name: String,
    pub(super) numbers: Vec<f64>,
    pub(super) texts: Vec<String>,
    pub(super) flags: Vec<bool>,
    pub(super) line: u32,
    is_used: Cell<bool>,
}

/// What follows the type of a thing.
#[derive(Debug, Clone, Default)]
pub(super) struct Parameters(Vec<Parameter>);

impl Parameters {
    /// All that follow.
    pub(super) fn read(words: &mut Words<'_>) -> Result<Self, String> {
        let mut all = Vec::new();
        while let Some(Token { word: Word::Text(named), line }) = words.peek()? {
            let (named, line) = (*named, *line);
            words.next()?;
            let (kind, name) = named.split_once(char::is_whitespace).ok_or_else(|| {
                format!("\"{named}\" is no parameter: a type and a name are due, as in \"float radius\"")
            })?;
            let mut parameter = Parameter {
                kind: kind.to_owned(),
                name: name.trim().to_owned(),
                numbers: Vec::new(),
                texts: Vec::new(),
                flags: Vec::new(),
                line,
                is_used: Cell::new(false),
            };
            let is_list = matches!(words.peek()?, Some(Token { word: Word::Open, .. }));
            if is_list {
                words.next()?;
            }
            loop {
                match words.next()?.map(|token| token.word) {
                    Some(Word::Close) if is_list => break,
                    Some(Word::Number(number)) => parameter.numbers.push(number),
                    Some(Word::Text(text)) => parameter.texts.push(text.to_owned()),
                    Some(Word::Bare("true")) => parameter.flags.push(true),
                    Some(Word::Bare("false")) => parameter.flags.push(false),
                    _ => return Err(format!("\"{named}\" has no value that can be read")),
                }
                if !is_list {
                    break;
                }
            }
            // Version 3 has flags in quotes.
            if parameter.kind == "bool" {
                let flag = |text: &String| text == "true";
                parameter.flags.extend(parameter.texts.iter().map(flag));
            }
            all.push(parameter);
        }
        Ok(Self(all))
    }

    /// A parameter, which counts as used.
    pub(super) fn get(&self, name: &str) -> Option<&Parameter> {
        let found = self.0.iter().find(|parameter| parameter.name == name)?;
        found.is_used.set(true);
        Some(found)
    }

    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.get(name)?.numbers.first().copied()
    }

    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.get(name)?.texts.first().map(String::as_str)
    }

    pub(super) fn flag(&self, name: &str) -> bool {
        self.get(name).and_then(|parameter| parameter.flags.first()).copied().unwrap_or(false)
    }

    pub(super) fn triple(&self, name: &str) -> Option<[f64; 3]> {
        self.get(name)?.numbers.get(..3)?.try_into().ok()
    }

    /// Those that nobody asked for.
    pub(super) fn unused(&self) -> impl Iterator<Item = &Parameter> {
        self.0.iter().filter(|parameter| !parameter.is_used.get())
    }
}
