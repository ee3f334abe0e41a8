//! Elements as a Mitsuba scene would have them, written from pbrt.

use std::path::{Path, PathBuf};

use super::super::tree::{Attribute, Inline, Node, NodeId, Source, Tree};
use crate::transform::Transform;

/// A tree that grows.
#[derive(Debug, Default)]
pub(super) struct Nodes {
    pub(super) tree: Tree,
    /// Where the directive stands that is read.
    pub(super) source: u32,
    pub(super) line: u32,
}

impl Nodes {
    /// The index of a file.
    pub(super) fn file(&mut self, path: &Path) -> u32 {
        let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
        self.tree.sources.push(Source { path: path.to_owned(), folders: vec![folder] });
        (self.tree.sources.len() - 1) as u32
    }

    pub(super) fn node(&mut self, tag: &str, attributes: &[(&str, &str)], children: Vec<NodeId>) -> NodeId {
        let id = NodeId(self.tree.nodes.len() as u32);
        let attributes = attributes.iter().map(|(name, value)| Attribute::new(name, (*value).to_owned())).collect();
        let (source, line) = (self.source, self.line);
        self.tree.nodes.push(Node { id, tag: tag.to_owned(), attributes, children, text: None, source, line });
        id
    }

    /// A thing with a type.
    pub(super) fn thing(&mut self, tag: &str, kind: &str, children: Vec<NodeId>) -> NodeId {
        self.node(tag, &[("type", kind)], children)
    }

    fn value(&mut self, tag: &str, name: &str, value: &str) -> NodeId {
        self.node(tag, &[("name", name), ("value", value)], Vec::new())
    }

    pub(super) fn float(&mut self, name: &str, value: f64) -> NodeId {
        self.value("float", name, &value.to_string())
    }

    pub(super) fn integer(&mut self, name: &str, value: i64) -> NodeId {
        self.value("integer", name, &value.to_string())
    }

    pub(super) fn boolean(&mut self, name: &str, value: bool) -> NodeId {
        self.value("boolean", name, if value { "true" } else { "false" })
    }

    pub(super) fn string(&mut self, name: &str, value: &str) -> NodeId {
        self.value("string", name, value)
    }

    pub(super) fn rgb(&mut self, name: &str, [r, g, b]: [f64; 3]) -> NodeId {
        self.value("rgb", name, &format!("{r}, {g}, {b}"))
    }

    pub(super) fn spectrum(&mut self, name: &str, samples: &[f64]) -> NodeId {
        let pairs: Vec<_> = samples.as_chunks::<2>().0.iter().map(|[w, v]| format!("{w}:{v}")).collect();
        self.value("spectrum", name, &pairs.join(", "))
    }

    pub(super) fn reference(&mut self, name: Option<&str>, id: &str) -> NodeId {
        match name {
            Some(name) => self.node("ref", &[("name", name), ("id", id)], Vec::new()),
            None => self.node("ref", &[("id", id)], Vec::new()),
        }
    }

    pub(super) fn transform(&mut self, name: &str, transform: &Transform) -> NodeId {
        let rows = transform.rows.iter().flatten().map(f64::to_string).collect::<Vec<_>>().join(" ");
        let matrix = self.node("matrix", &[("value", &format!("{rows} 0 0 0 1"))], Vec::new());
        self.node("transform", &[("name", name)], vec![matrix])
    }

    /// What has no file, as the child that leads to it.
    pub(super) fn inline(&mut self, what: Inline) -> NodeId {
        self.tree.inline.push(what);
        self.integer("inline", self.tree.inline.len() as i64 - 1)
    }

    /// Names an element, so that others may refer to it.
    pub(super) fn name(&mut self, node: NodeId, id: String) {
        self.tree.node_mut(node).set("id", id.clone());
        self.tree.ids.insert(id, node);
    }
}
