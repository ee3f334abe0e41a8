//! Folding of results into one number.

use fogbow::math::{Vec2, Vec3};
use fogbow::sampling::uniform::mix;
use fogbow::spectrum::{Gradient, Spectrum};

/// Folds values, in order, into 64 bits.
#[derive(Debug, Clone, Copy, Default)]
pub struct Digest {
    state: u64,
    count: u64,
}

impl Digest {
    /// The bits of everything so far.
    #[must_use]
    pub fn bits(&self) -> u64 {
        mix(self.state ^ self.count)
    }

    /// Folds an integer.
    pub fn int(&mut self, value: u64) {
        self.state = mix(self.state.rotate_left(5) ^ value);
        self.count += 1;
    }

    /// Folds a number. The payload of a NaN and the sign of a zero are left out: IEEE 754 lets
    /// `min` and `max` choose them freely.
    pub fn float(&mut self, value: f32) {
        let bits = if value.is_nan() { f32::NAN.to_bits() } else { (value + 0.0).to_bits() };
        self.int(u64::from(bits));
    }

    /// Folds a number of double width.
    pub fn double(&mut self, value: f64) {
        self.int(if value.is_nan() { f64::NAN.to_bits() } else { (value + 0.0).to_bits() });
    }

    /// Folds a point of a square.
    pub fn vec2(&mut self, value: Vec2) {
        value.to_array().into_iter().for_each(|x| self.float(x));
    }

    /// Folds a point or a direction.
    pub fn vec3(&mut self, value: Vec3) {
        value.to_array().into_iter().for_each(|x| self.float(x));
    }

    /// Folds a colour.
    pub fn spectrum(&mut self, value: Spectrum) {
        value.0.into_iter().for_each(|x| self.float(x));
    }

    /// Folds a gradient.
    pub fn gradient(&mut self, value: &Gradient) {
        [value.x, value.y, value.z].into_iter().for_each(|axis| self.spectrum(axis));
    }

    /// Folds a value that may be missing.
    pub fn option<T>(&mut self, value: Option<T>, fold: impl FnOnce(&mut Self, T)) {
        self.int(u64::from(value.is_some()));
        if let Some(value) = value {
            fold(self, value);
        }
    }
}
