//! A point of light, its fall-off and the fall-off's gradient: Jarosz et al. 2008, Eq. 9 and
//! 36–40, in the closed forms of the sheet's § 1.2.

use glam::Vec3;

use crate::math::float;
use crate::spectrum::{Gradient, Spectrum};

/// Below this distance (m) from a light its inverse square is no number to work with: no
/// contribution.
pub const MIN_DISTANCE: f32 = 1e-12;

/// Smallest cosine used in a gradient: at `c → 0` that of a Phong lobe has no bound.
const MIN_COSINE: f32 = 1e-4;

/// How what a point of light sends changes with direction and distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Falloff {
    /// `1/r²` in all directions.
    Uniform,
    /// `cosˢ / r²` around the normal; `s = 0` is a hemispherical lamp, `s = 1` equals [`Falloff::Area`].
    Phong {
        /// Exponent `s`: 0 or at least 1.
        exponent: f32,
    },
    /// `cos / r²`: a small piece of a Lambertian surface.
    Area,
    /// `f(γ) / r²`, full within `beam` (rad from the axis), falling linearly in the angle to 0 at
    /// `cutoff`.
    Spot {
        /// Half angle of the full beam (rad).
        beam: f32,
        /// Half angle where light ends (rad).
        cutoff: f32,
    },
    /// From infinity: the same everywhere.
    Distant,
}

/// A point of light: what lights, surfaces hit by rays and virtual lights have in common.
///
/// It stays where it is while the lit point moves, so gradients exist (sheet § 1.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Where (m); without meaning for [`Falloff::Distant`].
    pub position: Vec3,
    /// Normal or axis (unit); for [`Falloff::Distant`] the direction in which light travels.
    pub normal: Vec3,
    /// Radiance over area density (W·sr⁻¹), radiant intensity (W·sr⁻¹), or for
    /// [`Falloff::Distant`] irradiance (W·m⁻²).
    pub weight: Spectrum,
    /// Dependence on direction and distance.
    pub falloff: Falloff,
}

/// Light that arrives from a [`Source`], before fog and shadows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Incident {
    /// Direction towards the source (unit).
    pub to_light: Vec3,
    /// Distance (m); infinite for a distant one.
    pub distance: f32,
    /// Irradiance on a plane across the light (W·m⁻²): weight × fall-off.
    pub irradiance: Spectrum,
}

/// A fall-off and its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// `H` (m⁻²), or 1 for a distant source.
    pub value: f32,
    /// `∇H` (m⁻³) with respect to the lit point.
    pub gradient: Vec3,
}

impl Source {
    /// Direction towards the source and distance; `None` at the source itself.
    #[inline]
    fn direction(&self, point: Vec3) -> Option<(Vec3, f32)> {
        if self.falloff == Falloff::Distant {
            return Some((-self.normal, f32::INFINITY));
        }
        let offset = self.position - point;
        let distance = offset.length();
        // Written so that NaN fails, too.
        if !(distance > MIN_DISTANCE) { None } else { Some((offset / distance, distance)) }
    }

    /// What arrives at `point`; `None` where nothing does.
    ///
    /// ```
    /// # use fogbow::{light::{Falloff, Source}, math::Vec3, spectrum::Spectrum};
    /// let piece = Source { position: Vec3::ZERO, normal: Vec3::Z, weight: Spectrum::ONE, falloff: Falloff::Area };
    /// let incident = piece.incident(Vec3::new(0.0, 3.0, 4.0)).unwrap();
    /// assert!((incident.irradiance[0] - 0.8 / 25.0).abs() < 1e-7);   // cos/r²
    /// assert_eq!(piece.incident(Vec3::NEG_Z), None);   // behind it
    /// ```
    #[inline]
    #[must_use]
    pub fn incident(&self, point: Vec3) -> Option<Incident> {
        let (to_light, distance) = self.direction(point)?;
        let angular = self.angular(-to_light);
        if angular <= 0.0 {
            return None;
        }
        let inverse = if distance.is_infinite() { 1.0 } else { 1.0 / distance };
        Some(Incident { to_light, distance, irradiance: self.weight * (angular * inverse * inverse) })
    }

    /// The factor that depends on the direction `u` (unit) in which light leaves the source.
    #[inline]
    fn angular(&self, u: Vec3) -> f32 {
        let cosine = self.normal.dot(u);
        match self.falloff {
            Falloff::Uniform | Falloff::Distant => 1.0,
            Falloff::Area => cosine.max(0.0),
            Falloff::Phong { exponent } => {
                if cosine <= 0.0 {
                    0.0
                } else {
                    float::powf(cosine, exponent)
                }
            }
            Falloff::Spot { beam, cutoff } => spot(cosine, beam, cutoff),
        }
    }

