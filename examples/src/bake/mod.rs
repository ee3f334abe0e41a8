//! Files of baked light that engines read.
//!
//! | module | holds |
//! |---|---|
//! | `mod` | [`Baked`]: a grid and how it was made; [`Layout`] |
//! | [`texture`] | 3D textures: texels, layouts of engines |
//! | [`ktx2`] | textures as KTX2 files |
//! | [`raw`] | plain little-endian numbers, and a JSON file that says what they are |
//! | [`sheets`] | slices side by side in OpenEXR files |

pub mod ktx2;
pub mod raw;
pub mod sheets;
pub mod texture;

use fogbow::bake::{Orders, ProbeBasis, ProbeDeviation, ProbeGrid, ProbeLevels, ProbeState, Quantity};

/// A grid and its finer levels, dilated into probes that are not valid, and what they do not say of themselves.
#[derive(Debug)]
pub struct Baked {
    /// The grid, and levels of half its spacing and so on.
    pub levels: ProbeLevels<'static>,
    /// How light was found; `None` where that is not known any more.
    pub method: Option<&'static str>,
    /// Mean cosine of the sharpest phase function, which is in the numbers of in-scattered radiance; `None` where that is not known any more.
    pub mean_cosine: Option<f32>,
    /// How far it is from path tracing; `None` where it was path traced, or where that is not known any more.
    pub deviation: Option<ProbeDeviation>,
    /// How many bricks are those of the frame before, and how many there are; `None` where there was none, or where that is not known any more.
    pub kept: Option<[usize; 2]>,
    /// What all numbers of light were multiplied by.
    pub scale: f32,
}

/// How numbers lie in textures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    /// A texture for each number of a probe.
    #[default]
    Plain,
    /// Bevy's irradiance volume: an ambient cube in one texture.
    Bevy,
    /// The atlas of three.js' `LightProbeGrid`.
    Three,
}

impl Baked {
    /// The names of the numbers of a probe, in their order.
    ///
    /// ```
    /// use fogbow::bake::ProbeBasis;
    /// use fogbow_examples::bake::Baked;
    /// assert_eq!(Baked::names(ProbeBasis::SphericalHarmonics { degree: 1 }), ["sh0", "sh1", "sh2", "sh3"]);
    /// assert_eq!(Baked::names(ProbeBasis::AmbientCube)[1], "-x");
    /// ```
    #[must_use]
    pub fn names(basis: ProbeBasis) -> Vec<String> {
        match basis {
            ProbeBasis::SphericalHarmonics { .. } => (0..basis.count()).map(|k| format!("sh{k}")).collect(),
            ProbeBasis::AmbientCube => ["+x", "-x", "+y", "-y", "+z", "-z"].map(str::to_owned).into(),
            ProbeBasis::Fluence => vec!["fluence".to_owned()],
        }
    }

    /// The grid that has all probes.
    #[must_use]
    pub fn grid(&self) -> &ProbeGrid<'static> {
        &self.levels.levels()[0]
    }

    /// Finer levels, which have some bricks alone.
    #[must_use]
    pub fn finer(&self) -> &[ProbeGrid<'static>] {
        &self.levels.levels()[1..]
    }

    /// # Errors
    /// Finer levels, which a format has no place for.
    pub fn is_even(&self, format: &str) -> Result<(), String> {
        if self.finer().is_empty() {
            return Ok(());
        }
        Err(format!(
            "{format} has no place for bricks of half the spacing: bake without --refine, or write .bake, .json or .ktx2 of the plain layout"
        ))
    }

    /// The basis in a word.
    #[must_use]
    pub fn basis(&self) -> String {
        match self.grid().basis() {
            ProbeBasis::SphericalHarmonics { degree } => format!("sh{degree}"),
            ProbeBasis::AmbientCube => "ambient-cube".to_owned(),
            ProbeBasis::Fluence => "fluence".to_owned(),
        }
    }

    /// What the numbers are of, and their unit.
    #[must_use]
    pub fn quantity(&self) -> (&'static str, &'static str) {
        match (self.grid().basis(), self.grid().quantity()) {
            (ProbeBasis::Fluence, _) => ("fluence", "W/m^2"),
            (_, Quantity::InScattered) => ("in-scattered", "W/(m^2 sr)"),
            (_, Quantity::Irradiance) => ("irradiance", "W/m^2"),
        }
    }

    /// Which light is in the numbers.
    #[must_use]
    pub fn orders(&self) -> &'static str {
        match self.grid().orders() {
            Orders::All => "all",
            Orders::Indirect => "indirect",
            Orders::Multiple => "multiple",
        }
    }

    /// How many probes are valid, in walls, and far from any medium.
    #[must_use]
    pub fn counts(&self) -> [usize; 3] {
        let count = |state| self.grid().probes().iter().filter(|probe| probe.state() == state).count();
        [ProbeState::Valid, ProbeState::InWall, ProbeState::Empty].map(count)
    }
}
