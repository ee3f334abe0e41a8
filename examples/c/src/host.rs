//! What the host answers by callbacks: surfaces and media, and the checks of what it answers.

use core::ffi::c_void;

use fogbow::host::{Hit, MajorantSegment, Medium, Properties, Scene};
use fogbow::math::{Ray, Vec3};
use fogbow::phase::{Lobe, Phase};
use fogbow::spectrum::Spectrum;
use fogbow::surface::{Conductor, Distribution, Plastic, RoughConductor, RoughDielectric, Roughness, Surface};

use crate::arguments::{self, Versioned, is_unit};
use crate::status::{Outcome, complain, refused, wrong};

/// A box along the axes (m).
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_box {
    /// Least coordinates.
    pub lower: [f32; 3],
    /// Greatest coordinates; each above the least one.
    pub upper: [f32; 3],
}

/// A ray. Fixed for ever: arrays of it cross the interface.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_ray {
    /// Where it begins (m).
    pub origin: [f32; 3],
    /// Where it goes (unit).
    pub direction: [f32; 3],
    /// How far (m); may be infinite.
    pub length: f32,
}

/// Light in three channels.
pub(crate) type Rgb = [f32; 3];

impl fogbow_ray {
    pub(crate) fn of(ray: &Ray) -> Self {
        Self { origin: ray.origin.to_array(), direction: ray.direction.to_array(), length: ray.length }
    }

    fn is_sound(&self) -> bool {
        // NaN is no length.
        Vec3::from_array(self.origin).is_finite() && is_unit(Vec3::from_array(self.direction)) && self.length >= 0.0
    }

    pub(crate) fn to_ray(self) -> Ray {
        Ray { origin: Vec3::from_array(self.origin), direction: Vec3::from_array(self.direction), length: self.length }
    }

    /// A ray of the host, as an argument.
    pub(crate) fn check(&self, name: &str) -> Outcome<Ray> {
        if self.is_sound() {
            return Ok(self.to_ray());
        }
        wrong(format!("`{name}`: origin finite, direction of length 1 and length not negative, but {self:?}"))
    }
}

/// The same in all directions.
pub const FOGBOW_PHASE_ISOTROPIC: u32 = 0;
/// Henyey–Greenstein, with `g` in (-1, 1), forward for g > 0.
pub const FOGBOW_PHASE_HENYEY_GREENSTEIN: u32 = 1;
/// Schlick, with `g` as its k in (-1, 1), forward for k > 0.
pub const FOGBOW_PHASE_SCHLICK: u32 = 2;
/// Rayleigh.
pub const FOGBOW_PHASE_RAYLEIGH: u32 = 3;
/// Draine, with `g` in (-1, 1) and `alpha` at least 0.
pub const FOGBOW_PHASE_DRAINE: u32 = 4;
/// Water droplets of the diameter `alpha` (µm, in [5, 50]): Jendersie and d'Eon 2023.
pub const FOGBOW_PHASE_DROPLETS: u32 = 5;

/// A phase function, `FOGBOW_PHASE_…`; all zeros are isotropic. Mixtures come of media that overlap.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct fogbow_phase {
    /// Which one.
    pub kind: u32,
    /// Its first parameter, where it has one.
    pub g: f32,
    /// Its second parameter, where it has one.
    pub alpha: f32,
}

impl fogbow_phase {
    fn to_phase(self) -> Result<Phase, &'static str> {
        let Self { kind, g, alpha } = self;
        let lobe = match kind {
            FOGBOW_PHASE_ISOTROPIC => return Ok(Phase::ISOTROPIC),
            FOGBOW_PHASE_HENYEY_GREENSTEIN => Lobe::HenyeyGreenstein { g },
            FOGBOW_PHASE_SCHLICK => Lobe::Schlick { k: g },
            FOGBOW_PHASE_RAYLEIGH => Lobe::Rayleigh,
            FOGBOW_PHASE_DRAINE => Lobe::Draine { g, alpha },
            FOGBOW_PHASE_DROPLETS => return Phase::droplets(alpha).map_err(|_| "droplets are from 5 to 50 µm wide"),
            _ => return Err("there is no phase function of that kind"),
        };
        lobe.check().map(Phase::from).map_err(|_| "g or k is outside (-1, 1), or alpha is negative")
    }

    pub(crate) fn check(self, name: &str) -> Outcome<Phase> {
        self.to_phase()
            .map_err(|why| refused(name)(&format!("{why} (kind {}, g {}, alpha {})", self.kind, self.g, self.alpha)))
    }
}

