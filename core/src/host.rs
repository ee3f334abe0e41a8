//! Layer 3: what the host brings.
//!
//! [`Medium`] and [`Scene`] are open sets and therefore traits: few methods, plain data in and
//! out, usable as `&dyn`. All but the indispensable have honest defaults.

mod delegate;
pub(crate) mod passing;

pub use delegate::delegate_medium;
use glam::{Vec2, Vec3};
pub use rand_core::Rng;

use crate::math::{Ray, Symmetric3};
use crate::phase::Phase;
use crate::spectrum::{Gradient, Hessian, Spectrum};
use crate::surface::{Surface, SurfaceSample};

/// Optical properties of a medium at a point.
///
/// ```
/// # use fogbow::{host::Properties, spectrum::Spectrum};
/// let fog = Properties { absorption: Spectrum::ONE, scattering: Spectrum::splat(3.0), ..Properties::VACUUM };
/// assert_eq!((fog.extinction(), fog.albedo()), (Spectrum::splat(4.0), Spectrum::splat(0.75)));
/// assert_eq!(Properties::VACUUM.albedo(), Spectrum::ZERO);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Properties {
    /// Absorption coefficient σₐ (m⁻¹).
    pub absorption: Spectrum,
    /// Scattering coefficient σₛ (m⁻¹).
    pub scattering: Spectrum,
    /// Emitted radiance per length (W·m⁻³·sr⁻¹); the same in all directions.
    pub emission: Spectrum,
    /// Angular law of scattering.
    pub phase: Phase,
}

impl Properties {
    /// Empty space.
    pub const VACUUM: Self = Self {
        absorption: Spectrum::ZERO,
        scattering: Spectrum::ZERO,
        emission: Spectrum::ZERO,
        phase: Phase::ISOTROPIC,
    };

    /// Extinction coefficient σₜ = σₐ + σₛ (m⁻¹).
    #[inline]
    #[must_use]
    pub fn extinction(&self) -> Spectrum {
        self.absorption + self.scattering
    }

    /// Single-scattering albedo σₛ/σₜ; 0 in vacuum.
    #[inline]
    #[must_use]
    pub fn albedo(&self) -> Spectrum {
        self.scattering.ratio(self.extinction())
    }
}

/// A majorant segment: bounds on extinction along a part of a ray.
///
/// Equal bounds mean that the medium is constant there (all of its properties, not only the sum),
/// so closed forms apply; a majorant of 0 means vacuum without emission.
///
/// ```
/// # use fogbow::{host::MajorantSegment, spectrum::Spectrum};
/// let gap = MajorantSegment::vacuum(2.0);
/// assert!(gap.is_constant() && gap.majorant == Spectrum::ZERO);
/// let smoke = MajorantSegment { minorant: Spectrum::splat(0.1), majorant: Spectrum::ONE, ..gap };
/// assert!(!smoke.is_constant());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[doc(alias("RayMajorantSegment", "Stretch", "bounds"))]
pub struct MajorantSegment {
    /// Distance along the ray (m) up to which the bounds hold; greater than where they were asked.
    pub until: f32,
    /// Lower bound of extinction (m⁻¹).
    pub minorant: Spectrum,
    /// Upper bound of extinction (m⁻¹).
    pub majorant: Spectrum,
}

impl MajorantSegment {
    /// Vacuum up to `until`.
    #[inline]
    #[must_use]
    pub fn vacuum(until: f32) -> Self {
        Self { until, minorant: Spectrum::ZERO, majorant: Spectrum::ZERO }
    }

    /// Whether the medium is constant along the segment.
    #[inline]
    #[must_use]
    pub fn is_constant(&self) -> bool {
        self.minorant == self.majorant
    }
}

/// Gradients of a medium's coefficients inside it; jumps at its faces are [`Face`]s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gradients {
    /// `∇σₜ` (m⁻²).
    pub extinction: Gradient,
    /// `∇σₛ` (m⁻²).
    pub scattering: Gradient,
}

/// A crossing of a ray with a face where extinction jumps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Face {
    /// Distance along the ray (m).
    pub distance: f32,
    /// Unit normal of the face, out of the body.
    pub normal: Vec3,
    /// Jump of σₜ (m⁻¹) along the normal: outside minus inside.
    pub jump: Spectrum,
}

