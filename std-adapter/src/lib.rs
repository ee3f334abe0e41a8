//! Threads, film and files for [`fogbow`]: everything around a render, nothing of its mathematics.
//!
//! | module | holds |
//! |---|---|
//! | [`files`] | files of caches and grids, and what can be wrong with a file |
//! | [`film`] | sums of samples per pixel, in named layers; pictures |
//! | [`seed`] | the random numbers of each pixel and sample: independent, or low-discrepancy |
//! | [`tiles`] | parallel rendering, the same bits for any number of threads |
//! | [`progress`] | progress, cancellation |
//! | [`progressive`] | pictures in passes: photon beams, virtual lights |
//! | [`threads`] | the one driver: runs any work in rounds on threads |
//! | [`image`] | PNG, PFM and (feature `exr`, on by default) OpenEXR files |
//! | [`stats`] | the clock, queries of the world |
//!
//! A glowing fog in front of a black wall, 2 m away at the left and 6 m at the right:
//!
//! ```
//! use fogbow::{sampling::uniform, spectrum::Spectrum};
//! use fogbow_std::{film::Film, image, progress::Control, tiles::{Settings, render}};
//!
//! let (extinction, glow) = (Spectrum::new(0.2, 0.3, 0.5), Spectrum::splat(0.1));
//! let mut film = Film::new(16, 4, &["total", "distance"])?;
//! let settings = Settings { samples: 8, threads: 2, ..Settings::default() };
//! let outcome = render(&mut film, &settings, &Control::default(), |sample, rng, layers| {
//!     let distance = 2.0 + 4.0 * (sample.x as f32 + uniform(rng)) / 16.0;
//!     layers[0] = glow.ratio(extinction) * (Spectrum::ONE - (extinction * distance).transmitted());
//!     layers[1] = Spectrum::splat(distance);
//! })?;
//! assert_eq!((outcome.samples, outcome.counters.samples), (8, 8 * 16 * 4));
//!
//! let picture = film.mean(0).unwrap();
//! assert!(picture.pixels[15].mean() > picture.pixels[0].mean());
//! let file = std::env::temp_dir().join("fogbow-std-front-page.pfm");
//! image::write_film(&file, &film, 0.0)?;
//! assert_eq!(image::read(&file)?, picture);
//! # std::fs::remove_file(&file)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod files;
pub mod film;
pub mod image;
pub mod progress;
pub mod progressive;
pub mod seed;
pub mod stats;
pub mod threads;
pub mod tiles;
