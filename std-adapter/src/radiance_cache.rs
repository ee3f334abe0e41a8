//! Filling radiance caches in parallel, in rounds whose result does not depend on the number of threads.
//!
//! | file | holds |
//! |---|---|
//! | this one | [`Settings`], [`RadianceCaches`] |
//! | `fill` | [`fill`]: in which order the caches are made, and what each is made of |
//! | `rounds` | where records are needed, rounds of new ones, better estimates for old ones |
//! | `file` | [`save`], [`load`] |

mod file;
mod fill;
mod rounds;

use fogbow::cache::{Cache, Caches, Extrapolation, Limits, Reader, Reading, SurfaceCache, VolumeCache};
use fogbow::sh::coefficient_count;

pub use file::{FileError, Problem, decode, encode, load, save};
pub use fill::{FillError, Outcome, fill};

/// One cache's share of quality and effort.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// `ε` of J's Eq. 34: larger is coarser.
    pub tolerance: f32,
    /// Directions or random walks of each of the two estimates of a record; fewer where it reaches less far than
    /// others do, and in the second up to four times as many where they differ much.
    pub samples: u32,
    /// Degree of the expansions; 0 in isotropic media and on surfaces.
    pub degree: usize,
    /// Bounds of radii in the world (m).
    pub limits: Limits,
    /// Greatest radius as a multiple of the distance to the nearest surface ([`clearance`]), wherever that is more
    /// than [`Estimator::finest`] and [`Effort::limits`] allow it; infinite for no such bound.
    ///
    /// [`clearance`]: fogbow::cache::clearance
    /// [`Estimator::finest`]: fogbow::cache::Estimator::finest
    pub clearance: f32,
}

impl Effort {
    /// For records that serve the making of others: tolerance times a factor, samples divided by a number.
    fn coarser(self, tolerance: f32, fewer: u32) -> Self {
        Self { tolerance: tolerance * self.tolerance, samples: (self.samples / fewer).max(16), ..self }
    }
}

/// How to fill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Light of the lights, scattered once; `None` to leave it to connections.
    pub single: Option<Effort>,
    /// Light of surfaces, scattered once.
    pub surface: Option<Effort>,
    /// Light scattered more than once.
    pub multiple: Option<Effort>,
    /// Indirect irradiance on surfaces.
    pub irradiance: Option<Effort>,
    /// How records are carried to other points.
    pub extrapolation: Extrapolation,
    /// Eye rays that say where records are needed.
    pub rays: u32,
    /// Share of every radius that spheres overlap by.
    pub margin: f32,
    /// Least and greatest radius in pixels.
    pub pixels: (f32, f32),
    /// Records computed per round at most. Part of the result: larger rounds know less of each other.
    pub round: u32,
    /// Number of threads; 0 for one per processor.
    pub threads: usize,
    /// Changes all random numbers.
    pub seed: u64,
}

impl Default for Settings {
    /// No caches; what else is good for pictures.
    fn default() -> Self {
        Self {
            single: None,
            surface: None,
            multiple: None,
            irradiance: None,
            extrapolation: Extrapolation::default(),
            rays: 16384,
            margin: 0.15,
            pixels: (1.5, 64.0),
            round: 64,
            threads: 0,
            seed: 0,
        }
    }
}

impl Settings {
    /// How a cache made with `effort` is read.
    #[must_use]
    pub fn reading(&self, effort: &Effort) -> Reading {
        Reading { extrapolation: self.extrapolation, ..Reading::new(effort.tolerance) }
    }

    /// Of the records on surfaces that light all other records.
    fn coarse_irradiance(&self) -> Option<Effort> {
        self.irradiance.map(|effort| effort.coarser(3.0, 8))
    }

    /// Of the records at which random walks of the final ones end: as fine, with an eighth of the samples. What they
    /// get wrong is what all walks bring along, more of it with every scattering, and in corners most: so none reaches past a
    /// surface. Final ones gain nothing by that.
    fn coarse_multiple(&self) -> Option<Effort> {
        self.multiple.map(|effort| Effort { clearance: effort.clearance.min(1.0), ..effort.coarser(1.0, 8) })
    }
}

