//! From files to one tree: `<include>`, `<path>`, `<default>` and `$name`, `<alias>`, references that lead nowhere or in
//! circles, and the upgrade of old files. What reads the tree sees none of these.
//!
//! Follows what Mitsuba 3 does with XML: parameters hold from where they are first given; an included file sees and adds to those
//! of the file it stands in; `<path>` is searched before the folder of the file.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::notes::{NoteKind, Sink};
use super::tree::{Attribute, Node, NodeId, Source, Tree};
use super::upgrade;
use crate::error::{SceneError, read_file};

/// Most elements and attributes of a file: far more than any scene written by hand or exported
/// with its meshes beside it.
const MAX_NODES: u32 = 2_000_000;
/// Elements within elements.
const MAX_NESTING: usize = 64;
/// Files within files, as in Mitsuba 3.
const MAX_DEPTH: usize = 15;
/// Most files: a small file that includes another a thousand times, and that a third, would otherwise fill all memory.
const MAX_FILES: usize = 10_000;

/// Reads a scene file and what it includes.
pub(super) fn read(file: &Path, text: &str, parameters: &[(String, String)], sink: &Sink) -> Result<Tree, SceneError> {
    let mut reader =
        Reader { tree: Tree::default(), parameters: HashMap::new(), pending: Vec::new(), nesting: 0, sink };
    for (name, value) in parameters {
        reader.parameters.insert(name.clone(), value.clone());
    }
    let folder = file.parent().unwrap_or(Path::new("")).to_owned();
    reader.file(file, text, vec![folder], None, 0)?;
    reader.late_parameters();
    check_references(&reader.tree, sink)?;
    Ok(reader.tree)
}

/// The text of a scene file.
pub(super) fn text_of(file: &Path) -> Result<String, SceneError> {
    let whole = |reason: String| file_error(file, None, reason);
    let is_volume =
        |extension: &std::ffi::OsStr| ["vdb", "nvdb", "vol"].iter().any(|e| extension.eq_ignore_ascii_case(e));
    if file.extension().is_some_and(is_volume) {
        return Err(whole(
            "is a volume, no scene: name it in a fog file (shape = \"grid\") beside a glTF scene, or in a medium of a Mitsuba scene"
                .to_owned(),
        ));
    }
    let bytes = read_file(file).map_err(|e| whole(e.reason))?;
    String::from_utf8(bytes).map_err(|e| whole(format!("is not UTF-8 text: {e}")))
}

fn file_error(file: &Path, line: Option<u32>, reason: String) -> SceneError {
    SceneError { file: file.to_owned(), line, reason, ..SceneError::default() }
}

fn document<'a>(file: &Path, text: &'a str) -> Result<roxmltree::Document<'a>, SceneError> {
    let options = roxmltree::ParsingOptions { nodes_limit: MAX_NODES, ..Default::default() };
    roxmltree::Document::parse_with_options(text, options)
        .map_err(|e| file_error(file, Some(e.pos().row), format!("is not well-formed XML: {e}")))
}

struct Reader<'s> {
    tree: Tree,
    parameters: HashMap<String, String>,
    /// Attributes that name a parameter before it is given.
    pending: Vec<(NodeId, usize)>,
    /// Elements around the one that is read.
    nesting: usize,
    sink: &'s Sink,
}

/// A file whose elements are being added.
struct Place {
    /// Index of the file.
    source: u32,
    /// Where its lines start.
    lines: Vec<usize>,
    depth: usize,
    is_old: bool,
}

impl Place {
    fn line(&self, node: roxmltree::Node<'_, '_>) -> u32 {
        self.lines.partition_point(|start| *start <= node.range().start) as u32
    }
}