/// Optical properties of a medium at a point; all zeros are vacuum.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct fogbow_properties {
    /// Absorption coefficient (1/m).
    pub absorption: [f32; 3],
    /// Scattering coefficient (1/m).
    pub scattering: [f32; 3],
    /// Emitted radiance per length (W/(m³ sr)).
    pub emission: [f32; 3],
    /// Angular law of scattering.
    pub phase: fogbow_phase,
}

impl fogbow_properties {
    pub(crate) fn check(&self, name: &str) -> Outcome<Properties> {
        let absorption = arguments::light(self.absorption, &format!("{name}->absorption"))?;
        let scattering = arguments::light(self.scattering, &format!("{name}->scattering"))?;
        let emission = arguments::light(self.emission, &format!("{name}->emission"))?;
        if !(absorption + scattering).is_finite() {
            return wrong(format!("`{name}`: absorption and scattering add up to more than a number"));
        }
        Ok(Properties { absorption, scattering, emission, phase: self.phase.check(name)? })
    }

    /// What a callback has said.
    fn told(&self) -> Properties {
        let [absorption, scattering, emission] = [self.absorption, self.scattering, self.emission].map(Spectrum);
        if !(absorption.is_valid()
            && scattering.is_valid()
            && emission.is_valid()
            && (absorption + scattering).is_finite())
        {
            complain("the callback `properties` gave coefficients that are negative or not finite");
            return Properties::VACUUM;
        }
        let phase = self.phase.to_phase().unwrap_or_else(|_| {
            complain("the callback `properties` gave a phase function that there is not");
            Phase::ISOTROPIC
        });
        Properties { absorption, scattering, emission, phase }
    }
}

/// Bounds of extinction along a part of a ray.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default)]
pub struct fogbow_segment {
    /// Distance (m) along the ray up to which they hold, beyond where they were asked for; infinite where nothing follows.
    pub until: f32,
    /// Lower bound of extinction (1/m). Where it is equal to the upper one in all channels, the medium must be constant.
    pub minorant: [f32; 3],
    /// Upper bound of extinction (1/m). 0 promises vacuum.
    pub majorant: [f32; 3],
}

/// A medium of the host. Its callbacks are pure (the same answer to the same question), may be called by every thread that calls
/// fogbow, and never throw, jump out or call fogbow with the same caches.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_host_medium {
    /// sizeof(fogbow_host_medium).
    pub size: u32,
    /// 1: extinction is the same in all channels everywhere, which is quicker. Where this is not so, colours are wrong.
    pub is_grey: u32,
    /// 1: there may be emission. Else it is left out.
    pub is_emissive: u32,
    /// Length (m) over which coefficients vary, for the steps of differences and marches; 0 for 0.01.
    pub resolution: f32,
    /// Upper bound of extinction (1/m) everywhere; used where `bounds` is null.
    pub majorant: [f32; 3],
    /// Passed to the callbacks.
    pub context: *mut c_void,
    /// Writes the properties at a point (x, y, z; m), which are vacuum before.
    pub properties:
        Option<unsafe extern "C" fn(context: *mut c_void, point: *const f32, properties: *mut fogbow_properties)>,
    /// Writes bounds from the distance `from` (m) along a ray on, which are 0 up to infinity before. Null: `majorant` holds everywhere.
    pub bounds: Option<
        unsafe extern "C" fn(context: *mut c_void, ray: *const fogbow_ray, from: f32, segment: *mut fogbow_segment),
    >,
    /// Writes extinction (1/m, three channels) at a point, where that is cheaper than all properties. May be null.
    pub extinction: Option<unsafe extern "C" fn(context: *mut c_void, point: *const f32, extinction: *mut f32)>,
}

// SAFETY: `repr(C)`, the size first, then numbers, a pointer and optional functions.
unsafe impl Versioned for fogbow_host_medium {}

/// A medium by callbacks.
#[derive(Debug)]
pub(crate) struct HostMedium {
    of: fogbow_host_medium,
    properties: unsafe extern "C" fn(*mut c_void, *const f32, *mut fogbow_properties),
    majorant: Spectrum,
}