/// A participating medium, as the host knows it. Two methods are enough for one that is smooth, does not glow and varies over centimetres or more:
///
/// ```
/// # use fogbow::{host::{MajorantSegment, Medium, Properties}, math::{Ray, Vec3}, spectrum::Spectrum};
/// # use fogbow::transmittance::thickness::{Marching, transmittance};
/// /// Fog that thins out with height: extinction `e^{−z}` above the ground.
/// struct Mist;
/// impl Medium for Mist {
///     fn properties(&self, point: Vec3) -> Properties {
///         Properties { scattering: Spectrum::splat((-point.z.max(0.0)).exp()), ..Properties::VACUUM }
///     }
///     fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
///         MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: Spectrum::ONE }
///     }
/// }
/// // Straight up, three metres: the optical thickness is 1 − e⁻³.
/// let through = transmittance(&Ray::between(Vec3::ZERO, 3.0 * Vec3::Z), &Mist, Marching::midpoints(64));
/// assert!((through[0] - (-(1.0 - (-3.0f32).exp())).exp()).abs() < 1e-4);
/// ```
///
/// What a medium promises:
///
/// * Both methods are pure: the same arguments give the same answer, on any thread (`Sync`, where there are threads).
/// * Coefficients are finite and not negative, everywhere in space.
/// * Bounds hold, `minorant ≤ σₜ ≤ majorant` in every channel up to `until`; equal ones say that all properties are constant as far as that, and a
///   majorant of 0 that nothing is there, emission included. Nothing checks this: wrong bounds make wrong pictures.
/// * `until` lies beyond where the segment begins, and is infinite where nothing follows. (Where it does not advance, rays still end.)
///
/// What it must say where the default does not fit: that it glows ([`Medium::is_emissive`]), or its emission is left out; over what length it varies, if
/// not over a centimetre ([`Medium::resolution`]); where it ends abruptly ([`Medium::faces`]). A medium with a sharp border is best written without it and put
/// into a [`Placed`](crate::medium::Placed), which knows the faces of its region:
///
/// ```
/// # use fogbow::{host::{MajorantSegment, Medium}, math::{Ray, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
/// # use fogbow::spectrum::{Gradient, Hessian, Spectrum};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 2.0)?);
/// assert_eq!((ball.properties(Vec3::X).scattering, ball.extinction(3.0 * Vec3::X)), (Spectrum::ONE, Spectrum::ZERO));
/// // Inside, nothing varies; what changes at its face is told apart.
/// assert_eq!(ball.extinction_with_gradient(Vec3::X), (Spectrum::ONE, Gradient::ZERO));
/// assert_eq!(ball.extinction_hessian(Vec3::X), Hessian::ZERO);
/// let mut faces = Vec::new();
/// ball.faces(&Ray::new(-5.0 * Vec3::X, Vec3::X), &mut |face| faces.push((face.distance, face.jump[0])));
/// assert_eq!(faces, [(3.0, -1.0), (7.0, -1.0)]);   // outside minus inside
/// assert_eq!(ball.mean_extinction(Vec3::ZERO, 0.5), Spectrum::ONE);
/// assert!(ball.is_grey() && !ball.is_emissive());
/// // A ray towards it: vacuum as far as the ball, then the fog in it.
/// let ray = Ray::new(-5.0 * Vec3::X, Vec3::X);
/// assert_eq!(ball.majorant_segment(&ray, 0.0), MajorantSegment::vacuum(3.0));
/// let inside = ball.marching_segment(&ray, 3.0);
/// assert_eq!((inside.until, inside.minorant, inside.majorant), (7.0, Spectrum::ONE, Spectrum::ONE));
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
pub trait Medium {
    /// Optical properties at `point`.
    fn properties(&self, point: Vec3) -> Properties;

    /// Bounds on extinction from distance `from` (m) along `ray` to a farther `until`.
    ///
    /// A pure question: no state between calls. `until` may lie beyond the ray's length; where
    /// nothing follows it is infinite.
    #[doc(alias("stretch", "majorant", "bounds"))]
    fn majorant_segment(&self, ray: &Ray, from: f32) -> MajorantSegment;

    /// As [`Medium::majorant_segment`], for marching: bounds that differ may be loose, so where extinction changes the
    /// answer should reach as far as it does.
    #[doc(alias = "run")]
    fn marching_segment(&self, ray: &Ray, from: f32) -> MajorantSegment {
        self.majorant_segment(ray, from)
    }

