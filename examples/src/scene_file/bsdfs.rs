//! Kinds of `<bsdf>` with facets, coats and metals, and what of their names is known but not read.

use std::collections::HashMap;
use std::sync::{LazyLock, Mutex, PoisonError};

use fogbow::spectrum::Spectrum;
use fogbow::surface::{
    Conductor, Distribution, Plastic, Principled, PrincipledThin, RoughConductor, RoughDielectric, RoughPlastic,
    Roughness, Surface,
};

use super::material::Slot;
use super::materials::index_of_refraction;
use super::metals::METALS;
use super::plugin::Plugin;
use crate::error::SceneError;

/// Asks for a colour within [0, 1] by name, with a default; a texture may stand there.
pub(super) type Share<'s> = dyn FnMut(&str, Spectrum, Slot) -> Result<Spectrum, SceneError> + 's;

/// Index of refraction of what coats plastic: polypropylene.
const COAT: f64 = 1.49;

/// Index of refraction of glass: BK7.
const GLASS: f64 = 1.5046;

/// The surface of a `<bsdf>` of one of these kinds; `None` for others.
pub(super) fn read(plugin: &Plugin<'_>, share: &mut Share<'_>) -> Result<Option<Surface>, SceneError> {
    let (one, half) = (Spectrum::ONE, Spectrum::splat(0.5));
    Ok(Some(match plugin.kind.as_str() {
        "conductor" => {
            let metal = metal(plugin, share)?;
            if metal == Conductor::mirror(metal.reflectance) {
                Surface::Mirror { reflectance: metal.reflectance }
            } else {
                Surface::Conductor(metal)
            }
        }
        "roughconductor" => {
            let (conductor, roughness) = (metal(plugin, share)?, roughness(plugin, share)?);
            Surface::RoughConductor(RoughConductor { conductor, roughness })
        }
        "roughdielectric" => {
            let roughness = roughness(plugin, share)?;
            let eta = relative_index(plugin, GLASS)?;
            let reflectance = share("specular_reflectance", one, Slot::Specular)?;
            let transmittance = share("specular_transmittance", one, Slot::Transmitted)?;
            if eta == 1.0 {
                return Err(plugin.element.error("int_ior and ext_ior are the same: nothing would be refracted"));
            }
            Surface::RoughDielectric(RoughDielectric { eta, reflectance, transmittance, roughness })
        }
        "thindielectric" => Surface::ThinDielectric {
            eta: relative_index(plugin, GLASS)?,
            reflectance: share("specular_reflectance", one, Slot::Specular)?,
            transmittance: share("specular_transmittance", one, Slot::Transmitted)?,
        },
        kind @ ("plastic" | "roughplastic" | "pplastic") => {
            let plastic = Plastic {
                eta: relative_index(plugin, COAT)?,
                diffuse: share("diffuse_reflectance", half, Slot::Diffuse)?,
                specular: share("specular_reflectance", one, Slot::Specular)?,
                nonlinear: kind != "pplastic" && plugin.boolean("nonlinear", false)?,
            };
            if kind == "plastic" {
                return Ok(Some(Surface::Plastic(plastic)));
            }
            if kind == "pplastic" {
                plugin.element.ignored("light is not polarised here: taken for a roughplastic");
            }
            if plugin.get("alpha").is_some_and(|alpha| alpha.tag() == "texture") {
                return Err(plugin
                    .element
                    .error("the coat of rough plastic is as rough everywhere: alpha cannot be a texture"));
            }
            let Roughness { distribution, alpha: [u, v], .. } = roughness(plugin, share)?;
            if u != v {
                return Err(plugin
                    .element
                    .error("rough plastic is as rough along as across: alpha_u and alpha_v differ"));
            }
            Surface::RoughPlastic(coated(plastic, distribution, u))
        }
        "principled" => Surface::Principled(principled(plugin, share)?),
        "principledthin" => Surface::PrincipledThin(principled_thin(plugin, share)?),
        _ => return Ok(None),
    }))
}

/// A number within [0, 1] by name; a texture may stand there.
fn part(share: &mut Share<'_>, name: &str, default: f32, slot: Slot) -> Result<f32, SceneError> {
    // Of a colour, the middle channel is nearest to what the eye sees; numbers have all channels the same.
    Ok(share(name, Spectrum::splat(default), slot)?[1])
}

