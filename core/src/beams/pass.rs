//! Shooting the beams of a pass, as work in rounds.

use core::ops::Range;

use glam::Vec3;

use super::piece::shoot;
use super::{Beams, Piece, Settings};
use crate::host::{Medium, Rng, Scene};
use crate::math::Ray;
use crate::path::{self, InScattered, Radiance};
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, independent, uniform};
use crate::storage::List;
use crate::work::Rounds;
use crate::world::World;

/// Paths of one job: part of the result, because each job has a key of random numbers. More: jobs take longer than some
/// milliseconds in dense worlds.
const JOB: u32 = 64;

/// Why there are no beams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BeamPassError {
    /// No paths or samples, or a radius, length or `alpha` out of range.
    Settings,
    /// The medium glows; photons leave lights only, so light of the medium that it scatters itself would be missing.
    Glowing,
    /// More pieces of beams than lent memory holds or 32 bits count.
    TooMany,
}

impl core::fmt::Display for BeamPassError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Settings => "photon beams need paths, positive lengths, and alpha in (0, 1]",
            Self::Glowing => "photon beams do not know light of glowing media: take another method",
            Self::TooMany => "too many photon beams",
        })
    }
}

impl core::error::Error for BeamPassError {}

/// What a job of a [`BeamPass`] leaves.
#[derive(Debug)]
#[cfg_attr(feature = "alloc", derive(Default))]
pub struct BeamOutput<'o> {
    pieces: List<'o, Piece>,
    error: Option<BeamPassError>,
}

impl<'o> BeamOutput<'o> {
    /// In lent memory: for the pieces that 64 paths leave. Where that is too small, the pass ends with
    /// [`BeamPassError::TooMany`].
    ///
    /// ```
    /// # use fogbow::beams::{BeamOutput, BeamPass, BeamPassError, Piece, Settings};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// let settings = Settings { paths: 16, ..Settings::for_outline(&outline) };
    /// let run = |slots: &mut [Piece]| {
    ///     let mut pass = BeamPass::new(&settings, 0, |_, pass| pass);
    ///     work::finish(&mut pass, &world, &mut BeamOutput::new(slots));
    ///     pass.error()
    /// };
    /// assert_eq!((run(&mut [Piece::default(); 2048]), run(&mut [Piece::default(); 15])), (None, Some(BeamPassError::TooMany)));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub fn new(pieces: impl Into<List<'o, Piece>>) -> Self {
        Self { pieces: pieces.into(), error: None }
    }
}

/// The beams of one pass, blurred as a function `radius` of a point (m) and of the pass's radius (m) says: `|_, pass| pass` for progressive photon
/// beams, `|point, pass| pass.max(…)` where something is known of how fast light changes. [`Rounds`] of jobs of 64 paths
/// in a [`World`].
///
/// ```
/// use fogbow::beams::{BeamOutput, BeamPass, Settings};
/// use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase};
/// use fogbow::{sampling::Generator, spectrum::Spectrum, work, world::{Outline, World}};
/// let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
/// let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
/// let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
/// let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
/// // A pilot tells how many paths leave 20 000 pieces.
/// let settings = Settings { pieces: 20_000, ..Settings::for_outline(&outline) };
/// let mut pilot = BeamPass::pilot(&settings);
/// work::finish(&mut pilot, &world, &mut BeamOutput::default());
/// let settings = pilot.settings_for_pieces();
/// let mut pass = BeamPass::new(&settings, 0, |_, pass| pass);
/// work::finish(&mut pass, &world, &mut BeamOutput::default());
/// let beams = pass.finish()?;
/// assert!((18_000..22_000).contains(&beams.pieces().len()));
/// // A sample of a pixel.
/// let eye = Ray::new(Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8));
/// let seen = beams.radiance(&eye, &world, &settings.walk, settings.share(0), &mut Generator::new(1));
/// assert!(seen.medium_single[0] > 0.0);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct BeamPass<'s, R> {
    settings: Settings,
    /// Seed of this pass, and its number.
    seed: u64,
    number: u32,
    radius: R,
    /// Radius (m) of this pass.
    of_pass: f32,
    beams: Beams<'s>,
    /// Jobs whose beams are in.
    taken: u32,
    error: Option<BeamPassError>,
}

