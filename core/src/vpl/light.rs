//! The virtual light and its connection to a point.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::bound::{Bound, geometry};
use super::scatterer::{Receiver, Scatterer, origin};
use crate::math::Ray;
use crate::phase::{LOBE_WORDS, Lobe, MAX_LOBES, Phase};
use crate::spectrum::Spectrum;
use crate::surface::Surface;
use crate::world::short_of_end;

/// What a virtual light may be: [`VirtualLight::kind`].
mod kind {
    /// Surfaces; a medium's kind is the number of its lobes, which is positive.
    pub(super) const LAMBERT: u32 = 0x100;
    pub(super) const PHONG: u32 = 0x101;
}

/// Floats of a lobe with its weight.
const WEIGHTED_LOBE: usize = LOBE_WORDS + 3;

/// Floats that describe what scatters.
const WORDS: usize = WEIGHTED_LOBE * MAX_LOBES;

/// A vertex of a light's path, from which light is scattered on: a virtual point light, in a medium or on a surface. 140
/// bytes.
///
/// Engelhardt et al. 2012, § 3.2, with the light scattered at the vertex itself applied once: `flux` is the sheet's
/// `β σₛ/N` in a medium (§ 3.2) and the flux that arrives, over N, at a surface.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct VirtualLight {
    /// Where (m).
    pub position: Vec3,
    /// Direction in which its light came (unit, as light flies).
    pub incoming: Vec3,
    /// What it sends on (W), to be multiplied by `p` in a medium, by `f_r cos` at a surface.
    pub flux: Spectrum,
    /// How often its light was scattered, here included.
    pub scatterings: u32,
    /// Number of lobes of the phase function; for surfaces one of [`kind`]'s.
    kind: u32,
    /// Lobes: [`Lobe::to_words`], weight of three channels each. Surfaces: normal, reflectances, exponent.
    scatterer: [f32; WORDS],
}

impl VirtualLight {
    /// In a medium: `flux` is what is scattered (W), albedo applied; `phase` how.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::{Lobe, Phase}, spectrum::Spectrum, vpl::{Scatterer, VirtualLight}};
    /// let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.5 });
    /// let light = VirtualLight::in_medium(Vec3::X, Vec3::Z, Spectrum::ONE, 1, &phase);
    /// assert_eq!(light.scatterer(), Scatterer::Medium { scattering: Spectrum::ONE, phase });
    /// ```
    #[must_use]
    pub fn in_medium(position: Vec3, incoming: Vec3, flux: Spectrum, scatterings: u32, phase: &Phase) -> Self {
        let mut light = Self { position, incoming, flux, scatterings, kind: 0, scatterer: [0.0; WORDS] };
        for (words, (lobe, weight)) in light.scatterer.chunks_exact_mut(WEIGHTED_LOBE).zip(phase.lobes()) {
            words[..LOBE_WORDS].copy_from_slice(&lobe.to_words());
            words[LOBE_WORDS..].copy_from_slice(&weight.0);
            light.kind += 1;
        }
        light
    }

    /// On a surface, where `flux` (W) arrives. `None` for surfaces that light is followed past
    /// ([`Surface::is_followed`]).
    ///
    /// ```
    /// # use fogbow::{math::Vec3, spectrum::Spectrum, surface::Surface, vpl::{Scatterer, VirtualLight}};
    /// let one = Spectrum::ONE;
    /// let on = |surface: Surface| VirtualLight::on_surface(Vec3::ZERO, Vec3::NEG_Z, one, 1, Vec3::Z, &surface);
    /// let wall = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
    /// assert_eq!(on(wall).unwrap().scatterer(), Scatterer::Surface { normal: Vec3::Z, surface: wall });
    /// assert!(on(Surface::Mirror { reflectance: one }).is_none());
    /// ```
    #[must_use]
    pub fn on_surface(
        position: Vec3,
        incoming: Vec3,
        flux: Spectrum,
        scatterings: u32,
        normal: Vec3,
        surface: &Surface,
    ) -> Option<Self> {
        let (kind, diffuse, specular, exponent) = match *surface {
            Surface::Lambert { reflectance } => (kind::LAMBERT, reflectance, Spectrum::ZERO, 0.0),
            Surface::Phong { diffuse, specular, exponent } => (kind::PHONG, diffuse, specular, exponent),
            _ => return None,
        };
        let mut scatterer = [0.0; WORDS];
        scatterer[..3].copy_from_slice(&normal.to_array());
        scatterer[3..6].copy_from_slice(&diffuse.0);
        scatterer[6..9].copy_from_slice(&specular.0);
        scatterer[9] = exponent;
        Some(Self { position, incoming, flux, scatterings, kind, scatterer })
    }

