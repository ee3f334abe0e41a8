//! Elements with a type and properties: `<shape type="sphere">`. Every property is asked for by
//! name; what nobody asked for is an error.

use core::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::PathBuf;

use fogbow::spectrum::Spectrum;

use super::element::Element;
use super::spectra::{self, Role};
use super::transforms;
use super::tree::Inline;
use crate::error::SceneError;
use crate::transform::Transform;

/// Tags that hold one value.
const VALUES: [&str; 9] = ["float", "integer", "boolean", "string", "rgb", "spectrum", "point", "vector", "transform"];
/// Tags of nested objects.
const OBJECTS: [&str; 12] = [
    "bsdf",
    "emitter",
    "medium",
    "phase",
    "volume",
    "film",
    "rfilter",
    "sampler",
    "shape",
    "texture",
    "integrator",
    "sensor",
];

#[derive(Debug)]
struct Child<'a> {
    element: Element<'a>,
    name: Option<&'a str>,
    is_used: Cell<bool>,
}

/// An element with a type and children.
#[derive(Debug)]
pub(super) struct Plugin<'a> {
    pub(super) element: Element<'a>,
    pub(super) kind: String,
    children: Vec<Child<'a>>,
    /// Names that were asked for, for suggestions.
    asked: RefCell<BTreeSet<String>>,
}

impl<'a> Plugin<'a> {
    pub(super) fn new(element: Element<'a>) -> Result<Self, SceneError> {
        element.allow(&["type", "id", "name"])?;
        let mut kind = element.required("type")?;
        if kind.contains(|c: char| c.is_ascii_uppercase()) {
            element
                .suspicious(format!("\"{kind}\" is written \"{}\"; Mitsuba 3 refuses it", kind.to_ascii_lowercase()));
            kind.make_ascii_lowercase();
        }
        let mut children: Vec<Child<'a>> = Vec::new();
        for child in element.children()? {
            let is_value = VALUES.contains(&child.tag());
            if !is_value && !OBJECTS.contains(&child.tag()) {
                let near = suggestion(child.tag(), VALUES.into_iter().chain(OBJECTS));
                return Err(child.error(format!("unknown element inside <{}>{near}", element.tag())));
            }
            let name = child.name();
            if is_value && name.is_none() {
                return Err(child.attribute_error("name", "is missing"));
            }
            if name.is_some() && children.iter().any(|c| c.name == name) {
                return Err(child.attribute_error("name", "is given twice"));
            }
            children.push(Child { element: child, name, is_used: Cell::new(false) });
        }
        Ok(Self { element, kind, children, asked: RefCell::default() })
    }

    pub(super) fn unknown_type(&self, known: &str) -> SceneError {
        let near = suggestion(&self.kind, known.split([',', ';', ' ']).filter(|word| !word.is_empty()));
        let reason = format!("unknown type \"{}\"{near}; known here: {known}", self.kind);
        self.element.attribute_error("type", reason)
    }

    /// # Errors
    /// A child nobody asked for; all of them are kept, the last is returned.
    pub(super) fn finish(&self) -> Result<(), SceneError> {
        let owner = format!("<{} type=\"{}\">", self.element.tag(), self.kind);
        let mut last = Ok(());
        for child in self.children.iter().filter(|c| !c.is_used.get()) {
            let error = match child.name {
                Some(name) => {
                    let asked = self.asked.borrow();
                    let near = suggestion(name, asked.iter().map(String::as_str));
                    let error = child.element.error_of_use(format!("{owner} has no property \"{name}\"{near}"));
                    SceneError { attribute: Some("name".to_owned()), ..error }
                }
                None => child.element.error_of_use(format!("is not expected, or not once more, inside {owner}")),
            };
            if let Err(error) = self.element.instead(error, "ignored", || ()) {
                self.element.context.sink.error(error.clone());
                last = Err(error);
            }
        }
        last
    }

    /// Properties that Mitsuba knows and that have no effect here; what is given of them becomes a note with the reason.
    pub(super) fn ignore(&self, names: &[&str], reason: &str) {
        for name in names {
            if let Some(element) = self.get(name) {
                element.ignored(format!("has no effect here: {reason}"));
            }
        }
    }

    /// Properties that change nothing in the picture meant, in Mitsuba either: nothing is said of them.
    pub(super) fn skip(&self, names: &[&str]) {
        for name in names {
            self.get(name);
        }
    }

    /// The same for all that nobody asked for.
    pub(super) fn skip_rest(&self) {
        self.children.iter().for_each(|child| child.is_used.set(true));
    }

