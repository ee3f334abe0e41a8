//! What a probe holds.

use glam::Vec3;

use crate::math::float::{INV_FOUR_PI, PI};
use crate::phase::{Phase, deflection};
use crate::sh::{self, expansion};
use crate::spectrum::Spectrum;

/// Most numbers in colour that a probe holds: spherical harmonics of degree 3.
pub const MOST_COEFFICIENTS: usize = 16;

/// The directions of an ambient cube, in its order.
pub const AXES: [Vec3; 6] = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];

/// How a probe holds light by direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ProbeBasis {
    /// Coefficients of spherical harmonics up to a degree from 0 to 3, in the order and sign of [`crate::sh`].
    SphericalHarmonics {
        /// The highest degree.
        degree: u32,
    },
    /// Values in six directions, [`AXES`]; between them mixed by squares of the direction's coordinates.
    AmbientCube,
    /// Fluence (W·m⁻²), the integral of radiance over all directions, alone.
    Fluence,
}

impl ProbeBasis {
    /// Numbers in colour that a probe holds.
    ///
    /// ```
    /// # use fogbow::bake::ProbeBasis;
    /// assert_eq!(ProbeBasis::SphericalHarmonics { degree: 2 }.count(), 9);
    /// assert_eq!((ProbeBasis::AmbientCube.count(), ProbeBasis::Fluence.count()), (6, 1));
    /// ```
    #[must_use]
    pub fn count(self) -> usize {
        match self {
            Self::SphericalHarmonics { degree } => sh::coefficient_count(degree as usize),
            Self::AmbientCube => AXES.len(),
            Self::Fluence => 1,
        }
    }

    /// The value in a direction (unit) of what `held` says; of fluence the same in all directions, `φ/4π`.
    ///
    /// ```
    /// # use fogbow::{bake::ProbeBasis, math::Vec3, spectrum::Spectrum};
    /// let cube = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(Spectrum::splat);
    /// // (0.6, 0, −0.8): 0.36 of +x and 0.64 of −z.
    /// let value = ProbeBasis::AmbientCube.value(&cube, Vec3::new(0.6, 0.0, -0.8));
    /// assert!((value[0] - (0.36 * 1.0 + 0.64 * 6.0)).abs() < 1e-6);
    /// ```
    #[must_use]
    pub fn value(self, held: &[Spectrum], direction: Vec3) -> Spectrum {
        match self {
            Self::SphericalHarmonics { .. } => expansion::value(held, direction),
            Self::AmbientCube => {
                let faces = held.chunks_exact(2).zip(direction.to_array());
                faces.map(|(pair, d)| pair[usize::from(d < 0.0)] * (d * d)).sum()
            }
            Self::Fluence => held.first().copied().unwrap_or_default() * INV_FOUR_PI,
        }
    }

    /// What [`ProbeBasis::level`] is where the mean over directions is 1.
    pub(super) fn number_of_mean(self, quantity: Quantity) -> f64 {
        match (self, quantity) {
            // 1 / Y₀₀
            (Self::SphericalHarmonics { .. }, _) => libm::sqrt(4.0 * core::f64::consts::PI),
            (Self::AmbientCube, _) => 1.0,
            (Self::Fluence, Quantity::InScattered) => 4.0 * core::f64::consts::PI,
            // A quarter of fluence is the mean of irradiance.
            (Self::Fluence, Quantity::Irradiance) => 4.0,
        }
    }

    /// How bright a probe is, whatever the direction: what errors are compared with.
    pub(super) fn level(self, held: &[Spectrum]) -> f32 {
        match self {
            Self::AmbientCube => held.iter().map(|face| face.mean()).sum::<f32>() / AXES.len() as f32,
            Self::SphericalHarmonics { .. } | Self::Fluence => held.first().map_or(0.0, |first| first.mean()),
        }
    }
}

/// Which light of a direction a probe holds. Fluence is the same for both.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quantity {
    /// In-scattered radiance (W·m⁻²·sr⁻¹) towards the direction: with the phase function, without `σₛ`. It lights fog.
    #[default]
    InScattered,
    /// Irradiance (W·m⁻²) of a surface with the direction as its normal. It lights surfaces.
    Irradiance,
}

/// Which light is in a probe, by where it arrives from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Orders {
    /// All of it.
    #[default]
    All,
    /// All but light straight from the lights, for engines that add that themselves; that of an even sky
    /// ([`Light::is_sky`](crate::light::Light::is_sky)) is in it.
    Indirect,
    /// Light that the medium has scattered last. In fog, where the probe's own scattering follows, that is what is scattered more than once.
    Multiple,
}

/// Parts of light by where it arrives from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Parts {
    /// Straight from the lights but a sky.
    pub(super) lights: bool,
    /// From surfaces and a sky.
    pub(super) surfaces: bool,
    /// From the medium.
    pub(super) medium: bool,
}

impl From<Orders> for Parts {
    fn from(orders: Orders) -> Self {
        Self { lights: orders == Orders::All, surfaces: orders != Orders::Multiple, medium: true }
    }
}

/// What light from a direction counts for in every number of a probe.
pub(super) struct Projection<'a> {
    basis: ProbeBasis,
    quantity: Quantity,
    phase: &'a Phase,
    /// By degree, what the function of an angle makes of an expansion (Funk and Hecke).
    moments: [Spectrum; 4],
}

impl<'a> Projection<'a> {
    pub(super) fn new(basis: ProbeBasis, quantity: Quantity, phase: &'a Phase) -> Self {
        // Of a cosine that is cut off at 0.
        const COSINE: [f32; 4] = [PI, 2.0 * PI / 3.0, 0.25 * PI, 0.0];
        let moments = core::array::from_fn(|l| match quantity {
            Quantity::InScattered => phase.moment(l),
            Quantity::Irradiance => Spectrum::splat(COSINE[l]),
        });
        Self { basis, quantity, phase, moments }
    }

    /// Makes of radiance's spherical harmonics what the function of an angle makes of them.
    pub(super) fn scale(&self, held: &mut [Spectrum]) {
        for (l, moment) in self.moments.into_iter().enumerate() {
            held.iter_mut().skip(l * l).take(2 * l + 1).for_each(|number| *number *= moment);
        }
    }

    /// Adds light that arrives from `to_light`, of `irradiance` (W·m⁻²) across itself.
    pub(super) fn add(&self, to_light: Vec3, irradiance: Spectrum, into: &mut [Spectrum]) {
        match self.basis {
            ProbeBasis::SphericalHarmonics { degree } => {
                let mut y = [0.0; MOST_COEFFICIENTS];
                let axis = match self.quantity {
                    Quantity::InScattered => -to_light,
                    Quantity::Irradiance => to_light,
                };
                sh::evaluate(axis, degree as usize, &mut y);
                for l in 0..=degree as usize {
                    let light = self.moments[l] * irradiance;
                    for k in l * l..(l + 1) * (l + 1) {
                        into[k] += light * y[k];
                    }
                }
            }
            ProbeBasis::AmbientCube => {
                for (axis, slot) in AXES.into_iter().zip(into) {
                    *slot += match self.quantity {
                        Quantity::InScattered => self.phase.value(deflection(to_light, axis)) * irradiance,
                        Quantity::Irradiance => irradiance * axis.dot(to_light).max(0.0),
                    };
                }
            }
            ProbeBasis::Fluence => into[0] += irradiance,
        }
    }
}
