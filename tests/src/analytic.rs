//! Scenes whose answers are known.
