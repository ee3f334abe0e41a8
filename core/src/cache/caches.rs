//! All caches of a world together.

use super::asked::Asked;
use super::audit::{Deviation, Findings};
use super::bias_map::BiasMap;
use super::eye::{Last, straight};
use super::kind::Kind;
use super::photons::{PhotonEffort, PhotonGrid};
use super::presets::{MENDED, finer_by};
use super::record::Record;
use super::room::{chunks_of, stride_of};
use super::seen::{CachedRadiance, Caches, Reader, radiance, radiance_beyond};
use super::settings::Settings;
use super::shares::Shares;
use super::slot::{ByKind, Slot};
use super::{Estimator, SurfaceCache, VolumeCache};
use crate::host::{Medium, Rng, Scene};
use crate::math::Ray;
use crate::sampling::uniform;
use crate::spectrum::Spectrum;
use crate::storage::{Chunk, List, most_within};
use crate::transmittance::thickness::Marching;
use crate::world::World;

/// The caches of a world, by kind. They may be filled again for another view ([`RadianceCaches::fill`]), and then gain
/// what is missing.
///
/// ```
/// # #[cfg(feature = "alloc")] {
/// # use fogbow::cache::{Asked, CachedRadiance, FilledRecords, Kind, RadianceCaches, Settings};
/// # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Ray, Vec3}, medium::{Homogeneous, Placed, Region}};
/// # use fogbow::{phase::Lobe, sampling::{Generator, Independent}, spectrum::Spectrum, work, world::{Outline, World}};
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.8), Lobe::HenyeyGreenstein { g: 0.3 })?;
/// let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
/// let lamps = [Light::Point(PointLight::from_flux(0.2 * Vec3::Y, Spectrum::ONE)?)];
/// let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
/// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
///
/// // Anywhere in a box: coarser than usual, so that this example is quick.
/// let settings = Settings { rays: 200, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(64) };
/// let mut filling = RadianceCaches::new(settings).fill(Asked::anywhere_in(bounds));
/// work::finish(&mut filling, &world, &mut FilledRecords::default());
/// assert!(!filling.is_cut() && filling.computed(Kind::Multiple) > 0);
/// assert!(!filling.caches().records(Kind::Multiple).is_empty());
/// let caches = filling.finish();
/// assert!(caches.settings().surface.is_some() && !caches.is_open() && caches.bytes(Kind::Multiple) > 0);
/// assert!(caches.volume(Kind::Multiple).is_some() && caches.surface(Kind::Irradiance).is_some());
/// assert!(caches.reader().single.is_none(), "one lamp is connected to");
///
/// // A pixel, and many; light that the medium scatters left out.
/// let (ray, rng) = (Ray::new(-2.0 * Vec3::Z, Vec3::Z), &mut Generator::new(1));
/// assert!(caches.radiance(&ray, &world, rng).medium_multiple.mean() > 0.0);
/// assert_eq!(caches.radiance_beyond(&ray, &world, rng).total(), Spectrum::ZERO);
/// let mut seen = [CachedRadiance::default(); 2];
/// caches.radiance_many(&[ray, ray], &mut seen, &world, 0, &Independent);
/// assert!(seen[1].total().mean() > 0.0);
///
/// // A point towards an eye, by part; a probe for any direction, whose degree 0 says the fluence.
/// let point = 0.4 * Vec3::X;
/// assert_eq!(caches.in_scattered(point, Vec3::NEG_Z, &world, rng).sampled, 1, "light of the lamp, not cached");
/// let mut probe = [Spectrum::ZERO; 4];
/// assert!(caches.in_scattered_sh(point, &mut probe));
/// let fluence = caches.fluence(point).unwrap();
/// assert!((fluence[0] / probe[0][0] - libm::sqrtf(4.0 * core::f32::consts::PI)).abs() < 1e-3);
/// let (mut probes, mut fluences) = ([Spectrum::ZERO; 8], [Spectrum::ZERO; 2]);
/// assert_eq!(caches.in_scattered_sh_many(&[point, 9.0 * Vec3::X], &mut probes), 1, "nothing is known out there");
/// assert_eq!((caches.fluence_many(&[point, point], &mut fluences), fluences[1]), (0, fluence));
///
/// // There are no surfaces, so nothing is known of their irradiance.
/// assert_eq!(caches.irradiance(Vec3::ZERO, Vec3::Y), None);
/// assert_eq!(caches.irradiance_many(&[(Vec3::ZERO, Vec3::Y)], &mut [Spectrum::ONE]), 1);
///
/// // To bytes and back.
/// let bytes = caches.to_bytes(7);
/// let (mut copy, mut written) = (RadianceCaches::new(settings), 0);
/// copy.read(&bytes, 7)?;
/// copy.write(7, |part| Ok::<(), ()>(written += part.len())).unwrap();
/// assert_eq!((copy.fluence(point), copy.byte_count(), written), (Some(fluence), bytes.len(), bytes.len()));
/// # }
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct RadianceCaches<'s> {
    pub(super) settings: Settings,
    pub(super) slots: ByKind<Slot<'s>>,
    /// Marks of the views that were filled to the end: for them nothing is missing.
    pub(super) views: List<'s, u64>,
    /// Records that no fill will estimate again.
    pub(super) settled: ByKind<usize>,
    /// How often records were dropped: those that take their place must not meet the same chances.
    pub(super) dropped: u32,
    /// How often when photons were last to meet other chances.
    dropped_with_photons: u32,
    /// What part of the light of the last view each kind brings, as far as that is known.
    pub(super) shares: Shares,
    /// The relative noise that coarse irradiance leaves in a picture, 0 before it is told.
    pub(super) ground: f32,
    /// The light in cells that the last complete shooting has left: of the world, not of a view.
    pub(super) photons: PhotonGrid<'s>,
}

