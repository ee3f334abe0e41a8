//! Materials: what a surface does to light, and what it sends out.

use std::collections::HashMap;
use std::sync::Arc;

use ::gltf::Document;
use ::gltf::material::AlphaMode;
use ::gltf::texture::{MagFilter, WrappingMode};
use fogbow::spectrum::Spectrum;
use fogbow::surface::{
    Conductor, Distribution, Plastic, RoughConductor, RoughDielectric, RoughPlastic, Roughness, Surface,
};

use super::data::{Channel, Data};
use super::{Source, label};
use crate::picture::Picture;
use crate::scene_file::material::{Material, Mix, Slot};
use crate::scene_file::notes::NoteKind;
use crate::texture::{Texture, ToUv, Wrap};

/// A material, ready for shapes.
#[derive(Debug, Clone)]
pub(super) struct Ready {
    pub(super) surface: Material,
    pub(super) radiance: Option<Spectrum>,
    /// What that varies by, where it does.
    pub(super) glow: Option<Arc<Texture>>,
    /// What absorbs light within (m⁻¹).
    pub(super) attenuation: Option<Spectrum>,
    /// Which of the texture coordinates of a mesh its textures are looked up with.
    pub(super) texcoords: Option<u32>,
}

/// All materials of a document.
pub(super) struct Materials {
    all: HashMap<Option<usize>, Ready>,
}

impl Materials {
    pub(super) fn new(source: &Source<'_>, document: &Document, data: &Data) -> Self {
        let mut reader = Reader { source, data, pictures: HashMap::new() };
        let all = document.materials().map(|material| (material.index(), reader.material(&material))).collect();
        Self { all }
    }

    /// The one of a primitive; white where it has none.
    pub(super) fn of(&self, material: &::gltf::Material<'_>) -> Ready {
        self.all.get(&material.index()).cloned().unwrap_or_else(|| Ready {
            surface: Material {
                is_two_sided: true,
                ..Material::plain(Surface::Lambert { reflectance: Spectrum::ONE })
            },
            radiance: None,
            glow: None,
            attenuation: None,
            texcoords: None,
        })
    }
}

struct Reader<'a> {
    source: &'a Source<'a>,
    data: &'a Data,
    /// Pictures by their index and by what of them is meant.
    pictures: HashMap<(usize, Channel), Option<Arc<Picture>>>,
}

/// Share of transmitted light, and of metal, from which a surface counts as glass or as metal.
const MOSTLY: f32 = 0.5;

/// Roughness below which a surface is smooth: lobes become narrower than what a picture shows.
const SMOOTH: f32 = 0.05;

/// Index of refraction of everything that does not say another.
const IOR: f32 = 1.5;

