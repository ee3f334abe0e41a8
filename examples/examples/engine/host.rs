//! Radiance caches in the engine: set up, filled a little in every frame, saved, loaded, and looked at.

use core::sync::atomic::{AtomicU32, Ordering};

use fogbow::bytes::Crc;
use fogbow::cache::{Asked, RadianceCaches, Settings, USUAL_ERROR};
use fogbow::picture::{self, Sample, Tiles};
use fogbow::sampling::{Generator, Independent};
use fogbow::spectrum::Spectrum;
use fogbow::world::{Outline, World};

use super::queue::Queue;
use super::world::{BOUNDS, PIXEL, SAMPLES, SIZE, eye_ray, level};

/// Threads; jobs of a frame; jobs after which the player leaves for a while.
const WORKERS: usize = 2;
const JOBS_PER_FRAME: u32 = 12;
const JOBS_PER_SITTING: u32 = 100;

/// Names the level in saved caches.
pub(crate) const TAG: u64 = 1;

/// Less effort than usual, so that this is quick.
pub(crate) fn quick(settings: Settings) -> Settings {
    Settings { rays: 256, ..settings.with_walks(64) }
}

pub(crate) fn picture_settings() -> picture::Settings {
    picture::Settings { size: SIZE, layers: 1, samples: SAMPLES, goal: None, seed: 0, tile: 8 }
}

/// Digests of the bytes of caches and of the bits of a picture.
pub(crate) fn digests(bytes: &[u8], picture: &Tiles<'_, Independent>) -> (u64, u64) {
    let (mut of_caches, mut of_picture) = (Crc::new(), Crc::new());
    of_caches.add(bytes);
    for pixel in 0..SIZE[0] * SIZE[1] {
        let colour = picture.mean(pixel % SIZE[0], pixel / SIZE[0], 0);
        colour.0.iter().for_each(|c| of_picture.add(&c.to_bits().to_le_bytes()));
    }
    (of_caches.value(), of_picture.value())
}

/// A point of the film in each sample's pixel.
pub(crate) fn film_point(sample: &Sample<'_, ()>) -> [f32; 2] {
    [(sample.x as f32 + 0.5) / SIZE[0] as f32, (sample.y as f32 + 0.5) / SIZE[1] as f32]
}

/// Fills caches, some jobs a frame, with breaks; saves and loads them; makes a picture of what was loaded.
pub(crate) fn run() -> Result<(u64, u64), Box<dyn core::error::Error>> {
    let level = level()?;
    let world = World { medium: &level.fog, scene: &level.room, lights: (&level.lamps).into() };
    let mut queue = Queue::new(WORKERS, JOBS_PER_FRAME);

    // set-up {
    let outline = Outline::of(&world, BOUNDS);
    let settings = Settings::for_outline(&outline, USUAL_ERROR).for_pixels(SIZE[0] * SIZE[1]);
    // }
    let settings = quick(settings);
    // set-up {
    let mut filling = RadianceCaches::new(settings).fill(Asked::View { ray: eye_ray, pixel: PIXEL });
    // }

    // Each sitting ends in the middle of a frame, whose last results are lost; the next takes up what was left.
    let (mut breaks, mut is_done) = (0, false);
    while !is_done {
        let asked = AtomicU32::new(0);
        let is_there = || asked.fetch_add(1, Ordering::Relaxed) < JOBS_PER_SITTING;
        while !is_done && asked.load(Ordering::Relaxed) <= JOBS_PER_SITTING {
            is_done = !queue.frame(&mut filling, &world, is_there);
        }
        breaks += u32::from(!is_done);
    }
    assert!(breaks > 1, "the fill was done before the first break");

    // set-up {
    let bytes = filling.finish().to_bytes(TAG);
    let mut caches = RadianceCaches::new(settings);
    caches.read(&bytes, TAG)?;
    let integrand = |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
        layers[0] = caches.radiance(&eye_ray(film_point(sample)), &world, rng).total();
    };
    let mut picture = Tiles::new(picture_settings(), Independent);
    Queue::new(WORKERS, JOBS_PER_FRAME).finish(&mut picture, &integrand);
    // }
    Ok(digests(&bytes, &picture))
}