#[cfg(feature = "alloc")]
impl RadianceCaches<'static> {
    /// Empty caches in memory that grows.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        let slot = |kind: Kind| match stride_of(&settings, kind) {
            None => Slot::Off,
            Some(stride) if kind.is_on_surfaces() => Slot::Surface(SurfaceCache::growing(stride)),
            Some(stride) => Slot::Volume(VolumeCache::growing(stride)),
        };
        Self {
            settings,
            slots: ByKind(Kind::ALL.map(slot)),
            views: List::default(),
            settled: ByKind([0; Kind::COUNT]),
            dropped: 0,
            dropped_with_photons: 0,
            shares: Shares::UNKNOWN,
            ground: 0.0,
            photons: PhotonGrid::none(),
        }
    }
}

impl<'s> RadianceCaches<'s> {
    /// Empty caches in lent memory, with room for as many records of every kind that the settings use. `views` has room for
    /// a number for each view that they are to be filled for.
    ///
    /// [`room_for`](super::room_for) tells how much is needed: [`Room::chunks`](super::Room::chunks). Where there is too little,
    /// places have no record, and eye rays sample what is missing: [`Filling::is_cut`](super::Filling::is_cut).
    ///
    /// ```
    /// # use fogbow::cache::*;
    /// # use fogbow::{host::Empty, math::{Bounds, Ray, Vec3}, medium::Homogeneous, phase::Phase, storage::Chunk};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let world = World { medium: &fog, scene: &Empty, lights: (&[]).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let limits = Limits { min: 0.1, max: 1.0 };
    /// # let effort = Effort { tolerance: 0.5, samples: 16, degree: 1, limits, clearance: f32::INFINITY, free_paths: f32::INFINITY };
    /// let settings = Settings { surface: Some(effort), rays: 16, ..Settings::default() };
    /// // One cache of 48 records with three coefficients each, and two numbers of what these leave out towards the eye.
    /// let (mut memory, mut views) = ([Chunk::default(); VolumeCache::chunks(48, 3 + 2)], [0; 1]);
    /// assert_eq!(room_for(&settings, 1000, 48).chunks, memory.len());
    /// let caches = RadianceCaches::lent(settings, &mut views[..], &mut memory);
    ///
    /// // As much for the fill and for its jobs; here there is none, so that no place is even looked for.
    /// let asked = Asked::anywhere_in(bounds);
    /// let mut filling = caches.fill_in(FillingMemory::lent(Slots::default()), asked);
    /// work::finish(&mut filling, &world, &mut FilledRecords::lent(&mut [], &mut [], &mut [], &mut []));
    /// assert!(filling.is_cut() && filling.finish().records(Kind::Surface).is_empty());
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn lent(settings: Settings, views: impl Into<List<'s, u64>>, memory: &'s mut [Chunk]) -> Self {
        let needed = |records| Kind::ALL.into_iter().map(|kind| chunks_of(&settings, kind, records)).sum::<usize>();
        let records = most_within(memory.len(), needed);
        let mut rest = memory;
        let slots = Kind::ALL.map(|kind| match stride_of(&settings, kind) {
            None => Slot::Off,
            Some(stride) if kind.is_on_surfaces() => Slot::Surface(SurfaceCache::carved(&mut rest, records, stride)),
            Some(stride) => Slot::Volume(VolumeCache::carved(&mut rest, records, stride)),
        });
        let mut views = views.into();
        views.clear();
        Self {
            settings,
            slots: ByKind(slots),
            views,
            settled: ByKind([0; Kind::COUNT]),
            dropped: 0,
            dropped_with_photons: 0,
            shares: Shares::UNKNOWN,
            ground: 0.0,
            photons: PhotonGrid::none(),
        }
    }
}