/// The number of a pass that is never rendered.
const PILOT: u32 = u32::MAX;

impl<'s> BeamPass<'s, fn(Vec3, f32) -> f32> {
    /// A pass that is never rendered, of 2048 paths: see [`BeamPass::settings_for_pieces`].
    #[cfg(feature = "alloc")]
    #[must_use]
    pub fn pilot(settings: &Settings) -> Self {
        Self::pilot_in(Beams::new(alloc::vec::Vec::new(), alloc::vec::Vec::new()), settings)
    }

    /// As [`BeamPass::pilot`], in the memory of `beams`.
    ///
    /// ```
    /// # use fogbow::beams::{BeamNode, BeamOutput, BeamPass, Beams, Piece, Settings};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// let settings = Settings { pieces: 20_000, ..Settings::for_outline(&outline) };
    /// let (mut pieces, mut slots) = (vec![Piece::default(); 100_000], [Piece::default(); 4096]);
    /// // A pilot is counted, never looked up: it needs no tree.
    /// let mut pilot = BeamPass::pilot_in(Beams::new(&mut pieces[..], &mut [][..]), &settings);
    /// work::finish(&mut pilot, &world, &mut BeamOutput::new(&mut slots[..]));
    /// let settings = pilot.settings_for_pieces();
    /// let mut pass = BeamPass::new(&settings, 0, |_, pass| pass);
    /// work::finish(&mut pass, &world, &mut BeamOutput::default());
    /// assert!((18_000..22_000).contains(&pass.finish()?.pieces().len()));
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn pilot_in(beams: Beams<'s>, settings: &Settings) -> Self {
        Self::new_in(beams, &settings.of_pilot(), PILOT, |_, pass| pass)
    }
}

#[cfg(feature = "alloc")]
impl<R: Fn(Vec3, f32) -> f32> BeamPass<'static, R> {
    /// Pass number `number`; see [`BeamPass`].
    #[must_use]
    pub fn new(settings: &Settings, number: u32, radius: R) -> Self {
        Self::new_in(Beams::new(alloc::vec::Vec::new(), alloc::vec::Vec::new()), settings, number, radius)
    }
}

impl<'s, R: Fn(Vec3, f32) -> f32> BeamPass<'s, R> {
    /// As [`BeamPass::new`], in the memory of `beams`, which are forgotten. Where that is lent and too small, [`BeamPass::finish`] says so.
    ///
    /// ```
    /// use fogbow::beams::{BeamNode, BeamOutput, BeamPass, Beams, Piece, Settings};
    /// # use fogbow::{host::Empty, light::{Light, PointLight}, math::*, medium::Homogeneous, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::ONE)?)];
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&lamps).into() };
    /// # let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
    /// let settings = Settings { paths: 16, ..Settings::for_outline(&outline) };
    /// let (mut pieces, mut nodes) = ([Piece::default(); 2048], [BeamNode::default(); 2049]);
    /// let mut slots = [Piece::default(); 2048];
    /// let beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// let mut pass = BeamPass::new_in(beams, &settings, 0, |_, pass| pass);
    /// work::finish(&mut pass, &world, &mut BeamOutput::new(&mut slots[..]));
    /// assert!(!pass.finish()?.pieces().is_empty());
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    #[must_use]
    pub fn new_in(mut beams: Beams<'s>, settings: &Settings, number: u32, radius: R) -> Self {
        beams.clear();
        Self {
            settings: *settings,
            // Photons must have nothing to do with the pixels' numbers.
            seed: mix(settings.seed ^ 0x9e3d_11b6_0f7c_52a4) ^ u64::from(number),
            number,
            radius,
            of_pass: settings.radius_of(number),
            beams,
            taken: 0,
            error: (!settings.is_valid()).then_some(BeamPassError::Settings),
        }
    }
}

