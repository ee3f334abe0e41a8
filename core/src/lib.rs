//! Light in fog, smoke and clouds: the mathematics of participating media, for any host.
//!
//! The host brings the world: a [medium](host::Medium), [surfaces](host::Scene), [lights](light::Light), random numbers,
//! memory and threads. This renders fog around a lamp by radiance caching:
//!
//! ```
//! # #[cfg(not(feature = "alloc"))]
//! # fn main() {}
//! # #[cfg(feature = "alloc")]
//! # fn main() -> Result<(), Box<dyn core::error::Error>> {
//! # use fogbow::cache::{Asked, FilledRecords, RadianceCaches, Settings};
//! # use fogbow::{host::Empty, light::{Light, PointLight}, math::{Bounds, Ray, Vec3}, phase::Lobe};
//! # use fogbow::medium::{Homogeneous, Placed, Region};
//! # use fogbow::{sampling::Generator, spectrum::Spectrum, work, world::{Outline, World}};
//! let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.9), Lobe::HenyeyGreenstein { g: 0.7 })?;
//! let ball = Placed::new(fog, Region::sphere(Vec3::ZERO, 1.0)?);
//! let lamps = [Light::Point(PointLight::from_flux(Vec3::ZERO, Spectrum::splat(60.0))?)];
//! let world = World { medium: &ball, scene: &Empty, lights: (&lamps).into() };
//! let ray = |at: [f32; 2]| Ray::new(Vec3::Z * 3.0, Vec3::new(0.8 * at[0] - 0.4, 0.8 * at[1] - 0.4, -1.0).normalize());
//!
//! let outline = Outline::of(&world, Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE });
//! let settings = Settings::for_outline(&outline, 0.02);
//! # let settings = Settings { rays: 64, ..settings.with_walks(16) };
//! let mut filling = RadianceCaches::new(settings).fill(Asked::View { ray, pixel: 0.005 });
//! work::finish(&mut filling, &world, &mut FilledRecords::default()); // Or job by job, or on threads: see `work`.
//! let caches = filling.finish();
//!
//! let mut rng = Generator::new(1);
//! let [middle, edge] = [[0.5, 0.5], [0.5, 0.2]].map(|at| caches.radiance(&ray(at), &world, &mut rng).total());
//! assert!(middle.mean() > edge.mean() && edge.mean() > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! # Where to look
//!
//! | to | see |
//! |---|---|
//! | bring media, surfaces, random numbers | [`host`] (two traits, with two and one required methods); [`world`] puts them together |
//! | use media and lights that are there | [`medium`], [`light`], [`surface`], [`phase`] |
//! | render a picture | [`path`] (unbiased), [`cache`], [`beams`], [`vpl`], [`march`]; [`picture`] decides how many samples |
//! | run a method on threads, or a little in every frame | [`work`]; `fogbow_std::threads::run` is a driver for threads |
//! | know light at a point, with its gradient | [`single_scatter`], [`multiple_scatter`], [`cache`] |
//! | know light at a point from caches, for any direction (a probe) | `in_scattered_sh` of [`cache::RadianceCaches`] |
//! | bake light into 3D textures | [`bake`] |
//! | know how much light gets through | [`transmittance`] |
//! | know how fast light varies | [`covariance`] |
//! | follow light from the lights | [`photon`] |
//! | one formula | [`math`], [`sampling`], [`sh`], [`spectrum`], and the index of equations: `EQUATIONS.md` beside this crate's manifest |
//! | lend memory, save bytes | [`storage`], [`bytes`] |
//! | send what jobs leave to workers that share no memory | [`sent`] |
//!
//! The head of each module holds its formula, its source and its files. How the modules build on each other, and why:
//! `ARCHITECTURE.md` and `decisions/`, beside the manifest, too.
//!
//! # Features
//!
//! | feature | default | adds |
//! |---|---|---|
//! | `alloc` | no | storage that grows ([`List`](storage::List) from a `Vec`); changes no result. Without it, all memory is lent by the host |
//!
//! # Guarantees
//!
//! * `no_std`, no `unsafe`; no clocks, threads, locks or files. Without `alloc` nothing allocates.
//! * A result depends on the arguments alone, random numbers included: the same bits for any number of threads, and on
//!   every target with IEEE floats.
//! * Lengths are metres, angles radians, light is W·m⁻²·sr⁻¹; where it is otherwise, the item says so.
//! * What is exact, unbiased or approximate is said at each item. The path tracer is unbiased and clamps nothing;
//!   caches interpolate, beams blur, and marched transmittance is slightly too bright in media that vary.
#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;

pub use bytemuck;
pub use glam;
pub use rand_core;

pub mod bake;
pub mod beams;
pub mod bytes;
pub mod cache;
pub mod covariance;
pub mod host;
pub mod light;
pub mod march;
pub mod math;
pub mod medium;
pub mod multiple_scatter;
pub mod path;
pub mod phase;
pub mod photon;
pub mod picture;
pub mod sampling;
pub mod sent;
pub mod sh;
pub mod single_scatter;
pub mod spectrum;
pub mod storage;
pub mod surface;
pub mod transmittance;
pub mod vpl;
pub mod work;
pub mod world;
