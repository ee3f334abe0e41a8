//! Materials: surfaces with what varies them, and mixes of them.

use std::sync::Arc;

use fogbow::math::Vec3;
use fogbow::spectrum::Spectrum;
use fogbow::surface::specular::refract;
use fogbow::surface::{Conductor, Principled, PrincipledThin, RoughConductor, RoughDielectric, Surface};

use crate::texture::{self, Texture};

/// What a surface does to light, and on which sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// On the side of the normal; where textures vary it, with their means.
    pub surface: Surface,
    /// Whether both sides do the same.
    pub is_two_sided: bool,
    /// What varies over the surface.
    pub textures: Vec<(Slot, Arc<Texture>)>,
    /// What bends its normals.
    pub relief: Option<Relief>,
    /// Others, one of which is what it is at a hit; what stands above is then that of a typical one.
    pub mix: Option<Arc<Mix>>,
}

/// Several materials as one.
#[derive(Debug, Clone, PartialEq)]
pub enum Mix {
    /// The first on the side of the normal, the second on the other.
    Sides([Material; 2]),
    /// The second with a probability, else the first: unbiased wherever light is a sum over hits (decision 61).
    Blend {
        /// Probability, by luminance.
        weight: Arc<Texture>,
        /// Both.
        parts: [Material; 2],
    },
}

/// What bends the normals of a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Relief {
    /// How.
    pub form: ReliefForm,
    /// Whether normals that face away from the eye are turned about that of the surface; else it is black there.
    pub is_turned: bool,
}

/// How normals are bent.
#[derive(Debug, Clone, PartialEq)]
pub enum ReliefForm {
    /// A height (m) above the surface.
    Height {
        /// Luminance of the texture, times the factor.
        texture: Arc<Texture>,
        /// Factor.
        scale: f32,
    },
    /// Normals in the frame of the surface: `(x + 1)/2` in each channel.
    Normals(Arc<Texture>),
}

/// A parameter of a surface that a texture may give.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slot {
    /// Diffuse reflectance.
    Diffuse,
    /// Factor on light reflected as by a mirror.
    Specular,
    /// Factor on transmitted light.
    Transmitted,
    /// Roughness of facets, along and across.
    Alpha,
    /// Roughness of facets along the tangent.
    AlphaU,
    /// Roughness of facets across.
    AlphaV,
    /// [`Principled::roughness`].
    Roughness,
    /// [`Principled::anisotropic`].
    Anisotropic,
    /// [`Principled::metallic`].
    Metallic,
    /// [`Principled::spec_trans`].
    SpecTrans,
    /// [`Principled::spec_tint`].
    SpecTint,
    /// [`Principled::sheen`].
    Sheen,
    /// [`Principled::sheen_tint`].
    SheenTint,
    /// [`Principled::flatness`].
    Flatness,
    /// [`Principled::clearcoat`].
    Clearcoat,
    /// [`Principled::clearcoat_gloss`].
    ClearcoatGloss,
    /// [`PrincipledThin::diff_trans`], in [0, 2].
    DiffTrans,
}

impl Slot {
    /// Whether it is a colour, not a number.
    #[must_use]
    pub fn is_colour(self) -> bool {
        matches!(self, Self::Diffuse | Self::Specular | Self::Transmitted)
    }