impl Reader<'_> {
    /// Adds the elements of a file as children of `parent`: those inside `<scene>`, or its outermost one, with the
    /// given name. Without a parent it becomes the root.
    fn file(
        &mut self,
        file: &Path,
        text: &str,
        folders: Vec<PathBuf>,
        parent: Option<(NodeId, Option<&str>)>,
        depth: usize,
    ) -> Result<(), SceneError> {
        let document = document(file, text)?;
        let source = self.tree.sources.len() as u32;
        self.tree.sources.push(Source { path: file.to_owned(), folders });
        let lines = core::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        let mut place = Place { source, lines, depth, is_old: false };
        let root = document.root_element();
        let version = self.version(root, &place)?;
        place.is_old = version.starts_with('0');
        match parent {
            Some((parent, _)) if root.has_tag_name("scene") => self.children(root, parent, &place),
            Some((parent, name)) => self.element(root, parent, &place, name),
            None if root.has_tag_name("scene") => {
                let id = self.add(root, &place)?;
                self.children(root, id, &place)
            }
            None => Err(self.error(root, &place, "the outermost element must be <scene>")),
        }
    }

    fn version<'a>(&self, root: roxmltree::Node<'a, '_>, place: &Place) -> Result<&'a str, SceneError> {
        let error =
            |reason: String| SceneError { attribute: Some("version".to_owned()), ..self.error(root, place, reason) };
        let version = root.attribute("version").ok_or_else(|| error("is missing".to_owned()))?;
        let is_known = ["3.", "2.", "0.5", "0.6"].iter().any(|known| version.starts_with(known));
        if is_known {
            Ok(version)
        } else {
            Err(error(format!("\"{version}\" is not known; 3.0.0, 2.0.0 and 0.6.0 are")))
        }
    }

    fn error(&self, node: roxmltree::Node<'_, '_>, place: &Place, reason: impl core::fmt::Display) -> SceneError {
        let label = label(node.tag_name().name(), |key| node.attribute(key));
        let source = &self.tree.sources[place.source as usize];
        let element = SceneError { element: label, ..file_error(&source.path, Some(place.line(node)), String::new()) };
        SceneError { reason: reason.to_string(), ..element }
    }

    fn attribute_error(
        &self,
        node: roxmltree::Node<'_, '_>,
        place: &Place,
        attribute: &str,
        reason: impl core::fmt::Display,
    ) -> SceneError {
        SceneError { attribute: Some(attribute.to_owned()), ..self.error(node, place, reason) }
    }

    /// Adds an element without its children.
    fn add(&mut self, node: roxmltree::Node<'_, '_>, place: &Place) -> Result<NodeId, SceneError> {
        if let Some(namespace) = node.tag_name().namespace() {
            return Err(self.error(node, place, format!("unknown namespace \"{namespace}\"")));
        }
        if self.tree.nodes.len() >= MAX_NODES as usize {
            return Err(self.error(node, place, format!("more than {MAX_NODES} elements")));
        }
        let id = NodeId(self.tree.nodes.len() as u32);
        let mut attributes = Vec::new();
        let is_included = node == node.document().root_element() && !node.has_tag_name("scene");
        for attribute in node.attributes().filter(|a| !(is_included && a.name() == "version")) {
            let value = match self.substitute(attribute.value()) {
                Ok(value) => value,
                Err(_) => {
                    self.pending.push((id, attributes.len()));
                    attribute.value().to_owned()
                }
            };
            attributes.push(Attribute::new(attribute.name(), value));
        }
        let is_text = |n: &roxmltree::Node<'_, '_>| n.is_text() && !n.text().unwrap_or_default().trim().is_empty();
        let text = node.children().find(is_text);
        let text = text.map(|n| n.text().unwrap_or_default().trim().chars().take(20).collect());
        let tag = node.tag_name().name().to_owned();
        let line = place.line(node);
        let mut added = Node { id, tag, attributes, children: Vec::new(), text, source: place.source, line };
        if place.is_old {
            upgrade::element(&mut added);
        }
        if added.tag != "ref"
            && added.tag != "alias"
            && let Some(name) = added.attribute("id")
        {
            if let Some(first) = self.tree.ids.get(name) {
                let first = self.tree.node(*first);
                let (file, line) = (self.tree.file(first).display(), first.line);
                let reason = format!("\"{name}\" is used twice, first at {file}:{line}");
                return Err(self.attribute_error(node, place, "id", reason));
            }
            self.tree.ids.insert(name.to_owned(), id);
        }
        self.tree.nodes.push(added);
        Ok(id)
    }

    fn children(&mut self, node: roxmltree::Node<'_, '_>, id: NodeId, place: &Place) -> Result<(), SceneError> {
        self.nesting += 1;
        if self.nesting > MAX_NESTING {
            return Err(self.error(node, place, format!("elements are nested more than {MAX_NESTING} deep")));
        }
        for child in node.children().filter(roxmltree::Node::is_element) {
            self.element(child, id, place, None)?;
        }
        self.nesting -= 1;
        if place.is_old {
            upgrade::properties(&mut self.tree, id);
        }
        Ok(())
    }

    /// Adds an element and all inside it; what acts on the reading itself is done and gone.
    fn element(
        &mut self,
        node: roxmltree::Node<'_, '_>,
        parent: NodeId,
        place: &Place,
        name: Option<&str>,
    ) -> Result<(), SceneError> {
        let result = match node.tag_name().name() {
            "include" => self.include(node, parent, place),
            "default" => self.default(node, place),
            "path" => self.path(node, parent, place),
            "alias" => self.alias(node, place),
            _ => {
                let id = self.add(node, place)?;
                if let Some(name) = name {
                    self.tree.node_mut(id).set("name", name.to_owned());
                }
                self.tree.node_mut(parent).children.push(id);
                return self.children(node, id, place);
            }
        };
        // Reading goes on after these, so that all that is wrong is found at once.
        if let Err(error) = result {
            self.sink.error(error);
        }
        Ok(())
    }

    /// The attributes of an element that acts on the reading.
    fn arguments<const N: usize>(
        &self,
        node: roxmltree::Node<'_, '_>,
        place: &Place,
        names: [&str; N],
    ) -> Result<[String; N], SceneError> {
        if let Some(unknown) = node.attributes().find(|a| !names.contains(&a.name()) && a.name() != "name") {
            return Err(self.attribute_error(node, place, unknown.name(), "is not known here"));
        }
        if let Some(child) = node.children().find(roxmltree::Node::is_element) {
            return Err(self.error(child, place, format!("is not expected inside <{}>", node.tag_name().name())));
        }
        let mut values = names.map(|_| String::new());
        for (value, name) in values.iter_mut().zip(names) {
            let written = node.attribute(name).ok_or_else(|| self.attribute_error(node, place, name, "is missing"))?;
            *value = self.substitute(written).map_err(|missing| self.attribute_error(node, place, name, missing))?;
        }
        Ok(values)
    }

    fn include(&mut self, node: roxmltree::Node<'_, '_>, parent: NodeId, place: &Place) -> Result<(), SceneError> {
        let [filename] = self.arguments(node, place, ["filename"])?;
        let fail = |reader: &Self, reason: String| reader.attribute_error(node, place, "filename", reason);
        if place.depth >= MAX_DEPTH {
            return Err(fail(self, format!("files are included more than {MAX_DEPTH} deep")));
        }
        if self.tree.sources.len() >= MAX_FILES {
            return Err(fail(self, format!("more than {MAX_FILES} files are included")));
        }
        let file = self.find(place, &filename);
        let text = text_of(&file).map_err(|e| fail(self, e.to_string()))?;
        let mut folders = vec![file.parent().unwrap_or(Path::new("")).to_owned()];
        folders.extend(self.tree.sources[place.source as usize].folders.iter().cloned());
        self.file(&file, &text, folders, Some((parent, node.attribute("name"))), place.depth + 1)
    }

    /// A path as a file names it: in the first folder that holds it.
    fn find(&self, place: &Place, name: &str) -> PathBuf {
        let folders = &self.tree.sources[place.source as usize].folders;
        let there = folders.iter().map(|folder| folder.join(name)).find(|path| path.exists());
        there.unwrap_or_else(|| folders.first().map_or_else(|| PathBuf::from(name), |folder| folder.join(name)))
    }

    fn default(&mut self, node: roxmltree::Node<'_, '_>, place: &Place) -> Result<(), SceneError> {
        let [name, value] = self.arguments(node, place, ["name", "value"])?;
        if name.is_empty() {
            return Err(self.attribute_error(node, place, "name", "is empty"));
        }
        self.parameters.entry(name).or_insert(value);
        Ok(())
    }

    fn path(&mut self, node: roxmltree::Node<'_, '_>, parent: NodeId, place: &Place) -> Result<(), SceneError> {
        let [value] = self.arguments(node, place, ["value"])?;
        if parent != NodeId(0) {
            return Err(self.error(node, place, "must stand directly inside <scene>"));
        }
        let folder = self.find(place, &value);
        if !folder.is_dir() {
            return Err(self.attribute_error(node, place, "value", format!("there is no folder {}", folder.display())));
        }
        self.tree.sources[place.source as usize].folders.insert(0, folder);
        Ok(())
    }

    fn alias(&mut self, node: roxmltree::Node<'_, '_>, place: &Place) -> Result<(), SceneError> {
        let [id, name] = self.arguments(node, place, ["id", "as"])?;
        let Some(meant) = self.tree.ids.get(&id).copied() else {
            return Err(self.attribute_error(node, place, "id", format!("nothing before it has the id \"{id}\"")));
        };
        if self.tree.ids.contains_key(&name) {
            return Err(self.attribute_error(node, place, "as", format!("\"{name}\" is used twice")));
        }
        self.tree.ids.insert(name, meant);
        Ok(())
    }

    /// Text with `$name` replaced, and `\$` by `$`.
    ///
    /// # Errors
    /// What is wrong with a `$name` that is not known.
    fn substitute(&self, written: &str) -> Result<String, String> {
        if !written.contains('$') {
            return Ok(written.to_owned());
        }
        let mut value = String::new();
        let mut rest = written;
        while let Some(at) = rest.find('$') {
            let (before, after) = (&rest[..at], &rest[at + 1..]);
            if let Some(kept) = before.strip_suffix('\\') {
                value.push_str(kept);
                value.push('$');
                rest = after;
                continue;
            }
            value.push_str(before);
            let end = after.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(after.len());
            let word = &after[..end];
            // The longest known beginning counts, as in "$namefile" where "name" is known.
            let known = (1..=word.len()).rev().find_map(|n| Some((n, self.parameters.get(word.get(..n)?)?)));
            let Some((length, replacement)) = known else {
                return Err(format!("${word} has no <default> and is not given by -D {word}=VALUE"));
            };
            value.push_str(replacement);
            rest = &after[length..];
        }
        value.push_str(rest);
        Ok(value)
    }

    /// Parameters that are given only after they are used, as in files that include what completes them.
    fn late_parameters(&mut self) {
        for (id, index) in core::mem::take(&mut self.pending) {
            let node = self.tree.node(id);
            let Some(attribute) = node.attributes.get(index) else { continue };
            let name = attribute.name().to_owned();
            let error =
                |reason: &str| SceneError { attribute: Some(name.clone()), ..error_at(&self.tree, node, reason) };
            match self.substitute(attribute.value()) {
                Ok(value) => {
                    let reason = format!("\"{}\" is given only further down, which Mitsuba refuses", attribute.value());
                    self.sink.note(NoteKind::Suspicious, error(&reason));
                    self.tree.node_mut(id).set(&name, value);
                }
                Err(missing) => self.sink.error(error(&missing)),
            }
        }
    }
}

