//! What methods must know beforehand of a world.

use glam::Vec3;

use super::{World, nearest_surface};
use crate::host::{Medium, Scene};
use crate::light::Light;
use crate::math::{Bounds, Ray};
use crate::phase::Phase;
use crate::sampling::{Generator, uniform, uniform2, warp};

/// Points along each side of the bounds at which a medium is looked at. Fewer: small clouds are missed. More:
/// longer, by the third power.
const LOOKS: u32 = 24;

/// Rays that look for surfaces and at the course of a medium. Fewer: small mirrors are missed.
const RAYS: u32 = 1024;

/// Majorant segments of a ray that are asked for: what changes has changed by then.
const MOST_SEGMENTS: u32 = 64;

/// How many lights there are, of which kinds; a light may be of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LightCounts {
    /// All of them.
    pub all: usize,
    /// Without extent, so that no ray meets them by chance: points, spots, suns.
    #[doc(alias("delta lights", "singular"))]
    pub delta: usize,
    /// Infinitely far: suns, the sky, environments.
    #[doc(alias("infinite lights", "distant lights"))]
    pub distant: usize,
    /// Shining evenly from all around: see [`Light::is_sky`].
    pub skies: usize,
}

impl LightCounts {
    /// Counts them.
    ///
    /// ```
    /// # use fogbow::{light::{Light, PointLight, Sun}, math::Vec3, spectrum::Spectrum, world::LightCounts};
    /// let lights = [
    ///     Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?),
    ///     Light::Sun(Sun::new(Vec3::Y, Spectrum::ONE)?),
    ///     Light::Constant(Spectrum::ONE),
    /// ];
    /// assert_eq!(LightCounts::of(&lights), LightCounts { all: 3, delta: 2, distant: 2, skies: 1 });
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[must_use]
    pub fn of(lights: &[Light<'_>]) -> Self {
        Self {
            all: lights.len(),
            delta: lights.iter().filter(|light| light.is_delta()).count(),
            distant: lights.iter().filter(|light| is_distant(light)).count(),
            skies: lights.iter().filter(|light| light.is_sky()).count(),
        }
    }
}

fn is_distant(light: &Light<'_>) -> bool {
    match light {
        Light::Sun(_) | Light::Constant(_) | Light::Environment(_) => true,
        Light::Point(_) | Light::Phong(_) | Light::Spot(_) | Light::Projector(_) => false,
        Light::Quad(_) | Light::Sphere(_) | Light::Mesh(_) | Light::Picture(_) => false,
    }
}

/// What methods must know beforehand of a world: how large it is, how thick its fog, how sharply that scatters, and
/// what else there is.
///
/// Presets of methods follow from it. A host that knows better sets the fields: [`Outline::of`] looks at a number of
/// points only.
///
/// Extinction here is the mean of the channels.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, medium::Homogeneous, phase::Lobe};
/// # use fogbow::{spectrum::Spectrum, world::{Outline, World}};
/// let fog = Homogeneous::new(Spectrum::splat(0.5), Spectrum::splat(1.5), Lobe::HenyeyGreenstein { g: 0.6 })?;
/// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
/// assert_eq!((outline.mean_free_path, outline.least_free_path, outline.albedo), (0.5, 0.5, 0.75));
/// assert!(outline.is_constant && !outline.has_surfaces && outline.lights.delta == 1);
/// assert_eq!(outline.phase, Lobe::HenyeyGreenstein { g: 0.6 }.into());
/// // A host that knows of sharper fog somewhere says so.
/// let outline = Outline { phase: Lobe::HenyeyGreenstein { g: 0.9 }.into(), ..outline };
/// # assert!(outline.phase.mean_cosine()[0] > 0.8);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[doc(alias("statistics", "summary", "presets"))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outline {
    /// The smallest box (m) around all surfaces and media, or around the part of them that matters.
    pub bounds: Bounds,
    /// One over the mean extinction in the bounds (m); infinite without a medium.
    #[doc(alias = "mfp")]
    pub mean_free_path: f32,
    /// One over the greatest extinction in the bounds (m); infinite without a medium.
    pub least_free_path: f32,
    /// Extinction where light collides (m⁻¹), `∫ σₜ² dV/∫ σₜ dV`; 0 without a medium.
    pub extinction: f32,
    /// Single-scattering albedo where light collides, `∫ σₛ dV/∫ σₜ dV`; 0 without a medium.
    pub albedo: f32,
    /// The sharpest phase function: that with the greatest absolute mean cosine, of any channel. Isotropic without a
    /// medium that scatters.
    #[doc(alias("anisotropy", "g"))]
    pub phase: Phase,
    /// How many lights there are.
    pub lights: LightCounts,
    /// Whether there are surfaces other than null interfaces.
    pub has_surfaces: bool,
    /// Whether any surface is a mirror or glass. Where this is wrongly `false`, methods that cannot see virtual lights in
    /// mirrors leave their light out; wrongly `true` costs rays.
    #[doc(alias("specular", "glass", "dielectric"))]
    pub has_mirrors: bool,
    /// Whether extinction is the same in every channel: [`Medium::is_grey`].
    pub is_grey: bool,
    /// Whether the medium may emit light: [`Medium::is_emissive`].
    pub is_emissive: bool,
    /// Whether the medium is the same along every part of a ray, but for faces: vacuum, or even fog in its container.
    #[doc(alias = "homogeneous")]
    pub is_constant: bool,
    /// Length (m) over which the medium's coefficients vary: [`Medium::resolution`].
    pub resolution: f32,
}