/// Rates that shift samples between lobes: they change noise alone.
fn skip_rates(plugin: &Plugin<'_>, names: &[&str]) -> Result<(), SceneError> {
    names.iter().try_for_each(|name| plugin.number(name).map(drop))
}

fn principled(plugin: &Plugin<'_>, share: &mut Share<'_>) -> Result<Principled, SceneError> {
    skip_rates(
        plugin,
        &["main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate"],
    )?;
    let default = Principled::default();
    let spec_trans = part(share, "spec_trans", 0.0, Slot::SpecTrans)?;
    let has_glass = plugin.get("spec_trans").is_some();
    let eta = match (plugin.number("eta")?, plugin.get("specular").is_some()) {
        (Some((_, element)), true) => return Err(element.error("either eta can be given, or specular")),
        (Some(_), false) => plugin.number_in("eta", 1.5, 0.1..=10.0)? as f32,
        // Glass must bend light a little.
        (None, _) => {
            let specular = plugin.number_in("specular", 0.5, 0.0..=1.0)? as f32;
            Principled::eta_of(if has_glass { specular.max(1e-3) } else { specular })
        }
    };
    Ok(Principled {
        base_color: share("base_color", default.base_color, Slot::Diffuse)?,
        roughness: part(share, "roughness", 0.5, Slot::Roughness)?,
        anisotropic: part(share, "anisotropic", 0.0, Slot::Anisotropic)?,
        metallic: part(share, "metallic", 0.0, Slot::Metallic)?,
        spec_trans,
        eta: if has_glass && eta == 1.0 { 1.001 } else { eta },
        spec_tint: part(share, "spec_tint", 0.0, Slot::SpecTint)?,
        sheen: part(share, "sheen", 0.0, Slot::Sheen)?,
        sheen_tint: part(share, "sheen_tint", 0.0, Slot::SheenTint)?,
        flatness: part(share, "flatness", 0.0, Slot::Flatness)?,
        clearcoat: part(share, "clearcoat", 0.0, Slot::Clearcoat)?,
        clearcoat_gloss: part(share, "clearcoat_gloss", 0.0, Slot::ClearcoatGloss)?,
        ..default
    })
}

fn principled_thin(plugin: &Plugin<'_>, share: &mut Share<'_>) -> Result<PrincipledThin, SceneError> {
    skip_rates(
        plugin,
        &[
            "specular_reflectance_sampling_rate",
            "specular_transmittance_sampling_rate",
            "diffuse_transmittance_sampling_rate",
            "diffuse_reflectance_sampling_rate",
        ],
    )?;
    let default = PrincipledThin::default();
    let is_number = plugin.get("diff_trans").is_some_and(|element| element.tag() == "float");
    let diff_trans = if is_number {
        plugin.number_in("diff_trans", 0.0, 0.0..=2.0)? as f32
    } else {
        part(share, "diff_trans", 0.0, Slot::DiffTrans)?
    };
    Ok(PrincipledThin {
        base_color: share("base_color", default.base_color, Slot::Diffuse)?,
        roughness: part(share, "roughness", 0.5, Slot::Roughness)?,
        anisotropic: part(share, "anisotropic", 0.0, Slot::Anisotropic)?,
        spec_trans: part(share, "spec_trans", 0.0, Slot::SpecTrans)?,
        eta: plugin.number_in("eta", 1.5, 0.1..=10.0)? as f32,
        spec_tint: part(share, "spec_tint", 0.0, Slot::SpecTint)?,
        sheen: part(share, "sheen", 0.0, Slot::Sheen)?,
        sheen_tint: part(share, "sheen_tint", 0.0, Slot::SheenTint)?,
        flatness: part(share, "flatness", 0.0, Slot::Flatness)?,
        diff_trans,
        ..default
    })
}

/// Coats that have been integrated, by the bits of index and roughness: shapes that share a bsdf each read it.
type Coats = HashMap<(u32, u32, bool, bool), RoughPlastic>;