/// An element as errors show it, shortened to what identifies it.
pub(super) fn label<'a>(tag: &str, attribute: impl Fn(&'static str) -> Option<&'a str>) -> String {
    let mut label = format!("<{tag}");
    for key in ["type", "name", "id"] {
        if let Some(value) = attribute(key) {
            label.push_str(&format!(" {key}=\"{value}\""));
        }
    }
    label.push('>');
    label
}

/// An error of an element of the tree.
pub(super) fn error_at(tree: &Tree, node: &Node, reason: impl core::fmt::Display) -> SceneError {
    SceneError {
        file: tree.file(node).to_owned(),
        line: Some(node.line),
        element: label(&node.tag, |key| node.attribute(key)),
        reason: reason.to_string(),
        ..SceneError::default()
    }
}

/// Every `<ref>` must lead to an element, and no way along references back to where it began. What leads nowhere is
/// an error of its own each; circles end the reading.
pub(super) fn check_references(tree: &Tree, sink: &Sink) -> Result<(), SceneError> {
    for node in tree.nodes.iter().filter(|n| n.tag == "ref") {
        let error = |attribute: &str, reason: String| {
            sink.error(SceneError { attribute: Some(attribute.to_owned()), ..error_at(tree, node, reason) });
        };
        if let Some(unknown) = node.attributes().find(|a| !["name", "id"].contains(&a.name())) {
            error(unknown.name(), "is not known here".to_owned());
        }
        if let Some(child) = node.children.first() {
            sink.error(error_at(tree, tree.node(*child), "is not expected inside <ref>"));
        }
        match node.attribute("id") {
            None => error("id", "is missing".to_owned()),
            Some(id) if !tree.ids.contains_key(id) => {
                let near = super::plugin::suggestion(id, tree.ids.keys().map(String::as_str));
                error("id", format!("nothing has the id \"{id}\"{near}"));
            }
            Some(_) => {}
        }
    }
    // Depth first without recursion: the elements on the way down are those in `begun` but not in `done`.
    const NEW: u8 = 0;
    const BEGUN: u8 = 1;
    const DONE: u8 = 2;
    let mut state = vec![NEW; tree.nodes.len()];
    let mut stack = vec![NodeId(0)];
    while let Some(&id) = stack.last() {
        let index = id.0 as usize;
        if state[index] != NEW {
            state[index] = DONE;
            stack.pop();
            continue;
        }
        state[index] = BEGUN;
        let node = tree.node(id);
        let target = if node.tag == "ref" { node.attribute("id").and_then(|id| tree.ids.get(id)) } else { None };
        for next in node.children.iter().chain(target) {
            match state[next.0 as usize] {
                BEGUN => return Err(error_at(tree, node, "leads back to itself")),
                NEW => stack.push(*next),
                _ => {}
            }
        }
    }
    Ok(())
}