impl Reader<'_> {
    fn material(&mut self, material: &::gltf::Material<'_>) -> Ready {
        let element = label("material", material.index().unwrap_or_default(), material.name());
        let source = self.source;
        let note = |kind: NoteKind, reason: &str| source.note(kind, &*element, reason);
        let pbr = material.pbr_metallic_roughness();
        let [r, g, b, _] = pbr.base_color_factor();
        let base = Spectrum([r, g, b]).max(Spectrum::ZERO).min(Spectrum::ONE);
        let (mut metallic, mut roughness) = (pbr.metallic_factor(), pbr.roughness_factor());
        if let Some(texture) = pbr.metallic_roughness_texture().and_then(|info| self.texture(&info, Channel::Numbers)) {
            let [_, green, blue] = texture.mean().0;
            (metallic, roughness) = (metallic * blue, roughness * green);
            note(NoteKind::Replaced, "metallicRoughnessTexture: its means, everywhere");
        }
        for (name, is_there) in [
            ("normalTexture", material.normal_texture().is_some()),
            ("occlusionTexture", material.occlusion_texture().is_some()),
        ] {
            if is_there {
                note(NoteKind::Ignored, &format!("{name} has no effect"));
            }
        }
        let mut texcoords = None;
        let texture = pbr.base_color_texture().and_then(|info| {
            texcoords = Some(info.tex_coord());
            self.texture(&info, Channel::Colour)
        });
        let mean = texture.as_ref().map_or(Spectrum::ONE, |texture| texture.mean());
        let colour = base * mean.max(Spectrum::ZERO).min(Spectrum::ONE);
        let scaled = |slot: Slot| texture.clone().map(|t| (slot, Arc::new(Texture::Scaled(t, base))));
        let transmission = material.transmission().map_or(0.0, |t| t.transmission_factor());
        let eta = material.ior().unwrap_or(IOR);
        let eta = if eta > 0.0 && eta.is_finite() { eta } else { IOR };
        let (one, is_smooth) = (Spectrum::ONE, roughness < SMOOTH);
        let facets = Roughness::even(Distribution::Ggx, (roughness * roughness).clamp(0.0, 1.0));
        let (surface, textures, is_two_sided) = if transmission > MOSTLY {
            let surface = if material.volume().is_none_or(|volume| volume.thickness_factor() <= 0.0) {
                if !is_smooth {
                    note(NoteKind::Replaced, "a thin pane of rough glass: smooth");
                }
                Surface::ThinDielectric { eta, reflectance: one, transmittance: colour }
            } else if is_smooth || eta == 1.0 {
                Surface::Dielectric { eta, reflectance: one, transmittance: colour }
            } else {
                let glass = RoughDielectric { eta, reflectance: one, transmittance: colour, roughness: facets };
                Surface::RoughDielectric(glass)
            };
            (surface, scaled(Slot::Transmitted), false)
        } else if metallic > MOSTLY {
            let surface = if is_smooth {
                Surface::Mirror { reflectance: colour }
            } else {
                Surface::RoughConductor(RoughConductor { conductor: Conductor::mirror(colour), roughness: facets })
            };
            (surface, scaled(Slot::Specular), true)
        } else {
            let plastic = Plastic { eta, diffuse: colour, specular: one, nonlinear: false };
            let surface = if roughness >= 1.0 || eta == 1.0 {
                Surface::Lambert { reflectance: colour }
            } else if is_smooth {
                Surface::Plastic(plastic)
            } else {
                Surface::RoughPlastic(RoughPlastic::new(plastic, Distribution::Ggx, roughness * roughness))
            };
            (surface, scaled(Slot::Diffuse), true)
        };
        if (0.1..0.9).contains(&metallic) && transmission <= MOSTLY {
            note(NoteKind::Replaced, "half a metal: what it is mostly");
        }
        let emitted = Spectrum(material.emissive_factor()) * material.emissive_strength().unwrap_or(1.0);
        let shown = material
            .emissive_texture()
            .and_then(|info| Some((info.tex_coord(), self.texture(&info, Channel::Colour)?)));
        let mut glow = None;
        let emitted = match shown {
            Some((set, texture)) => {
                let mean = emitted * texture.mean().max(Spectrum::ZERO);
                if *texcoords.get_or_insert(set) == set {
                    glow = Some(Arc::new(Texture::Scaled(texture, emitted)));
                } else {
                    note(
                        NoteKind::Replaced,
                        "emissiveTexture by other coordinates than the base colour: its mean, everywhere",
                    );
                }
                mean
            }
            None => emitted,
        };
        let radiance = (emitted.is_valid() && !emitted.is_black()).then_some(emitted);
        // What shines and lets light pass is something no light here is.
        let is_glass = transmission > MOSTLY;
        let surface = if radiance.is_some() && is_glass { Surface::BLACK } else { surface };
        let whole = Material { is_two_sided, textures: textures.into_iter().collect(), ..Material::plain(surface) };
        let opacity = self.opacity(material, &mut texcoords);
        let surface = match opacity {
            Some(_) if radiance.is_some() => {
                note(NoteKind::Replaced, "alpha of what shines: it is opaque");
                whole
            }
            Some(weight) => {
                let parts = [Material::plain(Surface::Null), whole];
                Material { mix: Some(Arc::new(Mix::Blend { weight, parts })), ..Material::plain(surface) }
            }
            None => whole,
        };
        Ready {
            surface,
            radiance,
            glow: glow.filter(|_| radiance.is_some()),
            attenuation: material.volume().filter(|_| is_glass).and_then(|volume| attenuation(&volume)),
            texcoords,
        }
    }

    /// How opaque it is, where it is not everywhere.
    fn opacity(&mut self, material: &::gltf::Material<'_>, texcoords: &mut Option<u32>) -> Option<Arc<Texture>> {
        let pbr = material.pbr_metallic_roughness();
        let cutoff = match material.alpha_mode() {
            AlphaMode::Opaque => return None,
            AlphaMode::Mask => Some(material.alpha_cutoff().unwrap_or(0.5)),
            AlphaMode::Blend => None,
        };
        let factor = pbr.base_color_factor()[3].clamp(0.0, 1.0);
        let weight = |alpha: f32| match cutoff {
            Some(cutoff) => f32::from(u8::from(alpha * factor >= cutoff)),
            None => alpha * factor,
        };
        let texture = pbr.base_color_texture().and_then(|info| {
            *texcoords = Some(info.tex_coord());
            self.texture(&info, Channel::Opacity)
        });
        let texture = match texture.as_deref() {
            Some(Texture::Bitmap { picture, wrap, is_smooth, to_uv }) => {
                let pixels = picture.pixels.iter().map(|p| p.map(weight)).collect();
                let picture = Arc::new(Picture { width: picture.width, height: picture.height, pixels });
                // What is there or not has no values between.
                let is_smooth = *is_smooth && cutoff.is_none();
                Texture::Bitmap { picture, wrap: *wrap, is_smooth, to_uv: *to_uv }
            }
            _ => Texture::Constant(Spectrum::splat(weight(1.0))),
        };
        (texture.mean() != Spectrum::ONE).then(|| Arc::new(texture))
    }

    /// A texture; `None`, and a kept error, where its picture cannot be read.
    fn texture(&mut self, info: &::gltf::texture::Info<'_>, channel: Channel) -> Option<Arc<Texture>> {
        let texture = info.texture();
        let image = texture.source();
        let (source, data) = (self.source, self.data);
        let picture = self.pictures.entry((image.index(), channel));
        let picture =
            picture.or_insert_with(|| source.sink.keep(data.picture(source, &image, channel)).map(Arc::new)).clone()?;
        let sampler = texture.sampler();
        let wrap = match sampler.wrap_s() {
            WrappingMode::Repeat => Wrap::Repeat,
            WrappingMode::MirroredRepeat => Wrap::Mirror,
            WrappingMode::ClampToEdge => Wrap::Clamp,
        };
        if sampler.wrap_s() != sampler.wrap_t() {
            let element = label("texture", texture.index(), texture.name());
            source.note(NoteKind::Replaced, element, "wraps in two ways: as along u");
        }
        let to_uv = info.texture_transform().map_or(ToUv::IDENTITY, |t| {
            // Scaled, turned, moved.
            let ([x, y], [dx, dy], (sin, cos)) = (t.scale(), t.offset(), t.rotation().sin_cos());
            ToUv { rows: [[cos * x, sin * y, dx], [-sin * x, cos * y, dy]] }
        });
        let is_smooth = sampler.mag_filter() != Some(MagFilter::Nearest);
        Some(Arc::new(Texture::Bitmap { picture, wrap, is_smooth, to_uv }))
    }
}

/// `−ln(colour)/distance`: a white light has that colour when it has gone so far. `None` where nothing is absorbed, or nothing is within.
fn attenuation(volume: &::gltf::material::Volume<'_>) -> Option<Spectrum> {
    // Black would absorb everything at once.
    let share = Spectrum(volume.attenuation_color()).max(Spectrum::splat(1e-6)).min(Spectrum::ONE);
    let absorption = share.map(|c| -c.ln() / volume.attenuation_distance());
    let is_thick = volume.thickness_factor() > 0.0;
    (is_thick && absorption.is_valid() && !absorption.is_black()).then_some(absorption)
}
