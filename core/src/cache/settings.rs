//! How caches are filled and read: every number of the method.

use super::extrapolate::Extrapolation;
use super::eye::RaySettings;
use super::kind::Kind;
use super::lookup::Reading;
use super::photons::PhotonEffort;
use super::presets;
use super::radius::Limits;
use crate::math::float;
use crate::multiple_scatter;
use crate::path;
use crate::transmittance::thickness::Steps;

/// One cache's share of quality and effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// `ε` of J's Eq. 34: larger is coarser.
    pub tolerance: f32,
    /// Directions or random walks of each estimate of a record (more than one, because noise must not choose both radius and value:
    /// decision 13); fewer where it reaches less far than
    /// others do, in later ones up to eight times as many where they differ much or are bright, and beyond the second down to a sixteenth in the dark.
    pub samples: u32,
    /// Degree of the expansions; 0 in isotropic media and on surfaces.
    pub degree: usize,
    /// Bounds of radii in the world (m).
    pub limits: Limits,
    /// Greatest radius as a multiple of the distance to the nearest surface ([`clearance`](super::clearance)), wherever
    /// that is more than [`Settings::finest`] and [`Effort::limits`] allow it; infinite for no such bound.
    pub clearance: f32,
    /// Greatest radius in free paths `1/σₜ` of the medium at the record, for light scattered more than once in `1/(σₜ √(1 − g))`;
    /// infinite for no such bound. Larger: light near the borders of fog and near walls blurs. Smaller: records, by the cube.
    pub free_paths: f32,
}

impl Effort {
    /// For records that serve the making of others: tolerance and reach towards surfaces times a factor each, samples divided by a number.
    fn coarser(self, [tolerance, clearance]: [f32; 2], fewer: u32) -> Self {
        let samples = (self.samples / fewer).max(presets::LEAST_SAMPLES);
        Self { tolerance: tolerance * self.tolerance, clearance: clearance * self.clearance, samples, ..self }
    }

    /// The finer of both in every respect. Expansions keep their degree.
    pub(super) fn or_finer(self, other: &Self) -> Self {
        Self {
            tolerance: self.tolerance.min(other.tolerance),
            samples: self.samples.max(other.samples),
            degree: self.degree,
            limits: Limits { min: self.limits.min.min(other.limits.min), max: self.limits.max.min(other.limits.max) },
            clearance: self.clearance.min(other.clearance),
            free_paths: self.free_paths.min(other.free_paths),
        }
    }

    /// For records that may be off by `factor` times as much: noise falls with the root of samples, what extrapolation gets wrong with the square of radii.
    fn rougher(self, factor: f32) -> Self {
        if factor > 1.0 {
            let samples = (self.samples as f32 / (factor * factor)) as u32;
            Self {
                tolerance: self.tolerance * float::sqrt(factor),
                samples: samples.max(presets::LEAST_SAMPLES).min(self.samples),
                ..self
            }
        } else {
            self
        }
    }
}