fn coated(plastic: Plastic, distribution: Distribution, alpha: f32) -> RoughPlastic {
    static COATS: LazyLock<Mutex<Coats>> = LazyLock::new(Mutex::default);
    let key = (plastic.eta.to_bits(), alpha.to_bits(), distribution == Distribution::Ggx, plastic.nonlinear);
    let make = || RoughPlastic::new(plastic, distribution, alpha);
    // A thread that has panicked has left nothing half done here.
    let mut coats = COATS.lock().unwrap_or_else(PoisonError::into_inner);
    coats.entry(key).or_insert_with(make).with_colours(plastic.diffuse, plastic.specular)
}

/// The index inside over that outside.
fn relative_index(plugin: &Plugin<'_>, inside: f64) -> Result<f32, SceneError> {
    let inside = index_of_refraction(plugin, "int_ior", inside)?;
    Ok((inside / index_of_refraction(plugin, "ext_ior", 1.000_277)?) as f32)
}

/// `material`, or `eta` and `k`; a perfect mirror if there is neither.
fn metal(plugin: &Plugin<'_>, share: &mut Share<'_>) -> Result<Conductor, SceneError> {
    let reflectance = share("specular_reflectance", Spectrum::ONE, Slot::Specular)?;
    let mirror = Conductor::mirror(reflectance);
    let (eta, k) = (plugin.colour("eta")?, plugin.colour("k")?);
    let named = plugin.string("material")?.filter(|(name, _)| name != "none");
    let metal = match named {
        Some((_, element)) if eta.is_some() || k.is_some() => {
            return Err(element.error("a material is named; \"eta\" and \"k\" cannot be given, too"));
        }
        Some((name, element)) => {
            let Some((_, eta, k)) = METALS.iter().find(|(known, ..)| *known == name) else {
                let known: Vec<_> = METALS.iter().map(|(known, ..)| *known).collect();
                return Err(
                    element.attribute_error("value", format!("\"{name}\" is none of: none, {}", known.join(", ")))
                );
            };
            Conductor { eta: Spectrum(*eta), k: Spectrum(*k), reflectance }
        }
        None => {
            let or = |given: Option<(Spectrum, _)>, default| given.map_or(default, |(value, _)| value);
            Conductor { eta: or(eta, mirror.eta), k: or(k, mirror.k), reflectance }
        }
    };
    // The index of what is outside divides both.
    let outside = index_of_refraction(plugin, "ext_eta", 1.0)? as f32;
    Ok(Conductor { eta: metal.eta / outside, k: metal.k / outside, ..metal })
}

/// `distribution`, and `alpha` or `alpha_u` and `alpha_v`.
fn roughness(plugin: &Plugin<'_>, share: &mut Share<'_>) -> Result<Roughness, SceneError> {
    let distribution = match plugin.word("distribution", &["beckmann", "ggx"])? {
        "ggx" => Distribution::Ggx,
        _ => Distribution::Beckmann,
    };
    // Normals are drawn as they are seen, whatever this says: it changes noise alone.
    plugin.boolean("sample_visible", true)?;
    let mut alpha = |name, slot| match plugin.get(name) {
        Some(element) if element.tag() == "texture" => part(share, name, 0.1, slot),
        _ => plugin.number_in(name, 0.1, 0.0..=10.0).map(|alpha| alpha as f32),
    };
    let (u, v) = (plugin.get("alpha_u").is_some(), plugin.get("alpha_v").is_some());
    if u != v {
        return Err(plugin.element.error("alpha_u and alpha_v must both be given, or neither"));
    }
    if u && plugin.get("alpha").is_some() {
        return Err(plugin.element.error("either alpha can be given, or alpha_u and alpha_v"));
    }
    let alpha = if u {
        [alpha("alpha_u", Slot::AlphaU)?, alpha("alpha_v", Slot::AlphaV)?]
    } else {
        [alpha("alpha", Slot::Alpha)?; 2]
    };
    Ok(Roughness { alpha, ..Roughness::even(distribution, 0.0) })
}

/// Why a kind of `<bsdf>` that other programs know is not read.
pub(super) fn reason(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "measured" | "measured_polarized" => {
            "measured materials are not read: \"roughconductor\" or \"principled\" may come near"
        }
        "polarizer" | "retarder" | "circular" => {
            "light is not polarised here, so there is nothing that this could change rightly"
        }
        "hair" => "hair is not read: it needs curves, and a model of their fibres",
        _ => return None,
    })
}
