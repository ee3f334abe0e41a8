//! The principled models (Burley 2012, 2015), as Mitsuba 3's `principled` and `principledthin` have them: a few numbers in [0, 1]
//! for what artists call plastic, metal, cloth and glass.

use glam::{Vec2, Vec3};

use super::SurfaceSample;
use super::conductor::{reflection, reflection_pdf};
use super::dielectric::{Facing, above};
use super::microfacet::{Distribution, GRAZING, Roughness};
use super::specular::{mirrored, refract};
use crate::math::float::{self, PI};
use crate::sampling::warp::{cosine_hemisphere, cosine_hemisphere_pdf, spherical};
use crate::spectrum::Spectrum;

/// A solid body of many looks: a diffuse base with sheen, a specular interface between dielectric and metal, rough glass, a clear
/// coat. All numbers but [`Principled::eta`] are in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Principled {
    /// Colour of the base, and of metal.
    pub base_color: Spectrum,
    /// Square root of the specular lobe's roughness.
    pub roughness: f32,
    /// How much longer than wide highlights are, along [`Principled::tangent`].
    pub anisotropic: f32,
    /// From dielectric to metal.
    pub metallic: f32,
    /// From a diffuse base to glass.
    pub spec_trans: f32,
    /// Index of refraction behind the normal over the one before it (> 0).
    pub eta: f32,
    /// From white highlights to ones tinted by the base.
    pub spec_tint: f32,
    /// Light at grazing angles, as of cloth.
    pub sheen: f32,
    /// From white sheen to one tinted by the base.
    pub sheen_tint: f32,
    /// From the diffuse base to a fit of subsurface scattering.
    pub flatness: f32,
    /// Strength of a clear coat.
    pub clearcoat: f32,
    /// From a dull coat to a glossy one.
    pub clearcoat_gloss: f32,
    /// Where roughness is least, in the world; zero: anywhere.
    pub tangent: Vec3,
}

impl Default for Principled {
    /// Grey, half rough, of index 1.5, and nothing else.
    fn default() -> Self {
        Self {
            base_color: Spectrum::splat(0.5),
            roughness: 0.5,
            anisotropic: 0.0,
            metallic: 0.0,
            spec_trans: 0.0,
            eta: 1.5,
            spec_tint: 0.0,
            sheen: 0.0,
            sheen_tint: 0.0,
            flatness: 0.0,
            clearcoat: 0.0,
            clearcoat_gloss: 0.0,
            tangent: Vec3::ZERO,
        }
    }
}

/// Roughness of the clear coat's shadowing.
const COAT_SHADOWING: f32 = 0.25;

/// Roughness along and across for an artist's numbers.
fn facets(roughness: f32, anisotropic: f32, tangent: Vec3) -> Roughness {
    let squared = roughness * roughness;
    let aspect = if anisotropic > 0.0 { float::sqrt(1.0 - 0.9 * anisotropic) } else { 1.0 };
    let alpha = [float::max(1e-3, squared / aspect), float::max(1e-3, squared * aspect)];
    Roughness { distribution: Distribution::Ggx, alpha, tangent }
}

/// Luminance of linear sRGB.
fn luminance(colour: Spectrum) -> f32 {
    0.212_671 * colour[0] + 0.715_160 * colour[1] + 0.072_169 * colour[2]
}

/// The hue of a colour: at a luminance of 1; white for black.
fn tint(colour: Spectrum) -> Spectrum {
    let luminance = luminance(colour);
    if luminance > 0.0 { colour / luminance } else { Spectrum::ONE }
}

fn lerp(from: Spectrum, to: Spectrum, t: f32) -> Spectrum {
    from * (1.0 - t) + to * t
}

/// `(1 − cos)⁵`.
fn schlick_weight(cosine: f32) -> f32 {
    let m = (1.0 - cosine).clamp(0.0, 1.0);
    let m2 = m * m;
    m2 * m2 * m
}

/// Schlick's fit of Fresnel reflectance: by the transmitted angle where light comes from the denser side.
fn schlick(at_normal: Spectrum, cosine: f32, eta: f32) -> Spectrum {
    let into = if cosine >= 0.0 { eta } else { 1.0 / eta };
    let weight = if into > 1.0 {
        schlick_weight(cosine.abs())
    } else {
        schlick_weight(float::safe_sqrt(1.0 - (1.0 - cosine * cosine) / (into * into)))
    };
    lerp(at_normal, Spectrum::ONE, weight)
}

