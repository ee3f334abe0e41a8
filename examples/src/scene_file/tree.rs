//! The elements of a scene after everything between files is done: inclusion, parameters, aliases.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::mesh::Mesh;
use crate::picture::Picture;
use crate::volume::Volume;

/// Which element of a tree: its place in the order in which they were read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct NodeId(pub(super) u32);

/// A file that elements came from.
#[derive(Debug)]
pub(super) struct Source {
    /// Its path.
    pub(super) path: PathBuf,
    /// Folders that hold what it names, the first to be searched first.
    pub(super) folders: Vec<PathBuf>,
}

/// An attribute as the file has it, with `$name` replaced.
#[derive(Debug)]
pub(super) struct Attribute {
    name: String,
    value: String,
}

impl Attribute {
    pub(super) fn new(name: &str, value: String) -> Self {
        Self { name: name.to_owned(), value }
    }

    pub(super) fn name(&self) -> &str {
        &self.name
    }

    pub(super) fn value(&self) -> &str {
        &self.value
    }
}

/// An element.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) id: NodeId,
    pub(super) tag: String,
    pub(super) attributes: Vec<Attribute>,
    pub(super) children: Vec<NodeId>,
    /// Text between its children, which has no meaning anywhere.
    pub(super) text: Option<String>,
    /// Index of its file.
    pub(super) source: u32,
    /// Line in that file, counted from 1.
    pub(super) line: u32,
}

impl Node {
    pub(super) fn id(&self) -> NodeId {
        self.id
    }

    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|a| a.name == name).map(Attribute::value)
    }

    pub(super) fn has_attribute(&self, name: &str) -> bool {
        self.attribute(name).is_some()
    }

    pub(super) fn attributes(&self) -> impl Iterator<Item = &Attribute> {
        self.attributes.iter()
    }

    pub(super) fn set(&mut self, name: &str, value: String) {
        match self.attributes.iter_mut().find(|a| a.name == name) {
            Some(attribute) => attribute.value = value,
            None => self.attributes.push(Attribute::new(name, value)),
        }
    }
}

/// All elements; the first is `<scene>`.
#[derive(Debug, Default)]
pub(super) struct Tree {
    pub(super) nodes: Vec<Node>,
    pub(super) sources: Vec<Source>,
    /// Elements by id, aliases among them.
    pub(super) ids: HashMap<String, NodeId>,
    /// What elements hold that have no file: `<integer name="inline">` is the index.
    pub(super) inline: Vec<Inline>,
}

/// Data that stand in the scene file itself.
#[derive(Debug)]
pub(super) enum Inline {
    Mesh(Mesh),
    Volume(Volume),
    Picture(Picture),
}

impl Tree {
    pub(super) fn node(&self, id: NodeId) -> &Node {
        &self.nodes[id.0 as usize]
    }

    pub(super) fn node_mut(&mut self, id: NodeId) -> &mut Node {
        &mut self.nodes[id.0 as usize]
    }

    pub(super) fn root(&self) -> &Node {
        self.node(NodeId(0))
    }

    /// The file of an element.
    pub(super) fn file(&self, node: &Node) -> &Path {
        &self.sources[node.source as usize].path
    }

    /// A path as an element names it: in the folders of its own file, then in those of the scene file; the
    /// first of them where it is in none.
    pub(super) fn resolve(&self, node: &Node, name: &str) -> PathBuf {
        let own = &self.sources[node.source as usize].folders;
        let folders = || own.iter().chain(self.sources.first().into_iter().flat_map(|s| &s.folders));
        let there = folders().map(|folder| folder.join(name)).find(|path| path.exists());
        there.or_else(|| Some(folders().next()?.join(name))).unwrap_or_else(|| PathBuf::from(name))
    }
}