/// How caches are filled and read.
///
/// ```
/// use fogbow::cache::{Effort, Kind, Limits, Settings};
/// let limits = Limits { min: 0.01, max: 1.0 };
/// let effort = Effort { tolerance: 0.5, samples: 1024, degree: 2, limits, clearance: 2.0, free_paths: 1.0 };
/// let settings = Settings { multiple: Some(effort), ..Settings::default() };
/// // Kinds that are not set are not cached.
/// assert_eq!(settings.effort(Kind::Multiple).unwrap().samples, 1024);
/// assert!(settings.effort(Kind::Single).is_none());
///
/// // Four times the walks halve the noise of records.
/// let mut finer = settings.with_walks(4096);
/// assert_eq!(finer.effort(Kind::Multiple).unwrap().samples, 4096);
/// finer.effort_mut(Kind::Multiple).unwrap().tolerance = 0.2;
/// assert_eq!(finer.reading(Kind::Multiple).unwrap().tolerance, 0.2);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// The relative error that pictures may have: pilots shrink radii until extrapolation leaves less than its part of it; 0 for no pilots.
    pub error: f32,
    /// How many times that error each kind may have of its own light, at least 1, in the order of [`Kind::ALL`]: a fill for a view finds what part of
    /// the picture a kind brings, and makes it for an error of its own. Where it brings more in a region of the picture, its records reach less far.
    pub coarser: [f32; Kind::COUNT],
    /// Light of the lights, scattered once; `None` to leave it to connections.
    pub single: Option<Effort>,
    /// Light of surfaces, scattered once.
    pub surface: Option<Effort>,
    /// Light scattered more than once.
    pub multiple: Option<Effort>,
    /// Indirect irradiance on surfaces.
    pub irradiance: Option<Effort>,
    /// How photons light the cells that walks end at; `None` for walks that go on.
    pub photons: Option<PhotonEffort>,
    /// How records are carried to other points.
    pub extrapolation: Extrapolation,
    /// Eye rays that say where records are needed.
    pub rays: u32,
    /// Share of every radius that spheres overlap by.
    pub margin: f32,
    /// Least and greatest radius in pixels. Records brighter than usual may reach less far, down to a third.
    pub pixels: [f32; 2],
    /// Records computed per round at most. Part of the result: larger rounds know less of each other.
    pub round: u32,
    /// How eye rays look at the world.
    pub eye: RaySettings,
    /// How random walks are made, and light marched to.
    pub walk: multiple_scatter::Settings,
    /// How paths are traced where nothing is cached.
    pub paths: path::Settings,
    /// Samples of every light with extent for a record of single scattering.
    pub light_samples: u32,
    /// Length (m) below which changes of light are noise: see [`Estimator::finest`](super::Estimator::finest).
    pub finest: f32,
    /// Changes all random numbers.
    pub seed: u64,
}

impl Default for Settings {
    /// No caches; what else is good for pictures of a world some metres large.
    fn default() -> Self {
        Self {
            error: 0.0,
            coarser: [1.0; Kind::COUNT],
            single: None,
            surface: None,
            multiple: None,
            irradiance: None,
            photons: None,
            extrapolation: Extrapolation::default(),
            rays: LEAST_RAYS,
            margin: 0.15,
            pixels: [1.5, 64.0],
            round: 64,
            eye: RaySettings::default(),
            walk: multiple_scatter::Settings {
                lengths: multiple_scatter::Lengths::Marched,
                ..multiple_scatter::Settings::new(Steps::Length(0.03))
            },
            paths: path::Settings::default(),
            light_samples: 16,
            finest: 0.01,
            seed: 0,
        }
    }
}

/// Eye rays of a fill at least, and at most: fewer, and small things in sight have no records; more, and places take
/// memory that pictures do not repay.
pub(super) const LEAST_RAYS: u32 = 16384;

/// See [`LEAST_RAYS`].
pub(super) const MOST_RAYS: u32 = 131_072;

impl Settings {
    /// The effort of a kind, for the error that it may have; `None` if it is not cached.
    #[must_use]
    pub fn effort(&self, kind: Kind) -> Option<Effort> {
        self.asked(kind).map(|effort| effort.rougher(self.coarser[kind as usize]))
    }

    /// The effort of a kind as it is asked for, whatever part of a picture it brings.
    pub(super) fn asked(&self, kind: Kind) -> Option<Effort> {
        match kind {
            Kind::Single => self.single,
            Kind::Surface => self.surface,
            Kind::Multiple => self.multiple,
            Kind::Irradiance => self.irradiance,
            // What it gets wrong is what all else brings along, in a mean over many surfaces.
            Kind::CoarseIrradiance => self.irradiance.map(|e| e.coarser([3.0, presets::roughness(self.error)], 8)),
        }
    }

    /// How the cache of a kind is read; `None` if there is none.
    ///
    /// ```
    /// # use fogbow::cache::{Kind, Settings};
    /// assert_eq!(Settings::default().reading(Kind::Multiple), None);
    /// ```
    #[must_use]
    pub fn reading(&self, kind: Kind) -> Option<Reading> {
        // As asked for: caches that come from a file are read as those that were filled.
        let tolerance = self.asked(kind)?.tolerance;
        Some(Reading { extrapolation: self.extrapolation, ..Reading::new(tolerance) })
    }
}