impl<'s, R> BeamPass<'s, R> {
    /// The beams, with a tree over them. Of a pass that was stopped they are those of the paths so far, and stand for all light all the
    /// same.
    ///
    /// # Errors
    /// See [`BeamPassError`].
    pub fn finish(mut self) -> Result<Beams<'s>, BeamPassError> {
        if let Some(error) = self.error {
            return Err(error);
        }
        self.beams.build(self.paths()).map_err(|_| BeamPassError::TooMany)?;
        Ok(self.beams)
    }

    /// What went wrong so far, if anything: then no jobs are left.
    #[must_use]
    pub fn error(&self) -> Option<BeamPassError> {
        self.error
    }

    /// The settings with as many paths as leave about [`Settings::pieces`], by the count that this pass left so far.
    #[must_use]
    pub fn settings_for_pieces(&self) -> Settings {
        self.settings.for_pieces(self.beams.pieces().len(), self.paths())
    }

    /// Paths whose beams are in.
    fn paths(&self) -> u32 {
        self.taken.saturating_mul(JOB).min(self.settings.paths)
    }
}

impl<M, S, R> Rounds<World<'_, M, S>> for BeamPass<'_, R>
where
    M: Medium + ?Sized,
    S: Scene + ?Sized,
    R: Fn(Vec3, f32) -> f32,
{
    type Output<'o> = BeamOutput<'o>;

    fn jobs(&self) -> Range<u32> {
        if self.error.is_some() { 0..0 } else { self.taken..self.settings.paths.div_ceil(JOB) }
    }

    fn run(&self, job: u32, world: &World<'_, M, S>, output: &mut BeamOutput<'_>) {
        output.pieces.clear();
        output.error = world.medium.is_emissive().then_some(BeamPassError::Glowing);
        if output.error.is_some() {
            return;
        }
        let BeamOutput { pieces, error } = output;
        let (settings, key) = (&self.settings, u64::from(self.number) << 32 | u64::from(job));
        let width = |point: Vec3| (self.radius)(point, self.of_pass);
        for path in job * JOB..(job * JOB).saturating_add(JOB).min(settings.paths) {
            let mut rng = independent(self.seed, key, path);
            let mut thin = independent(mix(self.seed), key, path);
            shoot(world, &settings.bounds, &settings.walk, settings.longest, &mut rng, &mut |piece| {
                piece.widened(&width, &mut |part| {
                    if let Some(part) = part.thinned(settings.radius, uniform(&mut thin))
                        && pieces.push(part).is_err()
                    {
                        *error = Some(BeamPassError::TooMany);
                    }
                });
            });
        }
    }

    fn accept(&mut self, output: &BeamOutput<'_>) {
        self.error = self.error.or(output.error);
        for piece in output.pieces.as_slice() {
            if self.beams.push(*piece).is_err() {
                self.error = self.error.or(Some(BeamPassError::TooMany));
            }
        }
        self.taken += 1;
    }

    fn stage(&self) -> &'static str {
        "shoot"
    }
}