    /// Extinction alone (m⁻¹), where a cheaper answer exists.
    fn extinction(&self, point: Vec3) -> Spectrum {
        self.properties(point).extinction()
    }

    /// Extinction (m⁻¹) and its gradient (m⁻²), as [`Medium::gradients`] has it, where both together are cheaper.
    fn extinction_with_gradient(&self, point: Vec3) -> (Spectrum, Gradient) {
        (self.extinction(point), self.gradients(point).extinction)
    }

    /// Length (m) over which coefficients vary: the step of the default's differences and of ray
    /// marching. A grid answers with its cell.
    ///
    /// ```
    /// # use fogbow::{host::{Medium, Properties}, math::Affine3, medium::{Density, DensityGrid, MinMax}};
    /// let (mut blocks, smoke) = ([MinMax::default()], Density::F32(&[1.0; 4]));
    /// let grid = DensityGrid::new([4, 1, 1], smoke, &Properties::VACUUM, Affine3::IDENTITY, &mut blocks)?;
    /// assert_eq!(grid.resolution(), 0.25);   // its shortest cell
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    fn resolution(&self) -> f32 {
        1e-2
    }

    /// `∇σₜ` and `∇σₛ` (m⁻²) inside the medium. The default takes central differences over about a
    /// hundredth of [`Medium::resolution`]: far from the origin, where single precision tells no such steps apart, over up to
    /// all of it, and over more only where points lie farther apart than that.
    ///
    /// ```
    /// # use fogbow::{host::Medium, math::Vec3, medium::{FractalNoise, Noise}, phase::Phase, spectrum::Spectrum};
    /// let cloud = Noise::new(FractalNoise::default(), Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// let point = Vec3::new(0.3, 0.4, 0.6);
    /// let difference = cloud.extinction(point + 1e-3 * Vec3::X) - cloud.extinction(point - 1e-3 * Vec3::X);
    /// let gradients = cloud.gradients(point);
    /// assert!((gradients.extinction.x[0] - difference[0] / 2e-3).abs() < 2e-3);
    /// assert_eq!(gradients.extinction.x, gradients.scattering.x * 2.0);   // half of it scatters
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    fn gradients(&self, point: Vec3) -> Gradients {
        let resolution = self.resolution();
        let step = difference_step(point, 1e-2 * resolution, resolution);
        let difference = |axis: Vec3| {
            let (a, b) = (self.properties(point + axis * step), self.properties(point - axis * step));
            let scale = 0.5 / step;
            ((a.extinction() - b.extinction()) * scale, (a.scattering - b.scattering) * scale)
        };
        let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(difference);
        Gradients { extinction: Gradient { x: x.0, y: y.0, z: z.0 }, scattering: Gradient { x: x.1, y: y.1, z: z.1 } }
    }

    /// Hessian of extinction (m⁻³) inside the medium. The default takes second differences over about
    /// [`Medium::resolution`], and over more only where single precision tells points no better apart.
    fn extinction_hessian(&self, point: Vec3) -> Hessian {
        let resolution = self.resolution();
        let h = difference_step(point, resolution, resolution);
        let at = |offset: Vec3| self.extinction(point + offset * h);
        let centre = at(Vec3::ZERO);
        let second = |a: Vec3| (at(a) + at(-a) - centre * 2.0) / (h * h);
        let mixed = |a: Vec3, b: Vec3| (at(a + b) + at(-a - b) - at(a - b) - at(b - a)) / (4.0 * h * h);
        let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
        Hessian { xx: second(x), xy: mixed(x, y), xz: mixed(x, z), yy: second(y), yz: mixed(y, z), zz: second(z) }
    }

    /// Mean extinction (m⁻¹) within the ball around `centre` of `radius` (m). The default averages
    /// the centre and two shells of six points: exact for quadratic fields, rough across faces.
    fn mean_extinction(&self, centre: Vec3, radius: f32) -> Spectrum {
        // Weights that integrate 1 and r² over the ball: shells at 0.5 R and 0.9 R.
        const SHELLS: [(f32, f32); 2] = [(0.5, 0.3), (0.9, 0.648_148_15)];
        let mut sum = self.extinction(centre) * (1.0 - SHELLS[0].1 - SHELLS[1].1);
        for (at, weight) in SHELLS {
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let offset = axis * (radius * at);
                sum += (self.extinction(centre + offset) + self.extinction(centre - offset)) * (weight / 6.0);
            }
        }
        sum.max(Spectrum::ZERO)
    }

    /// Reports every crossing of `ray` (within its length) with a face where extinction jumps, in
    /// any order. The default has none.
    fn faces(&self, ray: &Ray, visit: &mut dyn FnMut(Face)) {
        let _ = (ray, visit);
    }

    /// Whether extinction is the same in every channel, everywhere: then tracking is simpler. Where it wrongly says so, colours are wrong.
    fn is_grey(&self) -> bool {
        false
    }

    /// Whether the medium may emit light. Where it says no, as the default does, the emission of its properties is left out.
    fn is_emissive(&self) -> bool {
        false
    }
}