// SAFETY: the host promises that its callbacks may be called from every thread that calls fogbow.
unsafe impl Send for HostMedium {}
// SAFETY: as above.
unsafe impl Sync for HostMedium {}

impl HostMedium {
    pub(crate) fn new(of: fogbow_host_medium) -> Outcome<Self> {
        let properties = of.properties.ok_or_else(|| arguments::null("medium->properties"))?;
        let majorant = arguments::light(of.majorant, "medium->majorant")?;
        if of.bounds.is_none() && majorant.is_black() {
            return wrong("`medium->majorant` must be above 0 where there are no `bounds`");
        }
        arguments::within(of.resolution, 0.0, f32::MAX, "medium->resolution")?;
        Ok(Self { of, properties, majorant })
    }
}

impl Medium for HostMedium {
    fn properties(&self, point: Vec3) -> Properties {
        let mut properties = fogbow_properties::default();
        // SAFETY: the host's function, with pointers that are good during the call.
        unsafe { (self.properties)(self.of.context, point.as_ref().as_ptr(), &raw mut properties) };
        properties.told()
    }

    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        let Some(bounds) = self.of.bounds else {
            return MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: self.majorant };
        };
        let mut segment = fogbow_segment { until: f32::INFINITY, ..fogbow_segment::default() };
        let ray = fogbow_ray::of(ray);
        // SAFETY: as above.
        unsafe { bounds(self.of.context, &raw const ray, from, &raw mut segment) };
        let fogbow_segment { until, minorant, majorant } = segment;
        let (minorant, majorant) = (Spectrum(minorant), Spectrum(majorant));
        let is_ordered = minorant.zip(majorant, |least, most| most - least).min_element() >= 0.0;
        if !(until > from && minorant.is_valid() && majorant.is_valid() && is_ordered) {
            complain("the callback `bounds` gave bounds that are no numbers, cross each other, or do not advance");
            return MajorantSegment::vacuum(f32::INFINITY);
        }
        MajorantSegment { until, minorant, majorant }
    }

    fn extinction(&self, point: Vec3) -> Spectrum {
        let Some(extinction) = self.of.extinction else { return self.properties(point).extinction() };
        let mut answer = [0.0; 3];
        // SAFETY: as above.
        unsafe { extinction(self.of.context, point.as_ref().as_ptr(), answer.as_mut_ptr()) };
        if Spectrum(answer).is_valid() {
            return Spectrum(answer);
        }
        complain("the callback `extinction` gave a number that is negative or not finite");
        Spectrum::ZERO
    }

    fn resolution(&self) -> f32 {
        if self.of.resolution > 0.0 { self.of.resolution } else { 1e-2 }
    }

    fn is_grey(&self) -> bool {
        self.of.is_grey != 0
    }

    fn is_emissive(&self) -> bool {
        self.of.is_emissive != 0
    }
}

/// Ideal diffuse reflection of `reflectance`, on the side of the normal.
pub const FOGBOW_SURFACE_LAMBERT: u32 = 0;
/// A Phong lobe of `specular` and `exponent` over a diffuse base of `reflectance`; together at most 1.
pub const FOGBOW_SURFACE_PHONG: u32 = 1;
/// An ideal mirror of `reflectance`, on the side of the normal.
pub const FOGBOW_SURFACE_MIRROR: u32 = 2;
/// Smooth glass: index of refraction behind the normal over that before it `eta`, factors `reflectance` and `transmittance`.
pub const FOGBOW_SURFACE_DIELECTRIC: u32 = 3;
/// An interface that light passes unchanged.
pub const FOGBOW_SURFACE_NULL: u32 = 4;

/// A thin pane of glass, both faces as one, of the parameters of a dielectric; what passes goes straight on.
pub const FOGBOW_SURFACE_PANE: u32 = 5;
/// A rough metal (GGX) of `reflectance` and `roughness`, on the side of the normal.
pub const FOGBOW_SURFACE_ROUGH_METAL: u32 = 6;
/// Rough glass (GGX), of the parameters of a dielectric, `eta` not 1, and `roughness`.
pub const FOGBOW_SURFACE_ROUGH_DIELECTRIC: u32 = 7;
/// A diffuse base of `reflectance` under a smooth coat of index `eta`, whose reflections have the factor `specular`; on the side of
/// the normal.
pub const FOGBOW_SURFACE_PLASTIC: u32 = 8;