    /// Fall-off at `point` with its gradient, the source held fixed; `None` at the source itself.
    ///
    /// ```text
    /// uniform  H = 1/r²             ∇H = −2u/r³
    /// area     H = c/r²             ∇H = (n − 3cu)/r³
    /// Phong    H = cˢ/r²            ∇H = (s cˢ⁻¹ n − (s+2) cˢ u)/r³
    /// spot     H = f(γ)/r²          ∇H = f′(γ) ∇γ/r² − 2 f u/r³,  ∇γ = −(n − cu)/(r sin γ)
    /// ```
    ///
    /// with `u` the direction of propagation and `c = n·u`; zero with zero gradient for `c ≤ 0`
    /// (area, Phong). Sources: Jarosz et al. 2008, Eq. 36–40; spot: sheet § 1.5.
    ///
    /// ```
    /// # use fogbow::{light::{Falloff, Source}, math::Vec3, spectrum::Spectrum};
    /// let lamp = Source { position: Vec3::ZERO, normal: Vec3::Z, weight: Spectrum::ONE, falloff: Falloff::Uniform };
    /// let h = lamp.geometry(Vec3::new(0.0, 0.0, 2.0)).unwrap();
    /// assert_eq!((h.value, h.gradient.z), (0.25, -0.25));
    /// ```
    #[must_use]
    pub fn geometry(&self, point: Vec3) -> Option<Geometry> {
        let (to_light, distance) = self.direction(point)?;
        if self.falloff == Falloff::Distant {
            return Some(Geometry { value: 1.0, gradient: Vec3::ZERO });
        }
        let (u, n) = (-to_light, self.normal);
        let c = n.dot(u);
        let inverse = 1.0 / distance;
        // Step by step: r³ formed at once would leave the range of f32.
        let with = |value: f32, slope: Vec3| Geometry {
            value: value * inverse * inverse,
            gradient: slope * inverse * inverse * inverse,
        };
        let dark = Geometry { value: 0.0, gradient: Vec3::ZERO };
        Some(match self.falloff {
            Falloff::Uniform | Falloff::Distant => with(1.0, u * -2.0),
            Falloff::Area if c > 0.0 => with(c, n - u * (3.0 * c)),
            Falloff::Phong { exponent } if c > 0.0 => {
                if exponent == 0.0 {
                    with(1.0, u * -2.0)
                } else {
                    // c^(s−1)/r² as a square, so that a small power and a small distance meet before
                    // either leaves the range of f32.
                    let base = if exponent < 1.0 { c.max(MIN_COSINE) } else { c };
                    let root = float::powf(base, 0.5 * (exponent - 1.0)) * inverse;
                    let lower = root * root;
                    Geometry {
                        value: lower * c,
                        gradient: (n * exponent - u * ((exponent + 2.0) * c)) * lower * inverse,
                    }
                }
            }
            Falloff::Spot { beam, cutoff } => {
                let value = spot(c, beam, cutoff);
                let angle = float::acos(c);
                let mut slope = u * (-2.0 * value);
                if angle > beam && angle < cutoff {
                    // f′ = −1/(cutoff − beam); the two signs cancel.
                    let sine = float::safe_sqrt((1.0 - c) * (1.0 + c)).max(1e-4);
                    slope += (n - u * c) / (sine * (cutoff - beam));
                }
                with(value, slope)
            }
            _ => dark,
        })
    }

    /// Irradiance (W·m⁻²) and its gradient (W·m⁻³) at `point`, before fog and shadows.
    ///
    /// The source is held fixed. `None` at the source itself.
    ///
    /// ```
    /// # use fogbow::{light::PointLight, math::Vec3, spectrum::Spectrum};
    /// let lamp = PointLight::new(Vec3::ZERO, Spectrum::splat(4.0)).unwrap().source();
    /// let (irradiance, gradient) = lamp.irradiance(2.0 * Vec3::X).unwrap();
    /// assert_eq!((irradiance[0], gradient.x[0]), (1.0, -1.0));   // I/r² and −2 I/r³
    /// ```
    #[must_use]
    pub fn irradiance(&self, point: Vec3) -> Option<(Spectrum, Gradient)> {
        let h = self.geometry(point)?;
        Some((self.weight * h.value, Gradient::outer(self.weight, h.gradient)))
    }
}

/// Spot fall-off: 1 within the beam, 0 outside the cut-off, linear in the angle between.
#[inline]
pub(super) fn spot(cosine: f32, beam: f32, cutoff: f32) -> f32 {
    if cosine <= -1.0 + 1e-7 && cutoff < float::PI {
        return 0.0;
    }
    let angle = float::acos(cosine);
    if angle >= cutoff {
        0.0
    } else if angle <= beam {
        1.0
    } else {
        (cutoff - angle) / (cutoff - beam)
    }
}
