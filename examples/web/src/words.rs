//! Reading words: 32-bit integers and floats, as JavaScript has written them.

use alloc::string::{String, ToString};
use core::fmt::Display;

use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;

/// Why something cannot be done, in words for whoever asked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault(pub String);

impl<E: core::error::Error> From<E> for Fault {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

impl Fault {
    /// In so many words.
    pub fn new(words: impl Display) -> Self {
        Self(words.to_string())
    }

    /// The same, with the element first that is at fault.
    #[must_use]
    pub fn of(self, element: &str, number: usize) -> Self {
        Self(alloc::format!("{element} {number}: {}", self.0))
    }
}

/// Words that are left to be read.
#[derive(Debug, Clone, Copy)]
pub struct Words<'a>(&'a [u32]);

impl<'a> Words<'a> {
    /// All of them.
    #[must_use]
    pub fn new(all: &'a [u32]) -> Self {
        Self(all)
    }

    /// How many are left.
    #[must_use]
    pub fn left(&self) -> usize {
        self.0.len()
    }

    /// The next `count`.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn take(&mut self, count: usize) -> Result<&'a [u32], Fault> {
        let (taken, rest) =
            self.0.split_at_checked(count).ok_or_else(|| Fault::new("the description ends too soon"))?;
        self.0 = rest;
        Ok(taken)
    }

    /// An integer.
    ///
    /// # Errors
    /// None is left.
    pub fn integer(&mut self) -> Result<u32, Fault> {
        Ok(self.take(1)?[0])
    }

    /// Floats.
    ///
    /// # Errors
    /// Fewer are left.
    pub fn floats<const N: usize>(&mut self) -> Result<[f32; N], Fault> {
        let words = self.take(N)?;
        Ok(core::array::from_fn(|i| f32::from_bits(words[i])))
    }

    /// A float.
    ///
    /// # Errors
    /// None is left.
    pub fn float(&mut self) -> Result<f32, Fault> {
        Ok(self.floats::<1>()?[0])
    }

    /// A point or direction.
    ///
    /// # Errors
    /// Fewer words are left.
    pub fn vector(&mut self) -> Result<Vec3, Fault> {
        Ok(self.floats()?.into())
    }

    /// A colour.
    ///
    /// # Errors
    /// Fewer words are left.
    pub fn colour(&mut self) -> Result<Spectrum, Fault> {
        Ok(Spectrum(self.floats()?))
    }
}