/// The hit is on no lamp.
pub const FOGBOW_NO_LIGHT: u32 = 0xffff_ffff;

/// Where a ray meets a surface. Before the callback it is a black Lambert surface on no lamp, with `eta` and `transmittance` 1.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_hit {
    /// Distance along the ray (m), above 0 and within its length.
    pub distance: f32,
    /// Geometric normal (unit); surfaces shine and reflect on the side it points to. For two-sided ones, turn it against the ray.
    pub normal: [f32; 3],
    /// The normal (unit) that scattering goes by, on the side of the other: interpolated between vertices, or bent by a texture.
    /// Zeros: the geometric one.
    pub shading: [f32; 3],
    /// `FOGBOW_SURFACE_…`.
    pub surface: u32,
    /// Share of light reflected, in [0, 1].
    pub reflectance: [f32; 3],
    /// Share of light reflected in a lobe.
    pub specular: [f32; 3],
    /// Factor on light that passes.
    pub transmittance: [f32; 3],
    /// Exponent of a lobe, at least 0.
    pub exponent: f32,
    /// Relative index of refraction, above 0.
    pub eta: f32,
    /// Width of the distribution of facets, in [0.001, 1].
    pub roughness: f32,
    /// Number of the light whose surface this is, or `FOGBOW_NO_LIGHT`. Each light with an area must be found so.
    pub light: u32,
}

impl fogbow_hit {
    const NOTHING: Self = Self {
        distance: 0.0,
        normal: [0.0; 3],
        shading: [0.0; 3],
        surface: FOGBOW_SURFACE_LAMBERT,
        reflectance: [0.0; 3],
        specular: [0.0; 3],
        transmittance: [1.0; 3],
        exponent: 0.0,
        eta: 1.0,
        roughness: 0.0,
        light: FOGBOW_NO_LIGHT,
    };

    /// What the surface is, if there is one like it.
    fn surface(&self) -> Option<Surface> {
        let share = |of: Rgb| of.iter().all(|c| *c >= 0.0 && *c <= 1.0).then_some(Spectrum(of));
        let reflectance = share(self.reflectance)?;
        let index = || Some(self.eta).filter(|eta| *eta > 0.0 && *eta < f32::INFINITY);
        let facets = || {
            let is_sound = (1e-3..=1.0).contains(&self.roughness);
            is_sound.then(|| Roughness::even(Distribution::Ggx, self.roughness))
        };
        Some(match self.surface {
            FOGBOW_SURFACE_LAMBERT => Surface::Lambert { reflectance },
            FOGBOW_SURFACE_MIRROR => Surface::Mirror { reflectance },
            FOGBOW_SURFACE_NULL => Surface::Null,
            FOGBOW_SURFACE_PHONG => {
                let specular = share(self.specular)?;
                let is_sound = self.exponent >= 0.0 && self.exponent.is_finite();
                // With a hair for rounding of shares that add up to 1.
                let is_sound = is_sound && (reflectance + specular).max_element() <= 1.0 + 1e-6;
                is_sound.then_some(Surface::Phong { diffuse: reflectance, specular, exponent: self.exponent })?
            }
            FOGBOW_SURFACE_DIELECTRIC => {
                let (eta, transmittance) = (index()?, share(self.transmittance)?);
                Surface::Dielectric { eta, reflectance, transmittance }
            }
            FOGBOW_SURFACE_PANE => {
                let (eta, transmittance) = (index()?, share(self.transmittance)?);
                Surface::ThinDielectric { eta, reflectance, transmittance }
            }
            FOGBOW_SURFACE_ROUGH_METAL => {
                let roughness = facets()?;
                Surface::RoughConductor(RoughConductor { conductor: Conductor::mirror(reflectance), roughness })
            }
            FOGBOW_SURFACE_ROUGH_DIELECTRIC => {
                let (eta, transmittance) = (index().filter(|eta| *eta != 1.0)?, share(self.transmittance)?);
                Surface::RoughDielectric(RoughDielectric { eta, reflectance, transmittance, roughness: facets()? })
            }
            FOGBOW_SURFACE_PLASTIC => {
                let (eta, specular) = (index()?, share(self.specular)?);
                Surface::Plastic(Plastic { eta, diffuse: reflectance, specular, nonlinear: false })
            }
            _ => return None,
        })
    }
}