/// Reflectance at normal incidence.
fn at_normal(eta: f32) -> f32 {
    let ratio = (eta - 1.0) / (eta + 1.0);
    ratio * ratio
}

/// Diffuse, retroreflected and flattened light over `ρ/π`: Burley 2012 § 5.3, 2015.
fn diffuse(roughness: f32, flatness: f32, eye: Vec3, light: Vec3, m: Vec3) -> f32 {
    let (cos_o, cos_i) = (light.z.abs(), eye.z.abs());
    let (weight_o, weight_i) = (schlick_weight(cos_o), schlick_weight(cos_i));
    let lambert = (1.0 - 0.5 * weight_i) * (1.0 - 0.5 * weight_o);
    let cos_d = m.dot(light);
    let retro = 2.0 * roughness * cos_d * cos_d;
    let plain = lambert + retro * (weight_o + weight_i + weight_o * weight_i * (retro - 1.0));
    if flatness <= 0.0 {
        return plain;
    }
    let grazing = 0.5 * retro;
    let subsurface = (1.0 + (grazing - 1.0) * weight_o) * (1.0 + (grazing - 1.0) * weight_i);
    let flat = 1.25 * (subsurface * (1.0 / (cos_o + cos_i) - 0.5) + 0.5);
    plain + (flat - plain) * flatness
}

/// The coat's normals: `D ∝ 1/(1 + (α² − 1) cos²)` (Burley 2012, appendix B), per steradian.
fn coat_density(alpha: f32, m: Vec3) -> f32 {
    let alpha2 = alpha * alpha;
    let density = (alpha2 - 1.0) / (PI * float::ln(alpha2) * (1.0 + (alpha2 - 1.0) * m.z * m.z));
    if density * m.z > 1e-20 { density } else { 0.0 }
}

/// Shares of the samples that go to each lobe; their sum is 1.
struct Lobes {
    reflected: f32,
    transmitted: f32,
    coat: f32,
    diffuse: f32,
}

impl Principled {
    /// The index of refraction for Burley's `specular`, in [0, 1]: 0.5 is an index of 1.5.
    ///
    /// ```
    /// # use fogbow::surface::Principled;
    /// assert!((Principled::eta_of(0.5) - 1.5).abs() < 1e-6 && Principled::eta_of(0.0) == 1.0);
    /// ```
    #[must_use]
    pub fn eta_of(specular: f32) -> f32 {
        2.0 / (1.0 - float::safe_sqrt(0.08 * specular)) - 1.0
    }

    #[inline]
    pub(super) fn facets(&self) -> Roughness {
        facets(self.roughness, self.anisotropic, self.tangent)
    }

    /// Weights of the base and of glass.
    fn weights(&self) -> (f32, f32) {
        ((1.0 - self.metallic) * (1.0 - self.spec_trans), (1.0 - self.metallic) * self.spec_trans)
    }

    fn coat_alpha(&self) -> f32 {
        0.1 + (0.001 - 0.1) * self.clearcoat_gloss
    }

    /// By the share of light that a facet reflects.
    fn lobes(&self, is_front: bool, fresnel: f32) -> Lobes {
        let (base, glass) = self.weights();
        let lobes = if is_front {
            Lobes {
                reflected: 1.0 - glass * (1.0 - fresnel),
                transmitted: glass * (1.0 - fresnel),
                coat: 0.25 * self.clearcoat,
                diffuse: base,
            }
        } else if self.spec_trans > 0.0 {
            Lobes { reflected: fresnel, transmitted: 1.0 - fresnel, coat: 0.0, diffuse: 0.0 }
        } else {
            Lobes { reflected: fresnel, transmitted: 0.0, coat: 0.0, diffuse: 0.0 }
        };
        let sum = lobes.reflected + lobes.transmitted + lobes.coat + lobes.diffuse;
        let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        Lobes {
            reflected: lobes.reflected * scale,
            transmitted: lobes.transmitted * scale,
            coat: lobes.coat * scale,
            diffuse: lobes.diffuse * scale,
        }
    }