impl Outline {
    /// Whether there may be light that photons bring and no path from an eye can find: that of lamps without extent (points, spots, projectors, suns) by way of mirrors or
    /// glass. Caches that photons light hold it; path tracing, and with it an [`Audit`](crate::cache::Audit), takes it for too much.
    ///
    /// ```
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Vec3}, spectrum::Spectrum};
    /// # use fogbow::world::{Outline, World};
    /// let lamps = [Light::Point(PointLight::new(Vec3::Z, Spectrum::ONE)?)];
    /// let world = World { medium: &Empty, scene: &Empty, lights: (&lamps).into() };
    /// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// assert!(!outline.hides_light() && Outline { has_mirrors: true, ..outline }.hides_light());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[inline]
    #[must_use]
    pub const fn hides_light(&self) -> bool {
        self.has_mirrors && self.lights.delta > 0
    }

    /// Looks at a world: at 24³ points of its medium, along 1024 rays for its surfaces, and at what the medium says of
    /// itself. `bounds` (m) should hold all surfaces and media, or what matters of them. The same world gives the same
    /// outline.
    ///
    /// What is seen from less than some thousandth of all points and directions may be missed. Where bounds are not
    /// finite, only the origin is looked at.
    #[must_use]
    pub fn of<M: Medium + ?Sized, S: Scene + ?Sized>(world: &World<'_, M, S>, bounds: Bounds) -> Self {
        let medium = world.medium;
        let (first, size) = looked_at(&bounds);
        let mut matter = Matter::default();
        for i in 0..LOOKS * LOOKS * LOOKS {
            let at = [i % LOOKS, i / LOOKS % LOOKS, i / (LOOKS * LOOKS)].map(|k| (k as f32 + 0.5) / LOOKS as f32);
            matter.look(medium, first + size * Vec3::from_array(at));
        }
        let (mut has_surfaces, mut has_mirrors, mut is_constant) = (false, false, true);
        let mut rng = Generator::new(0);
        for _ in 0..RAYS {
            let at = Vec3::new(uniform(&mut rng), uniform(&mut rng), uniform(&mut rng));
            let ray = Ray::new(first + size * at, warp::uniform_sphere(uniform2(&mut rng)));
            let end = nearest_surface(&ray, world.scene);
            has_surfaces |= end.is_some();
            has_mirrors |= end.is_some_and(|hit| hit.surface.is_followed());
            let leaves = Bounds { min: first, max: first + size }.intersect(&ray).map_or(0.0, |(_, far)| far);
            let length = end.map_or(f32::INFINITY, |hit| hit.distance).min(leaves);
            is_constant = is_constant && is_constant_along(medium, &ray.with_length(length));
        }
        Self {
            bounds,
            mean_free_path: (f64::from(LOOKS * LOOKS * LOOKS) / matter.extinction) as f32,
            least_free_path: 1.0 / matter.most,
            extinction: matter.over_extinction(matter.squared),
            albedo: matter.over_extinction(matter.scattering),
            phase: matter.phase,
            lights: LightCounts::of(&world.lights),
            has_surfaces,
            has_mirrors,
            is_grey: medium.is_grey(),
            is_emissive: medium.is_emissive(),
            is_constant,
            resolution: medium.resolution(),
        }
    }
}

/// Corner and size of the box to look at.
fn looked_at(bounds: &Bounds) -> (Vec3, Vec3) {
    let size = bounds.size();
    let is_box = bounds.min.is_finite() && size.is_finite() && size.cmpge(Vec3::ZERO).all();
    if is_box { (bounds.min, size) } else { (Vec3::ZERO, Vec3::ZERO) }
}

/// A medium, as far as it has been looked at.
struct Matter {
    /// Sums of `σₜ`, `σₜ²` and `σₛ` over points.
    extinction: f64,
    squared: f64,
    scattering: f64,
    /// Greatest `σₜ`.
    most: f32,
    phase: Phase,
    /// Its mean cosine; negative before there is one.
    sharpness: f32,
}

impl Default for Matter {
    fn default() -> Self {
        let phase = Phase::ISOTROPIC;
        Self { extinction: 0.0, squared: 0.0, scattering: 0.0, most: 0.0, phase, sharpness: -1.0 }
    }
}