    /// The named child.
    pub(super) fn get(&self, name: &str) -> Option<Element<'a>> {
        let child = self.children.iter().find(|c| c.name == Some(name));
        if child.is_none() && !self.asked.borrow().contains(name) {
            self.asked.borrow_mut().insert(name.to_owned());
        }
        let child = child?;
        child.is_used.set(true);
        Some(child.element)
    }

    fn value(&self, name: &str, tags: &[&str], attributes: &[&str]) -> Result<Option<Element<'a>>, SceneError> {
        let Some(element) = self.get(name) else { return Ok(None) };
        if !tags.contains(&element.tag()) {
            return Err(element.error(format!("\"{name}\" must be a <{}>", tags.join("> or <"))));
        }
        element.allow(attributes)?;
        element.no_children()?;
        Ok(Some(element))
    }

    /// A number, and the element that holds it.
    pub(super) fn number(&self, name: &str) -> Result<Option<(f64, Element<'a>)>, SceneError> {
        self.value(name, &["float", "integer"], &["name", "value"])?.map(|e| Ok((e.number("value")?, e))).transpose()
    }

    /// A number that must lie in a range.
    pub(super) fn number_in(
        &self,
        name: &str,
        default: f64,
        range: core::ops::RangeInclusive<f64>,
    ) -> Result<f64, SceneError> {
        let Some((value, element)) = self.number(name)? else { return Ok(default) };
        if !range.contains(&value) {
            let (low, high) = (range.start(), range.end());
            return Err(element.attribute_error("value", format!("{value} is outside [{low}, {high}]")));
        }
        Ok(value)
    }

    /// A number above 0.
    pub(super) fn positive(&self, name: &str, default: f64) -> Result<f64, SceneError> {
        match self.number(name)? {
            None => Ok(default),
            Some((value, _)) if value > 0.0 => Ok(value),
            Some((value, element)) => Err(element.attribute_error("value", format!("{value} must be greater than 0"))),
        }
    }

    /// A whole number in a range.
    pub(super) fn integer(
        &self,
        name: &str,
        default: i64,
        range: core::ops::RangeInclusive<i64>,
    ) -> Result<i64, SceneError> {
        let Some(element) = self.value(name, &["integer"], &["name", "value"])? else { return Ok(default) };
        let text = element.required("value")?;
        let value: i64 = text
            .trim()
            .parse()
            .map_err(|_| element.attribute_error("value", format!("\"{text}\" is not a whole number")))?;
        if !range.contains(&value) {
            let (low, high) = (range.start(), range.end());
            return Err(element.attribute_error("value", format!("{value} is outside [{low}, {high}]")));
        }
        Ok(value)
    }

    pub(super) fn boolean(&self, name: &str, default: bool) -> Result<bool, SceneError> {
        let Some(element) = self.value(name, &["boolean"], &["name", "value"])? else { return Ok(default) };
        match element.required("value")?.trim() {
            yes if yes.eq_ignore_ascii_case("true") => Ok(true),
            no if no.eq_ignore_ascii_case("false") => Ok(false),
            other => Err(element.attribute_error("value", format!("\"{other}\" is neither true nor false"))),
        }
    }

    pub(super) fn string(&self, name: &str) -> Result<Option<(String, Element<'a>)>, SceneError> {
        self.value(name, &["string"], &["name", "value"])?.map(|e| Ok((e.required("value")?, e))).transpose()
    }

    /// One of several words; the first is the default.
    pub(super) fn word(&self, name: &str, known: &[&'static str]) -> Result<&'static str, SceneError> {
        let first = known.first().copied().unwrap_or_default();
        let Some((value, element)) = self.string(name)? else { return Ok(first) };
        known.iter().copied().find(|w| *w == value).ok_or_else(|| {
            let near = suggestion(&value, known.iter().copied());
            element.attribute_error("value", format!("\"{value}\"{near} is none of: {}", known.join(", ")))
        })
    }

    /// The path in a string, relative to the scene file, and the element that holds it.
    pub(super) fn path(&self, name: &str) -> Result<(PathBuf, Element<'a>), SceneError> {
        let (value, element) =
            self.string(name)?.ok_or_else(|| self.element.error(format!("<string name=\"{name}\"> is missing")))?;
        Ok((element.resolve(&value), element))
    }

    /// A colour or number that is not negative, and the element that holds it.
    pub(super) fn colour(&self, name: &str) -> Result<Option<(Spectrum, Element<'a>)>, SceneError> {
        self.colour_as(name, Role::Coefficient)
    }

    /// The same for light that something sends out.
    pub(super) fn emission(&self, name: &str) -> Result<Option<(Spectrum, Element<'a>)>, SceneError> {
        self.colour_as(name, Role::Light)
    }

    fn colour_as(&self, name: &str, role: Role) -> Result<Option<(Spectrum, Element<'a>)>, SceneError> {
        let Some(element) = self.get(name) else { return Ok(None) };
        let colour = if element.tag() == "spectrum" {
            spectra::read(&element, role)?
        } else {
            self.value(name, &["rgb", "float", "integer", "spectrum"], &["name", "value"])?;
            if element.tag() == "rgb" { element.colour()? } else { Spectrum::splat(element.number("value")? as f32) }
        };
        if let Some(negative) = colour.0.iter().find(|c| **c < 0.0) {
            return Err(element.attribute_error("value", format!("{negative} is negative")));
        }
        Ok(Some((colour, element)))
    }

    /// A colour within [0, 1].
    pub(super) fn share(&self, name: &str, default: Spectrum) -> Result<Spectrum, SceneError> {
        match self.colour(name)? {
            None => Ok(default),
            Some((colour, element)) => is_share(colour, &element),
        }
    }

    fn triple(&self, name: &str) -> Result<Option<[f64; 3]>, SceneError> {
        let Some(element) = self.value(name, &["point", "vector"], &["name", "value", "x", "y", "z"])? else {
            return Ok(None);
        };
        element.xyz(0.0, true).map(Some)
    }

    /// Data that stand in the scene file itself.
    pub(super) fn inline(&self) -> Result<Option<&'a Inline>, SceneError> {
        let Some(element) = self.get("inline") else { return Ok(None) };
        let index = element.number("value")?;
        let found = self.element.context.tree.inline.get(index as usize).filter(|_| index >= 0.0);
        found.map(Some).ok_or_else(|| element.error("there are no data in this file"))
    }

    /// A point or vector, if given.
    pub(super) fn point(&self, name: &str) -> Result<Option<[f64; 3]>, SceneError> {
        self.triple(name)
    }

    /// Three numbers of any sign as a colour, or one for all of them.
    pub(super) fn point_or_number(&self, name: &str) -> Result<Option<Spectrum>, SceneError> {
        let Some(element) = self.get(name) else { return Ok(None) };
        match element.tag() {
            "point" | "vector" => Ok(self.triple(name)?.map(|v| Spectrum(v.map(|c| c as f32)))),
            _ => Ok(self.colour(name)?.map(|(value, _)| value)),
        }
    }

    /// A transform, if given.
    pub(super) fn transform(&self, name: &str) -> Result<Option<Transform>, SceneError> {
        let Some(element) = self.get(name) else { return Ok(None) };
        if element.tag() != "transform" {
            return Err(element.error(format!("\"{name}\" must be a <transform>")));
        }
        transforms::read(&element).map(Some)
    }

    /// The transform `to_world`, if given, and the element that holds it.
    pub(super) fn to_world(&self) -> Result<Option<(Transform, Element<'a>)>, SceneError> {
        let Some(element) = self.get("to_world") else { return Ok(None) };
        if element.tag() != "transform" {
            return Err(element.error("\"to_world\" must be a <transform>"));
        }
        Ok(Some((transforms::read(&element)?, element)))
    }

    /// The next nested object with the tag. Names that Mitsuba leaves to the author
    /// (`<phase name="first">`, `<ref name="bsdf">`) do not matter; those with a meaning
    /// (`interior`) are asked for by name before.
    pub(super) fn nested(&self, tag: &str) -> Option<Element<'a>> {
        let child = self.children.iter().find(|c| !c.is_used.get() && c.element.tag() == tag)?;
        child.is_used.set(true);
        Some(child.element)
    }
}

/// " (is \"width\" meant?)", if a known name is near to what is written.
pub(super) fn suggestion<'n>(written: &str, known: impl Iterator<Item = &'n str>) -> String {
    let near = |name: &str| strsim::jaro_winkler(written, name);
    let best = known.map(|name| (near(name), name)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(near, _)| *near > 0.85).map_or_else(String::new, |(_, name)| format!(" (is \"{name}\" meant?)"))
}

/// # Errors
/// A colour above 1. One that comes from a spectrum may be more saturated than sRGB has: it is cut off.
pub(super) fn is_share(colour: Spectrum, element: &Element<'_>) -> Result<Spectrum, SceneError> {
    if element.node.attribute("value").is_none_or(|value| value.contains(':')) && element.tag() == "spectrum" {
        return Ok(Spectrum(colour.0.map(|c| c.clamp(0.0, 1.0))));
    }
    match colour.0.iter().find(|c| !(0.0..=1.0).contains(*c)) {
        Some(outside) => Err(element.attribute_error("value", format!("{outside} is outside [0, 1]"))),
        None => Ok(colour),
    }
}