impl RadianceCaches<'_> {
    /// What they are filled with.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The records of a kind.
    #[must_use]
    pub fn records(&self, kind: Kind) -> &[Record] {
        self.slots[kind].records()
    }

    /// Bytes of memory that a kind holds.
    #[must_use]
    pub fn bytes(&self, kind: Kind) -> usize {
        self.slots[kind].bytes()
    }

    /// The cache of a kind in the medium, and how it is read.
    #[must_use]
    pub fn volume(&self, kind: Kind) -> Option<Reader<'_, VolumeCache<'_>>> {
        Some(Reader { cache: self.slots[kind].volume()?, reading: self.settings.reading(kind)? })
    }

    /// The cache of a kind on surfaces, and how it is read.
    #[must_use]
    pub fn surface(&self, kind: Kind) -> Option<Reader<'_, SurfaceCache<'_>>> {
        Some(Reader { cache: self.slots[kind].surface()?, reading: self.settings.reading(kind)? })
    }

    /// The caches that pictures are made from.
    #[must_use]
    pub fn reader(&self) -> Caches<'_> {
        Caches {
            single: self.volume(Kind::Single),
            surface: self.volume(Kind::Surface),
            multiple: self.volume(Kind::Multiple),
            irradiance: self.surface(Kind::Irradiance),
        }
    }

    /// An estimator in `world` as eye rays use it: one sample where caches have nothing.
    pub(super) fn estimator<'a, M: ?Sized, S: ?Sized>(&'a self, world: &World<'a, M, S>) -> Estimator<'a, M, S> {
        Estimator {
            world: *world,
            surfaces: self.surface(Kind::Irradiance).map(|reader| (reader.cache, reader.reading)),
            photons: None,
            walk: self.settings.walk,
            paths: self.settings.paths,
            light_samples: 1,
            finest: self.settings.finest,
        }
    }

    /// An estimator in `world` as records are made by it: walks end at coarse irradiance, and in cells that photons have lit if they are there.
    pub(super) fn making<'a, M: ?Sized, S: ?Sized>(&'a self, world: &World<'a, M, S>) -> Estimator<'a, M, S> {
        let surfaces = self.surface(Kind::CoarseIrradiance).map(|reader| (reader.cache, reader.reading));
        let photons = Some(&self.photons).filter(|photons| photons.is_made());
        Estimator { surfaces, photons, ..self.estimator(world) }
    }

    /// Radiance that arrives at the origin of `ray`: a sample of a pixel. See [`radiance`].
    #[must_use]
    pub fn radiance<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        rng: &mut (impl Rng + ?Sized),
    ) -> CachedRadiance {
        radiance(ray, &self.estimator(world), &self.reader(), &self.settings.eye, rng)
    }

    /// As [`RadianceCaches::radiance`], but for light that the medium scatters. See [`radiance_beyond`].
    #[must_use]
    pub fn radiance_beyond<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        rng: &mut (impl Rng + ?Sized),
    ) -> CachedRadiance {
        radiance_beyond(ray, &self.estimator(world), &self.reader(), &self.settings.eye, rng)
    }

    /// Of [`RadianceCaches::radiance`] what comes straight from lights ([`CachedRadiance::straight`]): edges of lamps are most of the noise of their pixels, and this is a
    /// small part of the work of a sample, so that pictures take the mean of several.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::cache::{RadianceCaches, Settings};
    /// # use fogbow::{host::Empty, light::Light, math::{Ray, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::{sampling::Generator, spectrum::Spectrum, world::World};
    /// // A sky of 1, seen through a ball of fog two metres wide that absorbs.
    /// let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ZERO, Phase::ISOTROPIC)?;
    /// let (ball, sky) = (Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?), [Light::Constant(Spectrum::ONE)]);
    /// let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    /// let (caches, ray, rng) = (RadianceCaches::new(Settings::default()), Ray::new(-5.0 * Vec3::X, Vec3::X), &mut Generator::new(1));
    /// let (seen, straight) = (caches.radiance(&ray, &world, rng), caches.straight(&ray, &world, rng));
    /// assert!((straight[0] - (-2.0_f32).exp()).abs() < 1e-6 && (seen.straight[0] - straight[0]).abs() < 1e-6);
    /// # }
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    #[must_use]
    pub fn straight<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        ray: &Ray,
        world: &World<'_, M, S>,
        rng: &mut (impl Rng + ?Sized),
    ) -> Spectrum {
        let Settings { eye, walk, .. } = &self.settings;
        if !eye.lights_visible {
            return Spectrum::ZERO;
        }
        let all = (Last::Discrete, Spectrum::ONE, Spectrum::ONE);
        straight(ray, world, Marching { steps: walk.steps, offset: uniform(rng) }, all)
    }

    /// Drops the records that an [`Audit`](super::Audit) has found off by certainly more than `error`, or, in the mean of the picture, certainly off and by more than
    /// half of it, to be made anew by the next fill: finer by what they are off, with four times the samples. If regions are off, and the others together are not, those go that are seen in them along
    /// `ray`, of the kinds that are off there; else all of the kinds that are to blame, or of every kind if none is alone. Kinds whose gradients lead the wrong way ([`Findings::is_misled`]) go as a
    /// whole. Returns whether any were dropped.
    ///
    /// What finer records do not mend (walks that are cut, lights without surfaces) stays as it is: audit again, and say so.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// use fogbow::{cache::{Audit, RadianceCaches, Settings}, math::{Ray, Vec3}};
    /// # use fogbow::{host::Empty, world::World};
    /// # let world = World { medium: &Empty, scene: &Empty, lights: (&[]).into() };
    /// let mut caches = RadianceCaches::new(Settings::default());
    /// let ray = |_| Ray::new(Vec3::ZERO, Vec3::Z);
    /// // Nothing was compared: nothing is wrong.
    /// let audit = Audit::new(&caches, ray, 64);
    /// let (findings, map) = (audit.findings(), audit.map());
    /// assert!(!caches.drop_wrong((&findings, &map), 0.02, ray, &world));
    /// # }
    /// ```
    pub fn drop_wrong<M: Medium + ?Sized, S: Scene + ?Sized>(
        &mut self,
        (findings, map): (&Findings, &BiasMap),
        error: f32,
        ray: impl Fn([f32; 2]) -> Ray,
        world: &World<'_, M, S>,
    ) -> bool {
        let most = f64::from(error);
        let (places, by_rays) = (findings.places(map, most), findings.wrong(map, most));
        let wrong: [Option<Deviation>; 4] = core::array::from_fn(|number| {
            let kind = Kind::FINAL[number];
            let is_misled = findings.is_misled(kind).then_some(Deviation { bias: most, error: 0.0 });
            by_rays[number].or(is_misled).filter(|_| self.settings.effort(kind).is_some())
        });
        let wrong = || Kind::FINAL.into_iter().zip(wrong).filter_map(|(kind, found)| Some((kind, found?)));
        // Gradients that lead the wrong way do so everywhere.
        Kind::FINAL.into_iter().filter(|kind| findings.is_misled(*kind)).for_each(|kind| self.forget(kind));
        if places.is_some() {
            let is_wrong = |at| map.at(at).is_off(most, map.regions().len() as u32);
            self.drop_seen(|| wrong().map(|(kind, _)| kind), is_wrong, ray, world);
        } else {
            wrong().for_each(|(kind, _)| self.forget(kind));
        }
        let any = wrong().next().is_some();
        for (kind, found) in wrong() {
            // What is off everywhere may be so because of what lights it.
            if matches!(kind, Kind::Surface | Kind::Irradiance) && places.is_none() {
                self.forget(Kind::CoarseIrradiance);
            }
            let finer = finer_by(if found.bias.abs() > most { most } else { MENDED * most }, found.bias);
            if let Some(effort) = self.settings.effort_mut(kind) {
                *effort = effort.finer(finer);
            }
            // Noise of cells is seen in many places, or again after records were made anew.
            let are_doubted = kind == Kind::Multiple && (places.is_none() || self.dropped > 0);
            if let Some(photons) = self.settings.photons.as_mut().filter(|_| are_doubted) {
                *photons = photons.finer();
                self.dropped_with_photons = self.dropped + 1;
            }
        }
        if any {
            self.views.clear();
            self.dropped += 1;
        }
        any
    }

    /// The photons to shoot, and their random numbers; none if nothing is made by walks.
    pub(super) fn photon_effort(&self) -> Option<(PhotonEffort, u64)> {
        let Settings { photons, multiple, irradiance, .. } = &self.settings;
        let effort = photons.filter(|_| multiple.is_some() || irradiance.is_some())?;
        Some((effort, self.settings.seed ^ u64::from(self.dropped_with_photons) << 32))
    }

    /// Bytes of memory that the light in cells holds: see [`RadianceCaches::forget_photons`].
    ///
    /// ```
    /// # #[cfg(feature = "alloc")]
    /// assert_eq!(fogbow::cache::RadianceCaches::new(Default::default()).photon_bytes(), 0); // none were shot
    /// ```
    #[must_use]
    pub fn photon_bytes(&self) -> usize {
        self.photons.bytes()
    }

    /// Forgets the light in cells that photons have left, and gives its memory back. It is kept after a fill, because the next one, for another
    /// view, needs the same, and shooting photons is most of its work; who fills no more, or rarely, may want the memory. It is not saved.
    ///
    /// ```
    /// # #[cfg(feature = "alloc")] {
    /// # use fogbow::cache::{Asked, FilledRecords, RadianceCaches, Settings};
    /// # use fogbow::{host::Empty, light::Light, math::{Bounds, Ray, Vec3}, medium::{Homogeneous, Placed, Region}, phase::Phase};
    /// # use fogbow::{spectrum::Spectrum, work, world::{Outline, World}};
    /// # let fog = Homogeneous::new(Spectrum::ONE, Spectrum::ONE, Phase::ISOTROPIC)?;
    /// # let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
    /// # let sky = [Light::Constant(Spectrum::ONE)];
    /// # let world = World { medium: &ball, scene: &Empty, lights: (&sky).into() };
    /// # let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// # let settings = Settings { rays: 16, ..Settings::for_outline(&Outline::of(&world, bounds), 0.02).with_walks(16) };
    /// let mut filling = RadianceCaches::new(settings).fill(Asked::anywhere_in(bounds));
    /// work::finish(&mut filling, &world, &mut FilledRecords::default());
    /// let mut caches = filling.finish();
    /// assert!(caches.photon_bytes() > 1 << 20);
    /// caches.forget_photons();
    /// assert_eq!(caches.photon_bytes(), 0);
    /// # }
    /// # Ok::<(), fogbow::medium::MediumError>(())
    /// ```
    pub fn forget_photons(&mut self) {
        self.photons = PhotonGrid::none();
    }

    fn forget(&mut self, kind: Kind) {
        self.slots[kind].clear();
        self.settled[kind] = 0;
    }

    /// Drops the records of some kinds that reach what eye rays at points of the picture that are `wrong` ask for.
    fn drop_seen<M: Medium + ?Sized, S: Scene + ?Sized, K: Iterator<Item = Kind>>(
        &mut self,
        kinds: impl Fn() -> K,
        wrong: impl Fn([f32; 2]) -> bool,
        ray: impl Fn([f32; 2]) -> Ray,
        world: &World<'_, M, S>,
    ) {
        let (settings, slots) = (&self.settings, &mut self.slots);
        let asked = Asked::View { ray, pixel: 0.0 };
        for number in (0..settings.rays).filter(|number| wrong(Asked::at(*number))) {
            asked.visit(number, world, settings, &mut |place, _| {
                if place.is_seen {
                    kinds()
                        .filter(|kind| kind.row().places.hold(&place))
                        .for_each(|kind| slots[kind].doubt(place.point));
                }
            });
        }
        for kind in kinds() {
            self.settled[kind] = self.slots[kind].drop_doubted(self.settled[kind]);
        }
    }

    /// Brings all records into the indices.
    pub(super) fn finish(&mut self) {
        // An index without room answers as it did, and records beside it are looked at one by one.
        self.slots.0.iter_mut().for_each(|slot| {
            let _ = slot.finish();
        });
    }

    /// Whether a fill was left before its end: what it has made will be estimated anew.
    #[must_use]
    pub fn is_open(&self) -> bool {
        Kind::ALL.into_iter().any(|kind| kind != Kind::Single && self.settled[kind] != self.slots[kind].len())
    }
}