impl Matter {
    fn look(&mut self, medium: &(impl Medium + ?Sized), point: Vec3) {
        let properties = medium.properties(point);
        let extinction = properties.extinction().mean();
        // NaN fails, too.
        if !(extinction > 0.0 && extinction.is_finite()) {
            return;
        }
        self.most = self.most.max(extinction);
        self.extinction += f64::from(extinction);
        self.squared += f64::from(extinction) * f64::from(extinction);
        if properties.scattering.is_black() {
            return;
        }
        self.scattering += f64::from(properties.scattering.mean());
        let sharpness = properties.phase.mean_cosine().map(f32::abs).max_element();
        if sharpness > self.sharpness {
            (self.sharpness, self.phase) = (sharpness, properties.phase);
        }
    }

    fn over_extinction(&self, sum: f64) -> f32 {
        if self.extinction > 0.0 { (sum / self.extinction) as f32 } else { 0.0 }
    }
}

fn is_constant_along(medium: &(impl Medium + ?Sized), ray: &Ray) -> bool {
    let mut at = 0.0;
    for _ in 0..MOST_SEGMENTS {
        let segment = medium.majorant_segment(ray, at);
        if !segment.is_constant() {
            return false;
        }
        // A host that does not advance, too.
        if !(segment.until > at && segment.until < ray.length) {
            break;
        }
        at = segment.until;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::{Empty, Hit, MajorantSegment, Properties};
    use crate::medium::{Homogeneous, Placed, Region};
    use crate::phase::Lobe;
    use crate::spectrum::Spectrum;
    use crate::surface::Surface;

    const BOX: Bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };

    /// A mirror at `z = 0` behind a null interface at `z = 0.5`.
    struct Mirror;

    impl Scene for Mirror {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let mirror = Surface::Mirror { reflectance: Spectrum::ONE };
            let hits = [(0.0, mirror), (0.5, Surface::Null)].map(|(z, surface)| {
                let distance = (z - ray.origin.z) / ray.direction.z;
                (distance > 1e-6 && distance < ray.length).then_some(Hit {
                    distance,
                    normal: Vec3::Z,
                    shading: Vec3::Z,
                    surface,
                    light: None,
                })
            });
            hits.into_iter().flatten().min_by(|a, b| a.distance.total_cmp(&b.distance))
        }
    }

    /// Fog twice as thick on one side, and sharper there.
    struct Halves;

    impl Medium for Halves {
        fn properties(&self, point: Vec3) -> Properties {
            let (strength, g) = if point.x < 0.0 { (1.0, 0.2) } else { (2.0, -0.5) };
            let scattering = Spectrum::splat(0.5 * strength);
            let phase = Lobe::HenyeyGreenstein { g }.into();
            Properties { absorption: scattering, scattering, phase, ..Properties::VACUUM }
        }
        fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
            MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ONE, majorant: Spectrum::splat(2.0) }
        }
    }

    #[test]
    fn lengths_are_those_of_the_medium_and_scale_with_it() {
        let outline = Outline::of(&World { medium: &Halves, scene: &Empty, lights: (&[]).into() }, BOX);
        assert_eq!((outline.mean_free_path, outline.least_free_path), (1.0 / 1.5, 0.5));
        // (1 + 4)/(1 + 2)
        assert!((outline.extinction - 5.0 / 3.0).abs() < 1e-6 && outline.albedo == 0.5);
        assert_eq!(outline.phase, Lobe::HenyeyGreenstein { g: -0.5 }.into());
        assert!(!outline.is_constant);
        for scale in [1.0 / 1024.0, 1024.0] {
            let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(1.0 / scale), Phase::ISOTROPIC).unwrap();
            let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, scale).unwrap());
            let bounds = Bounds { min: BOX.min * scale, max: BOX.max * scale };
            let outline = Outline::of(&World { medium: &ball, scene: &Empty, lights: (&[]).into() }, bounds);
            assert_eq!((outline.least_free_path, outline.is_constant), (scale, true));
            // The ball takes π/6 of its box; a lattice sees that to a percent.
            let share = outline.least_free_path / outline.mean_free_path;
            assert!((share - core::f32::consts::FRAC_PI_6).abs() < 0.01, "{share}");
        }
    }

    #[test]
    fn mirrors_are_seen_through_null_interfaces() {
        let outline = Outline::of(&World { medium: &Empty, scene: &Mirror, lights: (&[]).into() }, BOX);
        assert!(outline.has_mirrors && outline.has_surfaces);
        let outline = Outline::of(&World { medium: &Empty, scene: &Empty, lights: (&[]).into() }, BOX);
        assert!(!outline.has_mirrors && !outline.has_surfaces && outline.is_constant);
        assert_eq!((outline.mean_free_path, outline.extinction, outline.albedo), (f32::INFINITY, 0.0, 0.0));
    }

    #[test]
    fn bounds_without_size_or_end_still_show_the_medium() {
        let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC).unwrap();
        for bounds in [Bounds::EMPTY, Bounds::EVERYTHING, Bounds { min: Vec3::ONE, max: Vec3::ONE }] {
            let outline = Outline::of(&World { medium: &fog, scene: &Empty, lights: (&[]).into() }, bounds);
            assert_eq!((outline.mean_free_path, outline.extinction, outline.albedo), (1.0, 1.0, 1.0));
        }
    }
}