    /// Sets the parameter; surfaces without it stay as they are.
    pub fn put(self, surface: &mut Surface, value: Spectrum) {
        let share = value.max(Spectrum::ZERO).min(Spectrum::ONE);
        let number = luminance(share);
        match (self, surface) {
            (Self::DiffTrans, Surface::PrincipledThin(sheet)) => sheet.diff_trans = luminance(value).clamp(0.0, 2.0),
            (slot, Surface::Principled(body)) => slot.put_in_body(body, share, number),
            (slot, Surface::PrincipledThin(sheet)) => slot.put_in_sheet(sheet, share, number),
            (slot @ (Self::Alpha | Self::AlphaU | Self::AlphaV), surface) => {
                let (Surface::RoughConductor(RoughConductor { roughness, .. })
                | Surface::RoughDielectric(RoughDielectric { roughness, .. })) = surface
                else {
                    return;
                };
                if slot != Self::AlphaV {
                    roughness.alpha[0] = number;
                }
                if slot != Self::AlphaU {
                    roughness.alpha[1] = number;
                }
            }
            (Self::Diffuse, Surface::Lambert { reflectance }) => *reflectance = share,
            (
                Self::Specular,
                Surface::Mirror { reflectance }
                | Surface::Dielectric { reflectance, .. }
                | Surface::ThinDielectric { reflectance, .. }
                | Surface::Conductor(Conductor { reflectance, .. })
                | Surface::RoughConductor(RoughConductor { conductor: Conductor { reflectance, .. }, .. })
                | Surface::RoughDielectric(RoughDielectric { reflectance, .. }),
            ) => *reflectance = share,
            (
                Self::Transmitted,
                Surface::Dielectric { transmittance, .. }
                | Surface::ThinDielectric { transmittance, .. }
                | Surface::RoughDielectric(RoughDielectric { transmittance, .. }),
            ) => *transmittance = share,
            (Self::Diffuse, Surface::Plastic(plastic)) => plastic.diffuse = share,
            (Self::Specular, Surface::Plastic(plastic)) => plastic.specular = share,
            (Self::Diffuse, Surface::RoughPlastic(rough)) => {
                *rough = rough.with_colours(share, rough.plastic().specular)
            }
            (Self::Specular, Surface::RoughPlastic(rough)) => {
                *rough = rough.with_colours(rough.plastic().diffuse, share)
            }
            // Both together must not reflect more than all light.
            (Self::Diffuse, Surface::Phong { diffuse, specular, .. }) => {
                *diffuse = share.min(Spectrum::ONE - *specular)
            }
            (Self::Specular, Surface::Phong { diffuse, specular, .. }) => {
                *specular = share.min(Spectrum::ONE - *diffuse)
            }
            _ => {}
        }
    }

    fn put_in_body(self, body: &mut Principled, colour: Spectrum, number: f32) {
        match self {
            Self::Diffuse => body.base_color = colour,
            Self::Roughness => body.roughness = number,
            Self::Anisotropic => body.anisotropic = number,
            Self::Metallic => body.metallic = number,
            Self::SpecTrans => body.spec_trans = number,
            Self::SpecTint => body.spec_tint = number,
            Self::Sheen => body.sheen = number,
            Self::SheenTint => body.sheen_tint = number,
            Self::Flatness => body.flatness = number,
            Self::Clearcoat => body.clearcoat = number,
            Self::ClearcoatGloss => body.clearcoat_gloss = number,
            Self::Specular | Self::Transmitted | Self::Alpha | Self::AlphaU | Self::AlphaV | Self::DiffTrans => {}
        }
    }

    fn put_in_sheet(self, sheet: &mut PrincipledThin, colour: Spectrum, number: f32) {
        match self {
            Self::Diffuse => sheet.base_color = colour,
            Self::Roughness => sheet.roughness = number,
            Self::Anisotropic => sheet.anisotropic = number,
            Self::SpecTrans => sheet.spec_trans = number,
            Self::SpecTint => sheet.spec_tint = number,
            Self::Sheen => sheet.sheen = number,
            Self::SheenTint => sheet.sheen_tint = number,
            Self::Flatness => sheet.flatness = number,
            Self::Specular | Self::Transmitted | Self::Alpha | Self::AlphaU | Self::AlphaV => {}
            Self::Metallic | Self::Clearcoat | Self::ClearcoatGloss | Self::DiffTrans => {}
        }
    }
}

/// What a material is at a hit.
#[derive(Debug)]
pub struct Chosen<'m> {
    /// Of the materials mixed, this.
    pub material: &'m Material,
    /// With textures looked up.
    pub surface: Surface,
    /// Whether it, or what it is mixed in, does the same on both sides.
    pub is_two_sided: bool,
    /// A number in [0, 1), as good as random, that nothing has been decided by.
    pub share: f32,
}

impl Chosen<'_> {
    /// A thin pane that tints nothing as what it is to this light, which comes from `to_eye` (unit): a mirror, nothing at all, or black. What
    /// goes straight through is not turned, so rays to lights pass as well, and it does not count as scattered (decision 77).
    #[must_use]
    pub fn pane(&self, normal: Vec3, to_eye: Vec3) -> Option<Surface> {
        let Surface::ThinDielectric { eta, reflectance, transmittance } = self.surface else { return None };
        if transmittance != Spectrum::splat(transmittance[0]) {
            return None;
        }
        let facing = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        let once = refract(to_eye, facing, eta).reflectance;
        let reflected = 2.0 * once / (1.0 + once);
        Some(if self.share < reflected {
            Surface::Mirror { reflectance }
        } else if self.share < reflected + (1.0 - reflected) * transmittance[0] {
            Surface::Null
        } else {
            Surface::BLACK
        })
    }
}