impl Beams<'_> {
    /// A sample of a pixel: the medium's light from the beams, `share` times, that of surfaces by path tracing
    /// ([`path::radiance_beyond`]).
    ///
    /// Gathers cost more than the rest of a sample and are less noisy: so of some samples one gathers for all, and the others have a
    /// share of 0, which gathers nothing ([`Settings::share`]).
    ///
    /// ```
    /// # use fogbow::{beams::Beams, host::Empty, light::Light, math::*, path, sampling::Generator, spectrum::Spectrum, world::World};
    /// # let (mut pieces, mut nodes) = ([], []);
    /// # let beams = Beams::new(&mut pieces[..], &mut nodes[..]);
    /// // Without beams there is no light of the medium; surfaces and lights are seen all the same.
    /// let world = World { medium: &Empty, scene: &Empty, lights: (&[Light::Constant(Spectrum::ONE)]).into() };
    /// let eye = Ray::new(Vec3::ZERO, Vec3::Z);
    /// let seen = beams.radiance(&eye, &world, &path::Settings::default(), 1.0, &mut Generator::new(1));
    /// assert_eq!(seen.emitted, Spectrum::ONE);
    /// ```
    pub fn radiance<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        walk: &path::Settings,
        share: f32,
        rng: &mut (impl Rng + ?Sized),
    ) -> Radiance {
        path::radiance_beyond(ray, world, walk, rng, |segment: &Ray, most, rng: &mut Generator| {
            if share == 0.0 {
                return InScattered::default();
            }
            let light = self.gather(segment, world.medium, most, rng).light;
            InScattered { single: light.single * share, multiple: light.multiple * share }
        })
    }
}

#[cfg(all(test, feature = "alloc"))]
mod tests {
    use super::*;
    use crate::host::Empty;
    use crate::light::{Light, SpotLight};
    use crate::math::Bounds;
    use crate::medium::Homogeneous;
    use crate::phase::Phase;
    use crate::spectrum::Spectrum;
    use crate::work;
    use crate::world::Outline;

    #[test]
    fn kernels_by_covariances_narrow_until_light_is_that_of_the_path_tracer() {
        // A shaft a fifth of a metre wide, seen across its middle.
        let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.1), Phase::ISOTROPIC).unwrap();
        let spot = SpotLight::new(Vec3::NEG_Z, Vec3::Z, 0.1, 0.1, Spectrum::ONE).unwrap();
        let lights = [Light::Spot(spot)];
        let world = World { medium: &fog, scene: &Empty, lights: (&lights).into() };
        let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
        let walk = path::Settings { max_scatterings: 1, ..path::Settings::default() };
        let settings = Settings { walk, paths: 64, radius: 0.03, ..Settings::for_outline(&outline) };
        let ray = Ray::between(Vec3::NEG_X, Vec3::X);
        let samples = 20_000;
        let truth: f32 =
            (0..samples).map(|i| path::radiance(&ray, &world, &walk, &mut Generator::new(i)).medium_single[0]).sum();
        let truth = f64::from(truth) / samples as f64;
        // Mean and standard error over many passes of one number: how far off they are.
        let off = |number: u32| {
            let (count, mut sum, mut squares) = (2000, 0.0, 0.0);
            for seed in 0..count {
                let settings = Settings { seed, ..settings };
                let mut pass = BeamPass::new(&settings, number, |_, pass| settings.widened(0.3, pass));
                work::finish(&mut pass, &world, &mut BeamOutput::default());
                let beams = pass.finish().unwrap();
                let light = beams.gather(&ray, &fog, u32::MAX, &mut Generator::new(seed)).light.single[0];
                let found = f64::from(light) / truth - 1.0;
                sum += found;
                squares += found * found;
            }
            let n = count as f64;
            (sum / n, libm::sqrt((squares / n - (sum / n) * (sum / n)) / n))
        };
        let [first, some, many] = [0, 1000, 100_000].map(off);
        assert!(first.0 < -0.3, "a kernel wider than the shaft must show: {first:?}");
        assert!(some.0 < -8.0 * some.1, "{some:?} is too noisy to tell");
        // Radii like i^−0.2, blur like their square: after a hundred times as many passes it is 6.3 times less.
        let error = libm::sqrt(many.1 * many.1 + some.1 * some.1 / 40.0);
        assert!((many.0 - some.0 / 6.31).abs() < 0.005 + 4.0 * error, "{some:?}, then {many:?}");
        assert!(many.0.abs() < 0.015 + 4.0 * many.1, "{many:?} is what is left");
    }
}
