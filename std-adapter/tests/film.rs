//! Films: sizes, sums, means.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::{Film, Image, SizeError};

#[test]
fn impossible_films_are_errors() {
    let new = |width, height, layers: &[&str]| Film::new(width, height, layers).unwrap_err();
    assert_eq!(new(0, 5, &["a"]), SizeError::Empty);
    assert_eq!(new(5, 0, &["a"]), SizeError::Empty);
    assert_eq!(new(u32::MAX, u32::MAX, &["a"]), SizeError::TooLarge);
    assert_eq!(new(1, 1, &[]), SizeError::NoLayers);
    assert_eq!(new(1, 1, &["a", "b", "a"]), SizeError::LayerNames);
    assert_eq!(new(1, 1, &["a", ""]), SizeError::LayerNames);
    assert_eq!(Image::new(0, 1, Spectrum::ONE).unwrap_err(), SizeError::Empty);
}

#[test]
fn pixels_outside_and_without_samples_are_harmless() {
    let mut film = Film::new(2, 2, &["a", "b"]).unwrap();
    film.add(2, 0, &[Spectrum::ONE]);
    film.add(0, 1, &[Spectrum::ONE]);
    assert_eq!((film.total_count(), film.min_count(), film.count(0, 1), film.count(9, 9)), (1, 0, 1, 0));
    let image = film.mean(0).unwrap();
    assert_eq!(image.get(0, 1), Some(Spectrum::ONE));
    assert_eq!((image.get(0, 0), image.get(2, 0), image.get(0, 2)), (Some(Spectrum::ZERO), None, None));
    assert!(film.mean(2).is_none());
    film.clear();
    assert_eq!(film, Film::new(2, 2, &["a", "b"]).unwrap());
}

#[test]
fn many_samples_do_not_lose_small_ones() {
    // In f32 the sum would stand still at 2²⁴.
    let mut film = Film::new(1, 1, &["a"]).unwrap();
    film.add(0, 0, &[Spectrum::splat(1e9)]);
    for _ in 0..1000 {
        film.add(0, 0, &[Spectrum::ONE]);
    }
    let mean = film.mean(0).unwrap().pixels[0][0];
    assert_eq!(mean, (1_000_001_000.0_f64 / 1001.0) as f32);
}