impl Material {
    /// Of one surface that is the same everywhere.
    #[must_use]
    pub fn plain(surface: Surface) -> Self {
        Self { surface, is_two_sided: false, textures: Vec::new(), relief: None, mix: None }
    }

    /// What the surface does to light at a place, if it is no mix.
    #[must_use]
    pub fn surface_at(&self, place: &texture::Place<'_>) -> Surface {
        let mut surface = self.surface;
        for (slot, texture) in &self.textures {
            let value = if slot.is_colour() { texture.at(place) } else { texture.number_at(place) };
            slot.put(&mut surface, value);
        }
        surface
    }

    /// All materials that it may be.
    #[must_use]
    pub fn leaves(&self) -> Vec<&Self> {
        match self.mix.as_deref() {
            None => vec![self],
            Some(Mix::Sides(parts) | Mix::Blend { parts, .. }) => parts.iter().flat_map(Self::leaves).collect(),
        }
    }

    /// Whether light passes at least one that it may be.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.leaves().iter().any(|leaf| leaf.surface.transmits())
    }

    /// Whether a hit has to be told apart from others.
    #[must_use]
    pub fn varies(&self) -> bool {
        !self.textures.is_empty()
            || self.relief.is_some()
            || self.mix.is_some()
            || self.has_tangent()
            || self.has_panes()
    }

    /// Whether it may be a thin pane.
    #[must_use]
    pub fn has_panes(&self) -> bool {
        self.leaves().iter().any(|leaf| matches!(leaf.surface, Surface::ThinDielectric { .. }))
    }

    /// Whether it wants to know how texture coordinates lie.
    #[must_use]
    pub fn has_tangent(&self) -> bool {
        let is_uneven = |leaf: &Self| match leaf.surface {
            Surface::RoughConductor(RoughConductor { roughness, .. })
            | Surface::RoughDielectric(RoughDielectric { roughness, .. }) => {
                roughness.alpha[0] != roughness.alpha[1]
                    || leaf.textures.iter().any(|(slot, _)| matches!(slot, Slot::AlphaU | Slot::AlphaV))
            }
            Surface::Principled(Principled { anisotropic, .. })
            | Surface::PrincipledThin(PrincipledThin { anisotropic, .. }) => {
                anisotropic > 0.0 || leaf.textures.iter().any(|(slot, _)| *slot == Slot::Anisotropic)
            }
            _ => false,
        };
        self.leaves().into_iter().any(|leaf| leaf.relief.is_some() || is_uneven(leaf))
    }

    /// What it is at a place, seen from the front or not. `share`, in [0, 1), decides between what is blended; it must differ
    /// from hit to hit.
    #[must_use]
    pub fn chosen(&self, place: &texture::Place<'_>, is_front: bool, mut share: f32) -> Chosen<'_> {
        let (mut material, mut is_two_sided) = (self, self.is_two_sided);
        while let Some(mix) = material.mix.as_deref() {
            material = match mix {
                Mix::Sides([front, back]) => {
                    if is_front {
                        front
                    } else {
                        back
                    }
                }
                Mix::Blend { weight, parts: [first, second] } => {
                    let weight = luminance(weight.number_at(place)).clamp(0.0, 1.0);
                    if let Some(surface) = blended(first, second, weight, place) {
                        is_two_sided |= first.is_two_sided;
                        return Chosen { material: first, surface, is_two_sided, share };
                    }
                    if share < weight {
                        share /= weight;
                        second
                    } else {
                        share = (share - weight) / (1.0 - weight);
                        first
                    }
                }
            };
            is_two_sided |= material.is_two_sided;
        }
        Chosen { material, surface: material.surface_at(place), is_two_sided, share }
    }
}

/// Two diffuse materials are one that is between them: nothing need be chosen.
fn blended(first: &Material, second: &Material, weight: f32, place: &texture::Place<'_>) -> Option<Surface> {
    let is_plain = |material: &Material| {
        matches!(material.surface, Surface::Lambert { .. }) && material.mix.is_none() && material.relief.is_none()
    };
    if !(is_plain(first) && is_plain(second)) || first.is_two_sided != second.is_two_sided {
        return None;
    }
    let [first, second] = [first, second].map(|material| material.surface_at(place).albedo());
    Some(Surface::Lambert { reflectance: first * (1.0 - weight) + second * weight })
}

/// Of a colour, what the eye sees of it (ITU-R BT.709).
fn luminance(colour: Spectrum) -> f32 {
    0.212_671 * colour[0] + 0.715_16 * colour[1] + 0.072_169 * colour[2]
}