/// Roundings of a coordinate that a step of differences should have. Fewer: what a medium makes of its own rounding of
/// points shows; more: details blur sooner.
const ROUNDINGS: f32 = 256.0;

/// A step (m) for differences around `point`: `usual`, or more where that is few roundings of the coordinates, but then at
/// most `most`; no less than four roundings in any case. Rounded up to a power of two: then points and steps add up without
/// rounding.
fn difference_step(point: Vec3, usual: f32, most: f32) -> f32 {
    let rounding = f32::EPSILON * point.abs().max_element();
    let step = usual.max((ROUNDINGS * rounding).min(most)).max(4.0 * rounding).max(f32::MIN_POSITIVE);
    // The mantissa goes.
    f32::from_bits((step.to_bits() + 0x007f_ffff) & 0xff80_0000)
}

impl<M: Medium + ?Sized> Medium for &M {
    delegate_medium!(self, (**self));
}

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray (m).
    pub distance: f32,
    /// Geometric normal (unit). One-sided surfaces reflect and emit on the side it points to; for
    /// a two-sided one the host turns it against the ray.
    pub normal: Vec3,
    /// The normal (unit) that scattering goes by: interpolated between vertices, or bent by a texture; where nothing is, the
    /// geometric one. On its side: their scalar product is positive.
    pub shading: Vec3,
    /// What the surface does to light, textures already looked up.
    pub surface: Surface,
    /// Index of the area light this surface belongs to, if any. Every area light of a [`World`](crate::world::World) must be
    /// found so, or part of its light is lost: see [`World::lights`](crate::world::World::lights).
    pub light: Option<u32>,
}

/// Scattering at the surface: [`Surface`]'s answers with [`Hit::shading`] for a normal, and nothing for directions that the two
/// normals see on different sides. So no light leaks through a smooth mesh, as it would by the shading normal alone (Veach 1997,
/// § 5.3). Where both normals are the same, these are the surface's own.
impl Hit {
    /// Whether both normals see `direction` on the same side.
    #[inline]
    fn is_agreed(&self, direction: Vec3) -> bool {
        (self.normal.dot(direction) > 0.0) == (self.shading.dot(direction) > 0.0)
    }