    /// The same, `factor` times as bright.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::Phase, spectrum::Spectrum, vpl::VirtualLight};
    /// let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// assert_eq!(light.scaled(1.0 / 8.0).flux, Spectrum::splat(0.125));   // one of eight paths
    /// ```
    #[inline]
    #[must_use]
    pub fn scaled(self, factor: f32) -> Self {
        Self { flux: self.flux * factor, ..self }
    }

    /// Whether it lies on a surface.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::Phase, spectrum::Spectrum, surface::Surface, vpl::VirtualLight};
    /// let wall = Surface::Lambert { reflectance: Spectrum::ONE };
    /// let on_wall = VirtualLight::on_surface(Vec3::ZERO, Vec3::NEG_Z, Spectrum::ONE, 1, Vec3::Z, &wall).unwrap();
    /// let in_fog = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// assert!(on_wall.is_on_surface() && !in_fog.is_on_surface());
    /// ```
    #[inline]
    #[must_use]
    pub fn is_on_surface(&self) -> bool {
        self.kind >= kind::LAMBERT
    }

    /// How it scatters its flux; a medium's `σₛ` counts as 1, because the flux holds it. Bytes from elsewhere that are no
    /// virtual light's scatter nothing.
    ///
    /// ```
    /// # use fogbow::{math::Vec3, phase::{Lobe, Phase}, spectrum::Spectrum, vpl::{Scatterer, VirtualLight}};
    /// let phase = Phase::from(Lobe::HenyeyGreenstein { g: 0.5 });
    /// let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::splat(3.0), 1, &phase);
    /// assert_eq!(light.scatterer(), Scatterer::Medium { scattering: Spectrum::ONE, phase });
    /// ```
    #[inline]
    #[must_use]
    pub fn scatterer(&self) -> Scatterer {
        let words = &self.scatterer;
        let colour = |i: usize| Spectrum([words[i], words[i + 1], words[i + 2]]);
        match self.kind {
            kind::LAMBERT => Scatterer::Surface {
                normal: Vec3::from_slice(words),
                surface: Surface::Lambert { reflectance: colour(3) },
            },
            kind::PHONG => Scatterer::Surface {
                normal: Vec3::from_slice(words),
                surface: Surface::Phong { diffuse: colour(3), specular: colour(6), exponent: words[9] },
            },
            count => {
                let part = |i: usize| {
                    let (lobe, weight) = words.get(i * WEIGHTED_LOBE..)?.split_first_chunk()?;
                    Some((Spectrum(*weight.first_chunk()?), Phase::from(Lobe::from_words(*lobe)?)))
                };
                // What was one phase function is one again.
                let mut known = 0;
                let mut parts = (0..count).map_while(|i| part(i as usize)).inspect(|_| known += 1);
                let phase = if count == 1 { parts.next().map(|(_, phase)| phase) } else { Phase::mix(parts).ok() };
                let Some(phase) = phase.filter(|_| known == count) else {
                    return Scatterer::Medium { scattering: Spectrum::ZERO, phase: Phase::ISOTROPIC };
                };
                Scatterer::Medium { scattering: Spectrum::ONE, phase }
            }
        }
    }

    /// What it sends to `receiver`, but for the way there: see [`Connection`]. `None` where nothing is.
    ///
    /// ```
    /// # use fogbow::{host::Properties, math::Vec3, phase::Phase, spectrum::Spectrum};
    /// # use fogbow::vpl::{Bound, Receiver, VirtualLight};
    /// let fog = Properties { scattering: Spectrum::splat(0.5), ..Properties::VACUUM };
    /// let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::X, Spectrum::ONE, 1, &Phase::ISOTROPIC);
    /// let receiver = Receiver::in_medium(Vec3::Z * 0.5, Vec3::Y, &fog).unwrap();
    /// let connection = light.connect(&receiver).unwrap();
    /// assert_eq!((connection.way.length, connection.geometry), (0.5, 4.0));
    /// // The way's transmittance and visibility are the host's:
    /// let seen = connection.radiance(Bound::new(1.0)?, Spectrum::splat(0.9));
    /// assert!((seen[0] - 0.9 * 0.5 / (16.0 * core::f32::consts::PI.powi(2))).abs() < 1e-8);
    /// # Ok::<(), fogbow::vpl::NoBound>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn connect(&self, receiver: &Receiver) -> Option<Connection> {
        let offset = self.position - receiver.point;
        let distance2 = offset.length_squared();
        let to_light = offset * (1.0 / crate::math::float::sqrt(distance2));
        // Coinciding points have no direction.
        if !to_light.is_finite() {
            return None;
        }
        let here = receiver.scatterer.cosine(to_light);
        if here <= 0.0 {
            return None;
        }
        let scatterer = self.scatterer();
        let cosines = here * scatterer.cosine(-to_light);
        if cosines <= 0.0 {
            return None;
        }
        let strength = receiver.scatterer.value(receiver.to_eye, to_light)
            * scatterer.value(-to_light, -self.incoming)
            * self.flux;
        if strength.is_black() {
            return None;
        }
        let way = Ray::between(receiver.origin(to_light), origin(self.position, &scatterer, -to_light));
        Some(Connection { way, geometry: geometry(distance2, cosines), strength })
    }
}

