//! What constructors refuse.

use fogbow::host::Properties;
use fogbow::math::{Affine3, Bounds, Mat3, Vec3};
use fogbow::medium::{Density, DensityGrid, FractalNoise, MediumError, MinMax, Noise, Region};
use fogbow::phase::Phase;
use fogbow::spectrum::Spectrum;

use super::common::*;

#[test]
fn constructors_name_what_they_refuse() {
    let refused = |size: [u32; 3], values: Vec<f32>, placement: Affine3| {
        let blocks = vec![MinMax::default(); DensityGrid::block_count(size)];
        Voxels { size, values, blocks, placement }.try_grid().err()
    };
    let unit = Affine3::IDENTITY;
    let flat = Affine3 { matrix3: Mat3::from_diagonal(Vec3::new(1.0, 0.0, 1.0)), translation: Vec3::ZERO };
    let skew = Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::X + Vec3::Y);
    assert_eq!(refused([2, 2, 2], vec![1.0; 8], unit), None);
    assert_eq!(refused([2, 0, 2], vec![], unit), Some(MediumError::Size));
    assert_eq!(refused([2, 2, 2], vec![1.0; 7], unit), Some(MediumError::Size));
    assert_eq!(refused([u32::MAX, u32::MAX, 1], vec![1.0; 7], unit), Some(MediumError::Size));
    for bad in [f32::NAN, -1.0, f32::INFINITY] {
        assert_eq!(refused([1, 1, 2], vec![0.0, bad], unit), Some(MediumError::Density));
    }
    assert_eq!(refused([1, 1, 1], vec![f32::MAX], unit), Some(MediumError::Coefficients));
    assert_eq!(refused([1, 1, 1], vec![1.0], flat), Some(MediumError::Placement));
    let skew = Affine3 { matrix3: skew, translation: Vec3::ZERO };
    assert_eq!(refused([1, 1, 1], vec![1.0], skew), Some(MediumError::Placement));
    let nowhere = Affine3 { translation: Vec3::NAN, ..unit };
    assert_eq!(refused([1, 1, 1], vec![1.0], nowhere), Some(MediumError::Placement));
    let grid = |coefficient: f32, blocks: &mut [MinMax]| {
        let sigma = Spectrum::splat(coefficient);
        let fog = Properties { absorption: sigma, scattering: sigma, ..Properties::VACUUM };
        DensityGrid::new([1, 1, 1], Density::U8(&[9]), &fog, unit, blocks).err()
    };
    assert_eq!(grid(f32::NAN, &mut [MinMax::default()]), Some(MediumError::Coefficients));
    assert_eq!(grid(1.0, &mut []), Some(MediumError::Blocks));
    for emission in [f32::NAN, -1.0, f32::MAX] {
        let fire = Properties { emission: Spectrum::splat(emission), ..Properties::VACUUM };
        let (hot, mut blocks) = (Density::F32(&[2.0]), [MinMax::default()]);
        assert_eq!(DensityGrid::new([1, 1, 1], hot, &fire, unit, &mut blocks).err(), Some(MediumError::Emission));
    }
    assert!(Region::sphere(Vec3::ZERO, 0.0).is_err() && Region::sphere(Vec3::NAN, 1.0).is_err());
    assert!(Region::bounds(Bounds::EMPTY).is_err());
    assert_eq!(Region::bounds(Bounds::EVERYTHING), Ok(Region::Everywhere));
    let bad = [
        FractalNoise { frequency: 0.0, ..FractalNoise::default() },
        FractalNoise { octaves: 17, ..FractalNoise::default() },
        FractalNoise { lacunarity: 0.5, ..FractalNoise::default() },
        FractalNoise { gain: f32::NAN, ..FractalNoise::default() },
        FractalNoise { max_density: f32::INFINITY, ..FractalNoise::default() },
    ];
    for shape in bad {
        assert_eq!(Noise::new(shape, ABSORPTION, SCATTERING, Phase::ISOTROPIC), Err(MediumError::Noise));
    }
}
