//! Elements of the file: attributes, values, and errors that say where.

use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

use fogbow::spectrum::Spectrum;
use roxmltree::{Node, NodeId};

use crate::error::{DataError, SceneError};

/// What every element of a file shares.
#[derive(Debug)]
pub(super) struct Context {
    /// The scene file.
    pub(super) file: PathBuf,
    /// Values of `$name`.
    pub(super) defaults: BTreeMap<String, String>,
    /// Elements by id.
    pub(super) ids: HashMap<String, NodeId>,
}

impl Context {
    /// A path as the file names it, relative to the file.
    pub(super) fn resolve(&self, name: &str) -> PathBuf {
        self.file.parent().map_or_else(|| PathBuf::from(name), |folder| folder.join(name))
    }
}

/// An element with its context.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element<'a> {
    pub(super) node: Node<'a, 'a>,
    pub(super) context: &'a Context,
}

impl<'a> Element<'a> {
    /// The tag: `float`, `shape`.
    pub(super) fn tag(&self) -> &'a str {
        self.node.tag_name().name()
    }

    /// The element as errors show it.
    fn label(&self) -> String {
        let mut label = format!("<{}", self.tag());
        for key in ["type", "name", "id"] {
            if let Some(value) = self.node.attribute(key) {
                label.push_str(&format!(" {key}=\"{value}\""));
            }
        }
        label.push('>');
        label
    }

    pub(super) fn line(&self) -> u32 {
        self.node.document().text_pos_at(self.node.range().start).row
    }

    /// An error of the whole element.
    pub(super) fn error(&self, reason: impl core::fmt::Display) -> SceneError {
        SceneError {
            file: self.context.file.clone(),
            line: Some(self.line()),
            element: self.label(),
            attribute: None,
            reason: reason.to_string(),
        }
    }

    /// An error of one attribute.
    pub(super) fn attribute_error(&self, attribute: &str, reason: impl core::fmt::Display) -> SceneError {
        SceneError { attribute: Some(attribute.to_owned()), ..self.error(reason) }
    }

    /// The error of a file the element names.
    pub(super) fn data_error(&self, error: &DataError) -> SceneError {
        self.attribute_error("value", error)
    }

    /// Children that are elements.
    ///
    /// # Errors
    /// Text between them.
    pub(super) fn children(&self) -> Result<Vec<Self>, SceneError> {
        let mut children = Vec::new();
        for node in self.node.children() {
            if node.is_element() {
                children.push(Self { node, context: self.context });
            } else if node.is_text() && !node.text().unwrap_or_default().trim().is_empty() {
                let text: String = node.text().unwrap_or_default().trim().chars().take(20).collect();
                return Err(self.error(format!("unexpected text \"{text}\"")));
            }
        }
        Ok(children)
    }

    /// # Errors
    /// An attribute that is none of `known`.
    pub(super) fn allow(&self, known: &[&str]) -> Result<(), SceneError> {
        match self.node.attributes().find(|a| !known.contains(&a.name())) {
            Some(unknown) => Err(self.attribute_error(unknown.name(), "is not known here")),
            None => Ok(()),
        }
    }

    /// # Errors
    /// A child where there should be none.
    pub(super) fn no_children(&self) -> Result<(), SceneError> {
        match self.children()?.first() {
            Some(child) => Err(child.error(format!("is not expected inside {}", self.label()))),
            None => Ok(()),
        }
    }

    /// An attribute with `$name` replaced.
    ///
    /// # Errors
    /// A `$name` that has no `<default>`.
    pub(super) fn optional(&self, attribute: &str) -> Result<Option<String>, SceneError> {
        let Some(written) = self.node.attribute(attribute) else { return Ok(None) };
        let mut pieces = written.split('$');
        let mut value = pieces.next().unwrap_or_default().to_owned();
        for piece in pieces {
            let end = piece.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(piece.len());
            let (name, rest) = piece.split_at(end);
            let Some(replacement) = self.context.defaults.get(name) else {
                return Err(self.attribute_error(attribute, format!("${name} has no <default>")));
            };
            value.push_str(replacement);
            value.push_str(rest);
        }
        Ok(Some(value))
    }

    /// An attribute that must be there.
    pub(super) fn required(&self, attribute: &str) -> Result<String, SceneError> {
        self.optional(attribute)?.ok_or_else(|| self.attribute_error(attribute, "is missing"))
    }

    fn parse_number(&self, attribute: &str, text: &str) -> Result<f64, SceneError> {
        let number: f64 =
            text.trim().parse().map_err(|_| self.attribute_error(attribute, format!("\"{text}\" is not a number")))?;
        // Values end up in single precision.
        if !number.is_finite() || !(number as f32).is_finite() {
            return Err(self.attribute_error(attribute, format!("{text} is not a finite number")));
        }
        Ok(number)
    }

    /// A number.
    pub(super) fn number(&self, attribute: &str) -> Result<f64, SceneError> {
        self.parse_number(attribute, &self.required(attribute)?)
    }

    /// Numbers separated by blanks or commas.
    pub(super) fn numbers(&self, attribute: &str) -> Result<Vec<f64>, SceneError> {
        self.required(attribute)?
            .split(|c: char| c == ',' || c.is_whitespace())
            .filter(|part| !part.is_empty())
            .map(|part| self.parse_number(attribute, part))
            .collect()
    }

    /// Three numbers in one attribute.
    pub(super) fn triple(&self, attribute: &str) -> Result<[f64; 3], SceneError> {
        let numbers = self.numbers(attribute)?;
        <[f64; 3]>::try_from(numbers.as_slice())
            .map_err(|_| self.attribute_error(attribute, format!("{} numbers where three are due", numbers.len())))
    }

    /// Three numbers as `x`, `y`, `z`, or all in `value` (one number counts for all where
    /// `may_repeat`). What is missing is `fill`.
    pub(super) fn xyz(&self, fill: f64, may_repeat: bool) -> Result<[f64; 3], SceneError> {
        if self.node.has_attribute("value") {
            if let Some(extra) = ["x", "y", "z"].into_iter().find(|a| self.node.has_attribute(*a)) {
                return Err(self.attribute_error(extra, "cannot stand beside \"value\""));
            }
            if may_repeat && let [one] = self.numbers("value")?[..] {
                return Ok([one; 3]);
            }
            return self.triple("value");
        }
        let axis = |name: &str| if self.node.has_attribute(name) { self.number(name) } else { Ok(fill) };
        Ok([axis("x")?, axis("y")?, axis("z")?])
    }

    /// A colour: three numbers or one.
    pub(super) fn colour(&self) -> Result<Spectrum, SceneError> {
        match self.numbers("value")?[..] {
            [one] => Ok(Spectrum::splat(one as f32)),
            [r, g, b] => Ok(Spectrum::new(r as f32, g as f32, b as f32)),
            ref other => {
                Err(self.attribute_error("value", format!("{} numbers where one or three are due", other.len())))
            }
        }
    }
}