/// One virtual light's contribution to one point, but for visibility and transmittance: those are the host's, who may
/// trace rays, look into shadow maps, or hand out lights to workers.
///
/// ```text
/// E_k = f̂(y) min(Ĝ, b) V̂ f̂(v_k) β_k/N
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Connection {
    /// From the receiver to the light: along it, light is attenuated.
    pub way: Ray,
    /// `Ĝ` (m⁻²).
    pub geometry: f32,
    /// All but `Ĝ` and the way: W·m⁻¹·sr⁻¹ in a medium, W·sr⁻¹ on a surface, times `Ĝ`'s m⁻² what is scattered to
    /// the eye.
    pub strength: Spectrum,
}

impl Connection {
    /// What is scattered towards the eye (W·m⁻³·sr⁻¹ in a medium, W·m⁻²·sr⁻¹ at a surface), of the part that `bound`
    /// leaves; `reach` is the transmittance along [`Self::way`], 0 where it is blocked.
    ///
    /// ```
    /// # use fogbow::{math::{Ray, Vec3}, spectrum::Spectrum, vpl::{Bound, Connection}};
    /// let way = Ray::between(Vec3::ZERO, 0.1 * Vec3::X);
    /// let connection = Connection { way, geometry: 100.0, strength: Spectrum::splat(0.5) };
    /// let half = Spectrum::splat(0.5);
    /// assert_eq!(connection.radiance(Bound::NONE, half), Spectrum::splat(25.0));
    /// assert_eq!(connection.radiance(Bound::new(4.0)?, half), Spectrum::ONE);   // as from half a metre
    /// # Ok::<(), fogbow::vpl::NoBound>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn radiance(&self, bound: Bound, reach: Spectrum) -> Spectrum {
        self.strength * reach * bound.clamped(self.geometry)
    }

    /// The ray that asks whether [`Self::way`] is blocked: it ends before the light's own surface.
    ///
    /// ```
    /// # use fogbow::{math::{Ray, Vec3}, spectrum::Spectrum, vpl::Connection};
    /// let way = Ray::between(Vec3::ZERO, 2.0 * Vec3::X);
    /// let ray = Connection { way, geometry: 0.25, strength: Spectrum::ONE }.shadow_ray();
    /// assert!(ray.length < 2.0 && ray.length > 1.999);
    /// ```
    #[inline]
    #[must_use]
    pub fn shadow_ray(&self) -> Ray {
        short_of_end(&self.way)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_of_no_virtual_light_scatter_nothing() {
        let phase = Phase::droplets(10.0).unwrap();
        let light = VirtualLight::in_medium(Vec3::ZERO, Vec3::Z, Spectrum::ONE, 1, &phase);
        let Scatterer::Medium { phase: read, .. } = light.scatterer() else { panic!("on a surface") };
        assert!(read.lobes().eq(phase.lobes()));
        let nothing = Scatterer::Medium { scattering: Spectrum::ZERO, phase: Phase::ISOTROPIC };
        for lobe in 0..2 {
            let mut other = light;
            other.scatterer[lobe * WEIGHTED_LOBE] = 99.0;
            assert_eq!(other.scatterer(), nothing, "lobe {lobe}");
        }
        for kind in [MAX_LOBES as u32 + 1, kind::PHONG + 1, u32::MAX] {
            assert_eq!(VirtualLight { kind, ..light }.scatterer(), nothing, "{kind:#x}");
        }
    }
}