    /// Whether `direction` leaves on the side of the normals, by both of them.
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::Vec3, surface::Surface};
    /// let bent = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::new(0.6, 0.0, 0.8), surface: Surface::BLACK, light: None };
    /// assert!(bent.faces(Vec3::Z) && !bent.faces(Vec3::NEG_Z) && !bent.faces(Vec3::new(-0.96, 0.0, 0.28)));
    /// ```
    #[inline]
    #[must_use]
    pub fn faces(&self, direction: Vec3) -> bool {
        self.normal.dot(direction) > 0.0 && self.shading.dot(direction) > 0.0
    }

    /// Bidirectional scattering function (sr⁻¹), without the cosine: see [`Surface::value`].
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::Vec3, spectrum::Spectrum, surface::Surface};
    /// let surface = Surface::Lambert { reflectance: Spectrum::ONE };
    /// let bent = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::new(0.6, 0.0, 0.8), surface, light: None };
    /// let to_light = Vec3::new(0.8, 0.0, 0.6);
    /// assert_eq!(bent.value(Vec3::Z, to_light), surface.value(Vec3::Z, Vec3::Z, to_light));
    /// assert!((bent.cosine(to_light) - 0.96).abs() < 1e-6);
    /// // The shading normal alone would have it shine from beneath.
    /// assert_eq!(bent.value(Vec3::Z, Vec3::new(0.98, 0.0, -0.2).normalize()), Spectrum::ZERO);
    /// ```
    #[inline]
    #[must_use]
    pub fn value(&self, to_eye: Vec3, to_light: Vec3) -> Spectrum {
        if !(self.is_agreed(to_eye) && self.is_agreed(to_light)) {
            return Spectrum::ZERO;
        }
        self.surface.value(self.shading, to_eye, to_light)
    }

    /// The cosine that goes with [`Hit::value`], negative from behind.
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::Vec3, surface::Surface};
    /// let wall = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::Z, surface: Surface::BLACK, light: None };
    /// assert_eq!(wall.cosine(Vec3::NEG_Z), -1.0);
    /// ```
    #[inline]
    #[must_use]
    pub fn cosine(&self, direction: Vec3) -> f32 {
        self.shading.dot(direction)
    }

    /// Density (sr⁻¹) with which [`Hit::sample`] draws `to_light`: see [`Surface::pdf`].
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::{Vec3, float::PI}, surface::Surface};
    /// let wall = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::Z, surface: Surface::BLACK, light: None };
    /// assert!((wall.pdf(Vec3::Z, Vec3::Z) - 1.0 / PI).abs() < 1e-6);
    /// ```
    #[inline]
    #[must_use]
    pub fn pdf(&self, to_eye: Vec3, to_light: Vec3) -> f32 {
        if self.is_agreed(to_eye) { self.surface.pdf(self.shading, to_eye, to_light) } else { 0.0 }
    }

    /// Draws the direction from which light is received: see [`Surface::sample`].
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::{Vec2, Vec3}, spectrum::Spectrum, surface::Surface};
    /// let surface = Surface::Mirror { reflectance: Spectrum::ONE };
    /// let bent = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::new(0.6, 0.0, 0.8), surface, light: None };
    /// let sample = bent.sample(Vec3::Z, 0.5, Vec2::ZERO).unwrap();
    /// assert!((sample.to_light - Vec3::new(0.96, 0.0, 0.28)).length() < 1e-6);
    /// // Reflected into the surface: that light is lost.
    /// assert!(bent.sample(Vec3::new(-0.6, 0.0, 0.8), 0.5, Vec2::ZERO).is_none());
    /// ```
    #[inline]
    #[must_use]
    pub fn sample(&self, to_eye: Vec3, choice: f32, u: Vec2) -> Option<SurfaceSample> {
        if !self.is_agreed(to_eye) {
            return None;
        }
        let sample = self.surface.sample(self.shading, to_eye, choice, u)?;
        self.is_agreed(sample.to_light).then_some(sample)
    }

    /// What power that arrives from `to_light` counts for: the ratio of its cosines to both normals; 1 where they are the same. Light
    /// on its way from the lights is scattered by the adjoint of what [`Hit::value`] says (Veach 1997, § 5.3.2):
    /// `f |n_s·ω| |n·ω′| / (|n·ω| |n_s·ω′|)` with `ω` where it comes from and `ω′` where it goes.
    ///
    /// ```
    /// # use fogbow::{host::Hit, math::Vec3, surface::Surface};
    /// let bent = Hit { distance: 1.0, normal: Vec3::Z, shading: Vec3::new(0.6, 0.0, 0.8), surface: Surface::BLACK, light: None };
    /// assert_eq!(bent.power_factor(Vec3::Z), 0.8);
    /// ```
    #[inline]
    #[must_use]
    pub fn power_factor(&self, to_light: Vec3) -> f32 {
        if self.shading == self.normal {
            return 1.0;
        }
        let geometric = self.normal.dot(to_light).abs();
        if geometric > 0.0 { self.shading.dot(to_light).abs() / geometric } else { 0.0 }
    }
}

/// The surfaces of the world.
///
/// ```
/// # use fogbow::{host::{Hit, Scene}, math::{Ray, Symmetric3, Vec3}, spectrum::Spectrum, surface::Surface};
/// struct Floor;   // at z = 0, seen from above
/// impl Scene for Floor {
///     fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
///         let distance = -ray.origin.z / ray.direction.z;
///         let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
///         let hit = Hit { distance, normal: Vec3::Z, shading: Vec3::Z, surface, light: None };
///         (distance > 0.0 && distance < ray.length).then_some(hit)
///     }
/// }
/// let down = Ray::new(2.0 * Vec3::Z, Vec3::NEG_Z);
/// let hit = Floor.closest_hit(&down).unwrap();
/// assert_eq!((hit.distance, Floor.curvature(&down, &hit)), (2.0, Symmetric3::ZERO));
/// assert!(Floor.is_blocked(&down) && !Floor.is_blocked(&down.with_length(1.0)));
/// ```
pub trait Scene {
    /// The nearest surface along `ray`, or `None` if nothing lies within its length.
    fn closest_hit(&self, ray: &Ray) -> Option<Hit>;

