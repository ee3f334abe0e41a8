//! What readers have to say beside the scene: notes, and everything that is wrong.

use core::cell::RefCell;
use core::fmt;

use crate::error::SceneError;

/// Something a user should know of a scene that is read all the same. Reads like a [`SceneError`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// Why it was written.
    pub kind: NoteKind,
    /// Where and what.
    pub text: SceneError,
}

/// Why a note was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoteKind {
    /// A property has no effect here.
    Ignored,
    /// Something looks like a mistake.
    Suspicious,
    /// Something is missing here, and the nearest there is stands in its place.
    Replaced,
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.text.fmt(f)
    }
}

/// Notes and errors of a scene while it is read.
#[derive(Debug, Default)]
pub(super) struct Sink {
    /// Whether what is missing may be replaced.
    pub(super) is_lenient: bool,
    notes: RefCell<Vec<Note>>,
    errors: RefCell<Vec<SceneError>>,
}

impl Sink {
    pub(super) fn new(is_lenient: bool) -> Self {
        Self { is_lenient, ..Self::default() }
    }

    /// An element that is referred to twice says the same twice; once is enough.
    pub(super) fn note(&self, kind: NoteKind, text: SceneError) {
        let note = Note { kind, text };
        let mut notes = self.notes.borrow_mut();
        if !notes.contains(&note) {
            notes.push(note);
        }
    }

    /// Keeps an error, so that reading may go on and find further ones. The scene counts as broken.
    pub(super) fn error(&self, error: SceneError) {
        let mut errors = self.errors.borrow_mut();
        if !errors.contains(&error) {
            errors.push(error);
        }
    }

    /// The value, or nothing and a kept error.
    pub(super) fn keep<T>(&self, result: Result<T, SceneError>) -> Option<T> {
        result.map_err(|e| self.error(e)).ok()
    }

    /// For something that is missing here: where that is allowed, `nearest` in its place, and a note. `name` says what
    /// is done, as in "a pinhole instead" or "ignored".
    pub(super) fn instead<T>(
        &self,
        error: SceneError,
        name: &str,
        nearest: impl FnOnce() -> T,
    ) -> Result<T, SceneError> {
        if !self.is_lenient {
            return Err(SceneError { reason: format!("{} (--lenient: {name})", error.reason), ..error });
        }
        let reason = format!("{}: {name}", error.reason);
        self.note(NoteKind::Replaced, SceneError { reason, ..error });
        Ok(nearest())
    }

    pub(super) fn into_parts(self) -> (Vec<Note>, Vec<SceneError>) {
        (self.notes.into_inner(), self.errors.into_inner())
    }
}