    /// Light of the diffuse base and its sheen.
    pub(super) fn base_value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        let (base, _) = self.weights();
        if !(eye.z > GRAZING && light.z > GRAZING) || base <= 0.0 {
            return Spectrum::ZERO;
        }
        let Some(m) = (eye + light).try_normalize() else { return Spectrum::ZERO };
        let value = self.base_color * (base / PI * diffuse(self.roughness, self.flatness, eye, light, m));
        let sheen = self.sheen * (1.0 - self.metallic);
        if sheen <= 0.0 {
            return value;
        }
        let colour = lerp(Spectrum::ONE, tint(self.base_color), self.sheen_tint);
        value + colour * (sheen * schlick_weight(m.dot(light).abs()))
    }

    /// What facets reflect, with metal and tints: of the front in full, of the back only where glass is.
    fn reflectance(&self, is_front: bool, cosine: f32, fresnel: f32) -> Spectrum {
        if !is_front {
            return Spectrum::splat(self.weights().1 * fresnel);
        }
        let mut reflected = Spectrum::splat((1.0 - self.metallic) * (1.0 - self.spec_tint) * fresnel);
        if self.metallic > 0.0 {
            reflected += schlick(self.base_color, cosine, self.eta) * self.metallic;
        }
        if self.spec_tint > 0.0 {
            let eta = if cosine >= 0.0 { self.eta } else { 1.0 / self.eta };
            let tinted = schlick(tint(self.base_color) * at_normal(eta), cosine, self.eta);
            reflected += tinted * ((1.0 - self.metallic) * self.spec_tint);
        }
        reflected
    }

    pub(super) fn value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        let is_front = eye.z > 0.0;
        let base = if is_front { self.base_value(eye, light) } else { Spectrum::ZERO };
        let Some(facing) = Facing::of(eye, light, self.eta) else { return base };
        let (m, rough) = (facing.m, self.facets());
        let fresnel = refract(eye, m, self.eta).reflectance;
        let shadowing = rough.masking(eye, m) * rough.masking(light, m);
        let common = rough.density(m) * shadowing / (eye.z * light.z).abs();
        if !facing.reflects {
            let glass = self.weights().1;
            let bent = facing.jacobian(eye, light) * eye.dot(m).abs() / (facing.eta * facing.eta);
            return self.base_color.map(float::safe_sqrt) * (glass * common * (1.0 - fresnel) * bent);
        }
        let mut value = base;
        if fresnel > 0.0 {
            value += self.reflectance(is_front, eye.dot(m), fresnel) * (0.25 * common);
        }
        if self.clearcoat > 0.0 && is_front {
            let coat = Roughness::even(Distribution::Ggx, COAT_SHADOWING);
            let shadowing = coat.masking(eye, m) * coat.masking(light, m);
            let reflected = schlick(Spectrum::splat(0.04), eye.dot(m), self.eta)[0];
            let value_of_coat = 0.25 * self.clearcoat * reflected * coat_density(self.coat_alpha(), m) * shadowing;
            value += Spectrum::splat(value_of_coat);
        }
        value
    }

    pub(super) fn pdf(&self, eye: Vec3, light: Vec3) -> f32 {
        let is_front = eye.z > 0.0;
        if !is_front && self.weights().1 <= 0.0 {
            return 0.0;
        }
        let reflects = eye.z * light.z > 0.0;
        let eta = if is_front { self.eta } else { 1.0 / self.eta };
        let Some(half) = (eye + light * if reflects { 1.0 } else { eta }).try_normalize() else { return 0.0 };
        let m = if half.z < 0.0 { -half } else { half };
        let lobes = self.lobes(is_front, refract(eye, m, self.eta).reflectance);
        let base = if reflects { lobes.diffuse * cosine_hemisphere_pdf(light.z.abs()) } else { 0.0 };
        let Some(facing) = Facing::of(eye, light, self.eta) else { return base };
        let (jacobian, seen) = (facing.jacobian(eye, light), self.facets().pdf(above(eye), m));
        if facing.reflects {
            let coat = if lobes.coat > 0.0 { lobes.coat * m.z * coat_density(self.coat_alpha(), m) } else { 0.0 };
            base + (lobes.reflected * seen + coat) * jacobian
        } else {
            lobes.transmitted * seen * jacobian
        }
    }

    pub(super) fn sample(&self, eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        let is_front = eye.z > 0.0;
        if !(eye.z.abs() > GRAZING) || !is_front && self.weights().1 <= 0.0 {
            return None;
        }
        // As probabilities depend on the facet, it is drawn first.
        let m = self.facets().sample(above(eye), u);
        let refraction = refract(eye, m, self.eta);
        let lobes = self.lobes(is_front, refraction.reflectance);
        let coat_from = lobes.diffuse;
        let transmitted_from = coat_from + lobes.coat;
        let reflected_from = transmitted_from + lobes.transmitted;
        let (to_light, reflects) = if choice < coat_from {
            (cosine_hemisphere(u), true)
        } else if choice < transmitted_from {
            let alpha2 = self.coat_alpha() * self.coat_alpha();
            let cos2 = ((1.0 - float::powf(alpha2, 1.0 - u.y)) / (1.0 - alpha2)).clamp(0.0, 1.0);
            let m = spherical(float::sqrt(cos2), float::sqrt(1.0 - cos2), u.x);
            // These are not drawn as they are seen: some are from behind.
            if eye.dot(m) <= 0.0 {
                return None;
            }
            (mirrored(eye, m), true)
        } else if choice < reflected_from {
            (refraction.transmitted?, false)
        } else {
            (mirrored(eye, m), true)
        };
        finished(eye, to_light, reflects, self.value(eye, to_light), self.pdf(eye, to_light))
    }
}

