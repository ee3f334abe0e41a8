//! One computation over the whole core, so that its bits can be compared between targets: native,
//! WebAssembly, and a program without an allocator.
//!
//! Every section draws inputs from a seeded generator, runs a part of the core on them and folds
//! the bits of all results into one number. Equal numbers mean equal bits throughout.

#![no_std]

mod digest;
mod estimates;
pub mod lent;
mod media;
mod sections;
mod walks;

pub use digest::Digest;

/// A part of the core, computed over many inputs.
#[derive(Debug, Clone, Copy)]
pub struct Section {
    /// The module of the core it exercises.
    pub name: &'static str,
    /// Computes it and folds the bits of its results.
    pub run: fn(&mut Digest),
}

impl Section {
    /// The folded bits of all results.
    #[must_use]
    pub fn bits(&self) -> u64 {
        let mut digest = Digest::default();
        (self.run)(&mut digest);
        digest.bits()
    }
}

pub use sections::SECTIONS;

/// Writes one line per section: its name, a space, its bits in 16 hexadecimal digits.
///
/// # Errors
/// Those of the writer.
pub fn report(out: &mut impl core::fmt::Write) -> core::fmt::Result {
    SECTIONS.iter().try_for_each(|section| writeln!(out, "{} {:016x}", section.name, section.bits()))
}