/// Filled caches. They may be filled again for another view, and then gain what is missing.
#[derive(Debug)]
pub struct RadianceCaches {
    /// What they were filled with.
    pub settings: Settings,
    /// As [`Settings::single`].
    pub single: Option<VolumeCache<'static>>,
    /// As [`Settings::surface`].
    pub surface: Option<VolumeCache<'static>>,
    /// As [`Settings::multiple`].
    pub multiple: Option<VolumeCache<'static>>,
    /// As [`Settings::irradiance`].
    pub irradiance: Option<SurfaceCache<'static>>,
    /// Serves the making of [`RadianceCaches::multiple`] alone.
    pub coarse_multiple: Option<VolumeCache<'static>>,
    /// Serves the making of all others.
    pub coarse_irradiance: Option<SurfaceCache<'static>>,
    /// Marks of the views that were filled to the end: for them nothing is missing.
    pub views: Vec<u64>,
    /// Records that no fill will estimate again: coarse irradiance, light of surfaces, coarse multiple
    /// scattering, multiple scattering, irradiance.
    pub settled: [usize; 5],
}

/// Names of the caches, in the order of [`RadianceCaches::counts`].
pub const NAMES: [&str; 4] = ["single", "surface", "multiple", "irradiance"];

impl RadianceCaches {
    /// Empty caches.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let volume = |effort: Option<Effort>| effort.map(|e| Cache::growing(coefficient_count(e.degree) - 1));
        Self {
            settings,
            single: volume(settings.single),
            surface: volume(settings.surface),
            multiple: volume(settings.multiple),
            irradiance: settings.irradiance.map(|_| Cache::growing(1)),
            coarse_multiple: volume(settings.coarse_multiple()),
            coarse_irradiance: settings.coarse_irradiance().map(|_| Cache::growing(1)),
            views: Vec::new(),
            settled: [0; 5],
        }
    }

    /// The caches, to be read.
    #[must_use]
    pub fn reader(&self) -> Caches<'_> {
        fn read<'a, C>(settings: &Settings, cache: &'a Option<C>, effort: Option<Effort>) -> Option<Reader<'a, C>> {
            Some(Reader { cache: cache.as_ref()?, reading: settings.reading(&effort?) })
        }
        Caches {
            single: read(&self.settings, &self.single, self.settings.single),
            surface: read(&self.settings, &self.surface, self.settings.surface),
            multiple: read(&self.settings, &self.multiple, self.settings.multiple),
            irradiance: read(&self.settings, &self.irradiance, self.settings.irradiance),
        }
    }

    /// Records and bytes of every cache; zeros for those that are off.
    #[must_use]
    pub fn counts(&self) -> [(usize, usize); 4] {
        let volume = |cache: &Option<VolumeCache<'_>>| cache.as_ref().map_or((0, 0), |c| (c.len(), c.bytes()));
        let surface = self.irradiance.as_ref().map_or((0, 0), |c| (c.len(), c.bytes()));
        [volume(&self.single), volume(&self.surface), volume(&self.multiple), surface]
    }

    /// Records of the caches that are estimated more than once, in the order they are made.
    fn all_counts(&self) -> [usize; 5] {
        let volume = |cache: &Option<VolumeCache<'_>>| cache.as_ref().map_or(0, Cache::len);
        let surface = |cache: &Option<SurfaceCache<'_>>| cache.as_ref().map_or(0, Cache::len);
        [
            surface(&self.coarse_irradiance),
            volume(&self.surface),
            volume(&self.coarse_multiple),
            volume(&self.multiple),
            surface(&self.irradiance),
        ]
    }

    /// The same of the caches that serve the making of others: multiple scattering, irradiance.
    #[must_use]
    pub fn coarse_counts(&self) -> [(usize, usize); 2] {
        let volume = self.coarse_multiple.as_ref().map_or((0, 0), |c| (c.len(), c.bytes()));
        let surface = self.coarse_irradiance.as_ref().map_or((0, 0), |c| (c.len(), c.bytes()));
        [volume, surface]
    }
}
