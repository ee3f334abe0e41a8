//! Sums over paths.

use glam::{Vec2, Vec3};

use super::walk::{Incoming, Walk};
use crate::host::{Hit, Medium, Rng, Scene};
use crate::math::Ray;
use crate::sampling::{uniform, uniform2};
use crate::single_scatter::{Contribution, Directional, Sums, Towards};
use crate::spectrum::Spectrum;

/// Walks `paths` paths whose first directions are stratified in their cosine.
fn for_each_path<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    walk: &Walk<'_, M, S>,
    mut outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    paths: u32,
    rng: &mut (impl Rng + ?Sized),
    mut visit: impl FnMut(&Incoming),
) {
    let share = 1.0 / paths.max(1) as f32;
    let shift = uniform2(rng);
    for j in 0..paths {
        // The golden ratio spreads the azimuths whatever the number of paths.
        let azimuth = f64::from(j) * 0.618_033_988_749_894_9 + f64::from(shift.y);
        let first = Vec2::new(
            ((j as f32 + uniform(rng)) * share).min(1.0 - f32::EPSILON),
            (azimuth - libm::floor(azimuth)) as f32,
        );
        let mut incoming = walk.path(point, first, &mut outgoing, rng);
        incoming = incoming * share;
        visit(&incoming);
    }
}

/// Multiply scattered radiance at `point`, by `paths` walks, with its gradient and the sums of
/// J's Eq. 34. There, each path is one summand, its vertices' gradients added as vectors; here all paths
/// that start into the same twenty-fourth of the sphere are: the norms of single walks would
/// measure their noise, and radii shrink as if light changed where it does not.
///
/// Unbiased but for the marching of transmittance towards lights, the cut at
/// [`Settings::max_vertices`](super::Settings) and [`Settings::closest`](super::Settings). The
/// unshadowed sums equal the others: shadows inside a path are part of it.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, Sun}, math::Vec3, medium::Homogeneous, phase::{Lobe, Phase}};
/// # use fogbow::multiple_scatter::{Settings, Walk, sample};
/// # use fogbow::{sampling::Generator, single_scatter::Towards, spectrum::Spectrum, transmittance::thickness::Steps, world::World};
/// let dark = Homogeneous::new(Spectrum::ONE, Spectrum::ZERO, Lobe::Isotropic)?;
/// let lights = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE)?)];
/// let world = World { medium: &dark, scene: &Empty, lights: (&lights).into() };
/// let walk = Walk { world, settings: Settings::new(Steps::Length(0.1)) };
/// let towards = Towards { to_eye: Vec3::X, phase: &Phase::ISOTROPIC };
/// let sums = sample(Vec3::ZERO, &towards, &walk, |_, _| Spectrum::ZERO, 8, &mut Generator::new(1));
/// assert_eq!(sums.value, Spectrum::ZERO);   // soot scatters nothing
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[must_use]
pub fn sample<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    towards: &Towards<'_>,
    walk: &Walk<'_, M, S>,
    outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    paths: u32,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut cones = Cones::default();
    for_each_path(point, walk, outgoing, paths, rng, |incoming| {
        cones.add(incoming.to_light, &incoming.scatter(towards.to_eye, towards.phase));
    });
    cones.sums()
}

/// [`sample`] for all directions at once: adds to the expansion's coefficients; the sums returned
/// are of the mean over directions, `L₀₀ Y₀₀`.
///
/// ```
/// # use fogbow::{host::Empty, light::{Light, Sun}, math::Vec3, medium::{Homogeneous, Placed, Region}, phase::Phase};
/// # use fogbow::multiple_scatter::{Settings, Walk, sample_directional};
/// # use fogbow::single_scatter::{Directional, moments};
/// # use fogbow::{sampling::Generator, sh::Coefficient, spectrum::Spectrum, transmittance::thickness::Steps, world::World};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
/// let lights = [Light::Sun(Sun::new(Vec3::Z, Spectrum::ONE)?)];
/// let world = World { medium: &ball, scene: &Empty, lights: (&lights).into() };
/// let walk = Walk { world, settings: Settings::new(Steps::Length(0.1)) };
/// let f = moments(&Phase::ISOTROPIC, 0);
/// let mut coefficients = [Coefficient::ZERO];
/// let mut into = Directional { moments: &f[..1], coefficients: &mut coefficients };
/// let sums = sample_directional(Vec3::ZERO, &mut into, &walk, |_, _| Spectrum::ZERO, 64, &mut Generator::new(1));
/// // Y₀₀ is 1/√(4π).
/// assert!((sums.value[0] / coefficients[0].value[0] - 0.28209).abs() < 1e-4);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
pub fn sample_directional<M: Medium + ?Sized, S: Scene + ?Sized>(
    point: Vec3,
    into: &mut Directional<'_>,
    walk: &Walk<'_, M, S>,
    outgoing: impl FnMut(&Ray, &Hit) -> Spectrum,
    paths: u32,
    rng: &mut (impl Rng + ?Sized),
) -> Sums {
    let mut cones = Cones::default();
    for_each_path(point, walk, outgoing, paths, rng, |incoming| {
        cones.add(incoming.to_light, &incoming.scatter_directional(into.moments, 1.0, into.coefficients));
    });
    cones.sums()
}

/// Contributions by where they come from: octants, each in three.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cones([Contribution; 24]);

impl Cones {
    #[inline]
    pub(crate) fn add(&mut self, to_light: Vec3, contribution: &Contribution) {
        let size = to_light.abs();
        let third = if size.x >= size.y && size.x >= size.z {
            0
        } else if size.y >= size.z {
            1
        } else {
            2
        };
        let octant =
            usize::from(to_light.x < 0.0) | usize::from(to_light.y < 0.0) << 1 | usize::from(to_light.z < 0.0) << 2;
        self.0[octant * 3 + third] += *contribution;
    }

    /// The sums with every cone as one summand.
    pub(crate) fn sums(&self) -> Sums {
        let mut sums = Sums::default();
        self.0.iter().for_each(|cone| sums.add(cone, true));
        sums
    }
}