/// Surfaces of the host. Its callbacks are pure (the same answer to the same question), may be called by every thread that calls
/// fogbow, and never throw, jump out or call fogbow with the same caches.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_host_scene {
    /// sizeof(fogbow_host_scene).
    pub size: u32,
    /// 0.
    pub reserved: u32,
    /// Passed to the callbacks.
    pub context: *mut c_void,
    /// Writes the nearest surface within the ray's length, and returns 1; or returns 0 if there is none.
    pub closest_hit:
        Option<unsafe extern "C" fn(context: *mut c_void, ray: *const fogbow_ray, hit: *mut fogbow_hit) -> i32>,
    /// Returns 1 if any surface but a null interface lies within the ray's length, else 0. Null: `closest_hit` is asked.
    pub is_blocked: Option<unsafe extern "C" fn(context: *mut c_void, ray: *const fogbow_ray) -> i32>,
}

// SAFETY: `repr(C)`, the size first, then numbers, a pointer and optional functions.
unsafe impl Versioned for fogbow_host_scene {}

/// Surfaces by callbacks; or none.
#[derive(Debug)]
pub(crate) struct HostScene {
    context: *mut c_void,
    closest_hit: Option<unsafe extern "C" fn(*mut c_void, *const fogbow_ray, *mut fogbow_hit) -> i32>,
    is_blocked: Option<unsafe extern "C" fn(*mut c_void, *const fogbow_ray) -> i32>,
    lights: u32,
}

// SAFETY: the host promises that its callbacks may be called from every thread that calls fogbow.
unsafe impl Send for HostScene {}
// SAFETY: as above.
unsafe impl Sync for HostScene {}

impl HostScene {
    /// Of a world with so many lights.
    pub(crate) fn new(of: &fogbow_host_scene, lights: u32) -> Outcome<Self> {
        let &fogbow_host_scene { context, closest_hit, is_blocked, .. } = of;
        closest_hit.ok_or_else(|| arguments::null("scene->closest_hit"))?;
        Ok(Self { context, closest_hit, is_blocked, lights })
    }

    pub(crate) const EMPTY: Self =
        Self { context: core::ptr::null_mut(), closest_hit: None, is_blocked: None, lights: 0 };
}

impl Scene for HostScene {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let closest_hit = self.closest_hit?;
        let (asked, mut hit) = (fogbow_ray::of(ray), fogbow_hit::NOTHING);
        // SAFETY: the host's function, with pointers that are good during the call.
        if unsafe { closest_hit(self.context, &raw const asked, &raw mut hit) } == 0 {
            return None;
        }
        let normal = Vec3::from_array(hit.normal);
        if !(hit.distance >= 0.0 && hit.distance <= ray.length && hit.distance.is_finite() && is_unit(normal)) {
            complain("the callback `closest_hit` gave a distance outside the ray, or a normal that is not of length 1");
            return None;
        }
        let shading = Vec3::from_array(hit.shading);
        let shading = if shading == Vec3::ZERO { normal } else { shading };
        if !(is_unit(shading) && shading.dot(normal) > 0.0) {
            complain("the callback `closest_hit` gave a shading normal that is not of length 1, or on the other side");
            return None;
        }
        let surface = hit.surface().unwrap_or_else(|| {
            complain("the callback `closest_hit` gave a surface that there is not, or values outside their ranges");
            Surface::BLACK
        });
        let light = (hit.light != FOGBOW_NO_LIGHT).then_some(hit.light);
        let light = light.filter(|light| {
            let is_one = *light < self.lights;
            if !is_one {
                complain("the callback `closest_hit` gave the number of a light that there is not");
            }
            is_one
        });
        Some(Hit { distance: hit.distance, normal, shading, surface, light })
    }

    fn is_blocked(&self, ray: &Ray) -> bool {
        let asked = fogbow_ray::of(ray);
        match (self.is_blocked, self.closest_hit) {
            // SAFETY: as above.
            (Some(is_blocked), _) => unsafe { is_blocked(self.context, &raw const asked) != 0 },
            (None, Some(_)) => fogbow::world::nearest_surface(ray, self).is_some(),
            (None, None) => false,
        }
    }
}
