//! Elements of the file: attributes, values, and errors that say where.

use std::path::PathBuf;

use fogbow::spectrum::Spectrum;

use super::notes::{NoteKind, Sink};
use super::preprocess::error_at;
use super::tree::{Node, Tree};
use crate::error::{DataError, SceneError};

/// What every element of a scene shares.
#[derive(Debug)]
pub(super) struct Context {
    /// All elements.
    pub(super) tree: Tree,
    /// Where notes and errors go.
    pub(super) sink: Sink,
}

/// An element with its context. One that stands in a scene by reference is the element meant, with the name that the
/// reference gives it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Element<'a> {
    pub(super) node: &'a Node,
    pub(super) context: &'a Context,
    /// The `<ref>` that led here.
    reference: Option<&'a Node>,
}

impl<'a> Element<'a> {
    /// The outermost element.
    pub(super) fn root(context: &'a Context) -> Self {
        Self { node: context.tree.root(), context, reference: None }
    }

    /// The tag: `float`, `shape`.
    pub(super) fn tag(&self) -> &'a str {
        &self.node.tag
    }

    /// Its name as a property: that of the reference where it stands by one.
    pub(super) fn name(&self) -> Option<&'a str> {
        self.reference.unwrap_or(self.node).attribute("name")
    }

    pub(super) fn line(&self) -> u32 {
        self.node.line
    }

    /// A path as the file names it, relative to the file or to the folders of `<path>`.
    pub(super) fn resolve(&self, name: &str) -> PathBuf {
        self.context.tree.resolve(self.node, name)
    }

    /// An error of the whole element.
    pub(super) fn error(&self, reason: impl core::fmt::Display) -> SceneError {
        error_at(&self.context.tree, self.node, reason)
    }

    /// An error of an element as a child of another: of the reference, where it stands there by one.
    pub(super) fn error_of_use(&self, reason: impl core::fmt::Display) -> SceneError {
        error_at(&self.context.tree, self.reference.unwrap_or(self.node), reason)
    }

    /// The error of an element that is not what is due, at the reference that says so if there is one.
    pub(super) fn wrong_tag(&self, due: &str) -> SceneError {
        match self.reference {
            Some(reference) => {
                let id = reference.attribute("id").unwrap_or_default();
                let reason = format!("\"{id}\" is a <{}> where a <{due}> is due", self.tag());
                SceneError { attribute: Some("id".to_owned()), ..error_at(&self.context.tree, reference, reason) }
            }
            None => self.error(format!("a <{due}> is due here")),
        }
    }

    /// Notes that something has no effect here.
    pub(super) fn ignored(&self, reason: impl core::fmt::Display) {
        self.context.sink.note(NoteKind::Ignored, self.error(reason));
    }

    /// Notes what looks like a mistake.
    pub(super) fn suspicious(&self, reason: impl core::fmt::Display) {
        self.context.sink.note(NoteKind::Suspicious, self.error(reason));
    }

    /// For something that is missing here: the error, or where the user allows it (`--lenient`) the nearest there is and a note
    /// that names it,
    /// as in "a pinhole instead" or "ignored".
    pub(super) fn instead<T>(
        &self,
        error: SceneError,
        name: &str,
        nearest: impl FnOnce() -> T,
    ) -> Result<T, SceneError> {
        self.context.sink.instead(error, name, nearest)
    }

    /// The same for a whole element: any error at all, where the user allows it, is a note.
    pub(super) fn or_instead<T>(
        &self,
        result: Result<T, SceneError>,
        name: &str,
        nearest: impl FnOnce() -> T,
    ) -> Result<T, SceneError> {
        match result {
            Err(error) if self.context.sink.is_lenient => self.instead(error, name, nearest),
            result => result,
        }
    }

    /// The value; or nothing, and the error is kept, so that reading may go on and find further ones.
    pub(super) fn keep<T>(&self, result: Result<T, SceneError>) -> Option<T> {
        self.context.sink.keep(result)
    }

    /// Whether something inside it sends out light.
    pub(super) fn is_emitter(&self) -> bool {
        self.children().is_ok_and(|children| children.iter().any(|child| child.tag() == "emitter"))
    }

    /// An error of one attribute.
    pub(super) fn attribute_error(&self, attribute: &str, reason: impl core::fmt::Display) -> SceneError {
        SceneError { attribute: Some(attribute.to_owned()), ..self.error(reason) }
    }

    /// The error of a file the element names.
    pub(super) fn data_error(&self, error: &DataError) -> SceneError {
        self.attribute_error("value", error)
    }

    /// Children that are elements, references followed. Those that lead nowhere have been told and are left out.
    ///
    /// # Errors
    /// Text between them.
    pub(super) fn children(&self) -> Result<Vec<Self>, SceneError> {
        if let Some(text) = &self.node.text {
            return Err(self.error(format!("unexpected text \"{text}\"")));
        }
        let tree = &self.context.tree;
        let children = self.node.children.iter().filter_map(|id| {
            let (mut node, mut reference) = (tree.node(*id), None);
            if node.tag == "ref" {
                reference = Some(node);
                node = tree.node(*tree.ids.get(node.attribute("id")?)?);
            }
            Some(Self { node, context: self.context, reference })
        });
        Ok(children.collect())
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
            Some(child) => Err(child.error(format!("is not expected inside <{}>", self.tag()))),
            None => Ok(()),
        }
    }

    /// An attribute, if it is there.
    pub(super) fn optional(&self, attribute: &str) -> Option<String> {
        self.node.attribute(attribute).map(str::to_owned)
    }

    /// An attribute that must be there.
    pub(super) fn required(&self, attribute: &str) -> Result<String, SceneError> {
        self.optional(attribute).ok_or_else(|| self.attribute_error(attribute, "is missing"))
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
            if let Some(extra) = ["x", "y", "z"].into_iter().find(|a| self.node.has_attribute(a)) {
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