/// A sample of a direction that should be on one side, with its value and density.
#[inline]
fn finished(eye: Vec3, to_light: Vec3, reflects: bool, value: Spectrum, pdf: f32) -> Option<SurfaceSample> {
    let is_good = (eye.z * to_light.z > 0.0) == reflects && pdf > 0.0 && !value.is_black();
    is_good.then(|| SurfaceSample { to_light, weight: value * (to_light.z.abs() / pdf), pdf })
}

/// A thin sheet of many looks, the same from both sides: what passes is not bent. All numbers but [`PrincipledThin::eta`] and
/// [`PrincipledThin::diff_trans`] are in [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipledThin {
    /// Colour of the base.
    pub base_color: Spectrum,
    /// Square root of the specular lobe's roughness.
    pub roughness: f32,
    /// How much longer than wide highlights are, along [`PrincipledThin::tangent`].
    pub anisotropic: f32,
    /// From a diffuse sheet to a pane of rough glass.
    pub spec_trans: f32,
    /// Index of refraction of the sheet over that around (> 0).
    pub eta: f32,
    /// From white highlights to ones tinted by the base.
    pub spec_tint: f32,
    /// Light at grazing angles, as of cloth.
    pub sheen: f32,
    /// From white sheen to one tinted by the base.
    pub sheen_tint: f32,
    /// From the diffuse base to a fit of subsurface scattering.
    pub flatness: f32,
    /// How much of diffuse light passes, in [0, 2]: 1 as much as is reflected, 2 all.
    pub diff_trans: f32,
    /// Where roughness is least, in the world; zero: anywhere.
    pub tangent: Vec3,
}

impl Default for PrincipledThin {
    /// Grey, half rough, of index 1.5, and nothing else.
    fn default() -> Self {
        Self {
            base_color: Spectrum::splat(0.5),
            roughness: 0.5,
            anisotropic: 0.0,
            spec_trans: 0.0,
            eta: 1.5,
            spec_tint: 0.0,
            sheen: 0.0,
            sheen_tint: 0.0,
            flatness: 0.0,
            diff_trans: 0.0,
            tangent: Vec3::ZERO,
        }
    }
}

impl PrincipledThin {
    #[inline]
    pub(super) fn facets(&self) -> Roughness {
        facets(self.roughness, self.anisotropic, self.tangent)
    }

    /// Of light that passes: rougher or smoother by the index (Burley 2015, figure 15).
    fn far_facets(&self) -> Roughness {
        facets((0.65 * self.eta - 0.35) * self.roughness, self.anisotropic, self.tangent)
    }