    /// The curvature (m⁻¹) of the surface that `ray` meets at `hit`: its shape operator, with the normal in its
    /// kernel; positive where the surface is convex towards `hit.normal`. The default says flat.
    fn curvature(&self, ray: &Ray, hit: &Hit) -> Symmetric3 {
        let _ = (ray, hit);
        Symmetric3::ZERO
    }

    /// Whether any surface other than a [`Surface::Null`] lies strictly between the ends of `ray`. The default goes by
    /// [`nearest_surface`](crate::world::nearest_surface).
    fn is_blocked(&self, ray: &Ray) -> bool {
        passing::nearest_surface(ray, self).is_some()
    }
}

impl<S: Scene + ?Sized> Scene for &S {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        (**self).closest_hit(ray)
    }
    fn curvature(&self, ray: &Ray, hit: &Hit) -> Symmetric3 {
        (**self).curvature(ray, hit)
    }
    fn is_blocked(&self, ray: &Ray) -> bool {
        (**self).is_blocked(ray)
    }
}

/// A world without surfaces.
#[derive(Debug, Clone, Copy, Default)]
pub struct Empty;

impl Scene for Empty {
    fn closest_hit(&self, _: &Ray) -> Option<Hit> {
        None
    }
}

impl Medium for Empty {
    fn properties(&self, _: Vec3) -> Properties {
        Properties::VACUUM
    }
    fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
        MajorantSegment::vacuum(f32::INFINITY)
    }
    fn is_grey(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Extinction rises with x, from 1 at `start`.
    struct Slope {
        start: f32,
        resolution: f32,
    }

    const SLOPE: f32 = 0.3;

    impl Medium for Slope {
        fn properties(&self, point: Vec3) -> Properties {
            let scattering = Spectrum::splat(1.0 + SLOPE * (point.x - self.start));
            Properties { scattering, ..Properties::VACUUM }
        }
        fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
            MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: Spectrum::splat(2.0) }
        }
        fn resolution(&self) -> f32 {
            self.resolution
        }
    }

    #[test]
    fn default_gradients_are_right_far_from_the_origin() {
        for (start, resolution) in
            [(0.0, 1e-2), (100.0, 1e-2), (1_000.0, 1e-2), (10_000.0, 1e-2), (1e6, 1e-2), (1e4, 10.0)]
        {
            let (medium, point) = (Slope { start, resolution }, Vec3::new(start, -0.3 * start, 7.0));
            let Gradients { extinction, scattering } = medium.gradients(point);
            // Steps are sums of powers of two: what is left is the rounding of two values near 1, over a step of at
            // least a sixteenth of a thousandth.
            let most = 2.0 * f32::EPSILON / 6e-5;
            assert!((extinction.x[0] - SLOPE).abs() < most, "at {start}: {}", extinction.x[0]);
            assert!(scattering == extinction && extinction.y.is_black() && extinction.z.is_black());
        }
    }

    /// Extinction that bends.
    struct Bowl(f32);

    impl Medium for Bowl {
        fn properties(&self, point: Vec3) -> Properties {
            let x = point.x - self.0;
            Properties { scattering: Spectrum::splat(1.0 + x + 20.0 * x * x), ..Properties::VACUUM }
        }
        fn majorant_segment(&self, _: &Ray, _: f32) -> MajorantSegment {
            MajorantSegment { until: f32::INFINITY, minorant: Spectrum::ZERO, majorant: Spectrum::splat(2.0) }
        }
    }

    #[test]
    fn default_hessians_are_right_far_from_the_origin() {
        for start in [0.0, 100.0, 1_000.0, 10_000.0] {
            let hessian = Bowl(start).extinction_hessian(Vec3::new(start, 1.0, 0.0));
            // The rounding of four values near 1, over the square of a step of a hundredth.
            let most = 4.0 * f32::EPSILON / 1e-4;
            assert!((hessian.xx[0] - 40.0).abs() < most, "at {start}: {}", hessian.xx[0]);
            assert!(hessian.xy[0].abs() < most && hessian.yy.is_black(), "at {start}: {hessian:?}");
        }
    }
}