    /// Half of what diffuse light there is goes to each side at 1.
    fn passes(&self) -> f32 {
        0.5 * self.diff_trans
    }

    pub(super) fn value(&self, eye: Vec3, light: Vec3) -> Spectrum {
        let (eye, light) = if eye.z < 0.0 { (-eye, -light) } else { (eye, light) };
        let near = Vec3::new(light.x, light.y, light.z.abs());
        if !(eye.z > GRAZING && near.z > GRAZING) {
            return Spectrum::ZERO;
        }
        let reflects = light.z > 0.0;
        let mut value = Spectrum::ZERO;
        if self.spec_trans > 0.0 {
            let rough = if reflects { self.facets() } else { self.far_facets() };
            // A facet has the sides that the sheet has.
            if let Some((m, specular)) = reflection(&rough, eye, near).filter(|(m, _)| reflects || light.dot(*m) < 0.0)
            {
                let cosine = eye.dot(m);
                let fresnel = refract(eye, m, self.eta).reflectance;
                value += if reflects {
                    let tinted = schlick(tint(self.base_color) * at_normal(self.eta), cosine, self.eta);
                    lerp(Spectrum::splat(fresnel), tinted, self.spec_tint) * (self.spec_trans * specular)
                } else {
                    self.base_color * (self.spec_trans * (1.0 - fresnel) * specular)
                };
            }
        }
        value + self.base_value(eye, near, reflects)
    }

    /// The diffuse part, with directions on one side.
    fn base_value(&self, eye: Vec3, near: Vec3, reflects: bool) -> Spectrum {
        let base = 1.0 - self.spec_trans;
        if !reflects {
            return self.base_color * (base * self.passes() / PI);
        }
        let Some(m) = (eye + near).try_normalize() else { return Spectrum::ZERO };
        let share = base * (1.0 - self.passes());
        let value = self.base_color * (share / PI * diffuse(self.roughness, self.flatness, eye, near, m));
        let colour = lerp(Spectrum::ONE, tint(self.base_color), self.sheen_tint);
        value + colour * (self.sheen * share * schlick_weight(m.dot(near).abs()))
    }

    /// Shares of samples: mirrored, passed on, diffusely reflected; the rest is diffusely passed on. Their sum is 1 as it stands.
    fn shares(&self) -> [f32; 3] {
        let base = 1.0 - self.spec_trans;
        [0.5 * self.spec_trans, 0.5 * self.spec_trans, base * (1.0 - self.passes())]
    }

    pub(super) fn pdf(&self, eye: Vec3, light: Vec3) -> f32 {
        let (eye, light) = if eye.z < 0.0 { (-eye, -light) } else { (eye, light) };
        let near = Vec3::new(light.x, light.y, light.z.abs());
        let [reflected, transmitted, diffuse] = self.shares();
        let (share, rough, base) = if light.z > 0.0 {
            (reflected, self.facets(), diffuse)
        } else {
            (transmitted, self.far_facets(), 1.0 - reflected - transmitted - diffuse)
        };
        let sides_agree = light.z > 0.0 || light.dot(eye + near) < 0.0;
        let specular = if share > 0.0 && sides_agree { share * reflection_pdf(&rough, eye, near) } else { 0.0 };
        specular + base.max(0.0) * cosine_hemisphere_pdf(near.z)
    }

    pub(super) fn sample(&self, eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        let front = above(eye);
        if !(front.z > GRAZING) {
            return None;
        }
        let [reflected, transmitted, diffuse] = self.shares();
        let turned = |v: Vec3| Vec3::new(v.x, v.y, -v.z);
        let (to_light, reflects) = if choice < reflected {
            (mirrored(front, self.facets().sample(front, u)), true)
        } else if choice < reflected + transmitted {
            let m = self.far_facets().sample(front, u);
            let to_light = turned(mirrored(front, m));
            if to_light.dot(m) >= 0.0 {
                return None;
            }
            (to_light, false)
        } else if choice < reflected + transmitted + diffuse {
            (cosine_hemisphere(u), true)
        } else {
            (turned(cosine_hemisphere(u)), false)
        };
        let to_light = if eye.z < 0.0 { -to_light } else { to_light };
        finished(eye, to_light, reflects, self.value(eye, to_light), self.pdf(eye, to_light))
    }
}
