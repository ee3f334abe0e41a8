//! Media of every kind, and how light gets through them.

use fogbow::host::{Medium, Properties};
use fogbow::math::{Affine3, Mat3, Ray, Vec3};
use fogbow::medium::{
    Density, DensityGrid, FractalNoise, Homogeneous, MediumError, MinMax, Noise, Overlap, Placed, Region,
};
use fogbow::phase::{Lobe, Phase};
use fogbow::sampling::uniform::mix;
use fogbow::sampling::{Generator, uniform};
use fogbow::spectrum::Spectrum;
use fogbow::transmittance::{flight, transmittance as ratio_tracking};

use crate::Digest;
use crate::sections::{ROUNDS, point, questions};

const SIZE: [u32; 3] = [5, 6, 7];
const CELLS: usize = 5 * 6 * 7;

fn grey_smoke() -> Result<Homogeneous, MediumError> {
    Homogeneous::new(Spectrum::splat(0.05), Spectrum::splat(0.4), Lobe::HenyeyGreenstein { g: 0.6 })
}

fn coloured_smoke() -> Result<Homogeneous, MediumError> {
    Homogeneous::new(Spectrum::new(0.1, 0.2, 0.05), Spectrum::new(0.3, 0.5, 0.9), Phase::droplets(10.0)?)?
        .with_emission(Spectrum::new(0.4, 0.2, 0.1))
}

/// Asks `question` about every kind of medium; all of them reach around the origin.
pub(crate) fn each(mut question: impl FnMut(&dyn Medium)) -> Result<(), MediumError> {
    let (grey, coloured) = (grey_smoke()?, coloured_smoke()?);
    question(&grey);
    question(&coloured);

    let hole = [Region::sphere(Vec3::new(0.5, 0.0, 0.0), 1.0)?];
    let ball = Region::sphere(Vec3::ZERO, 3.0)?;
    question(&Placed::new(coloured, ball).with_holes(&hole));

    // Densities from integers, so that no rounding of the input hides behind them.
    let bytes: [u8; CELLS] = core::array::from_fn(|i| (mix(i as u64) & 0xff) as u8);
    let floats = bytes.map(|byte| if byte < 100 { 0.0 } else { f32::from(byte) * (1.0 / 64.0) });
    let turned = Affine3 {
        matrix3: Mat3::from_cols(Vec3::new(5.0, 0.5, 0.0), Vec3::new(-0.5, 4.0, 1.0), Vec3::new(0.0, -1.0, 6.0)),
        translation: Vec3::new(-2.5, -2.0, -3.0),
    };
    let mut blocks = [[MinMax::default(); 8]; 3];
    let [first, second, third] = &mut blocks;
    let smoke = Properties {
        absorption: Spectrum::splat(0.2),
        scattering: Spectrum::new(0.5, 0.6, 0.7),
        emission: Spectrum::ZERO,
        phase: Lobe::Schlick { k: 0.5 }.into(),
    };
    let burning = Properties { emission: Spectrum::splat(0.3), ..smoke };
    let plume = DensityGrid::new(SIZE, Density::F32(&floats), &burning, turned, first)?;
    question(&plume);
    let thin = DensityGrid::new(SIZE, Density::U8(&bytes), &smoke, turned, second)?;
    question(&thin.with_absorption_grid(Density::F32(&floats), third)?);

    let shape = FractalNoise { frequency: 0.7, offset: 0.1, ..FractalNoise::default() };
    let noise = Noise::new(shape, Spectrum::splat(0.1), Spectrum::splat(0.8), Lobe::Rayleigh)?;
    // Placed: a march to infinity through endless noise takes long.
    question(&Placed::new(noise, ball));

    let both = [Placed::new(grey, ball), Placed::new(grey, Region::unit_cube(turned)?)];
    question(&Overlap::new(&both, |placed| placed.medium().phase())?);
    Ok(())
}

pub(crate) fn medium(out: &mut Digest) {
    let mut rng = Generator::new(8);
    let asked = each(|medium| {
        for _ in 0..ROUNDS {
            questions(out, medium, &mut rng);
        }
    });
    out.int(u64::from(asked.is_ok()));
}

pub(crate) fn transmittance(out: &mut Digest) {
    let mut rng = Generator::new(10);
    let asked = each(|medium| {
        for _ in 0..ROUNDS {
            let ray = Ray::between(point(&mut rng), point(&mut rng));
            out.spectrum(ratio_tracking(medium, &ray, &mut rng));
            let flown = flight(medium, &ray, Spectrum::ONE, uniform(&mut rng), &mut rng);
            out.float(flown.distance);
            out.spectrum(flown.weight);
            out.spectrum(flown.emission);
            out.option(flown.collision, |out, there| out.spectrum(there.scattering));
        }
    });
    out.int(u64::from(asked.is_ok()));
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_medium_is_asked_about() {
        let mut count = 0;
        assert_eq!(super::each(|_| count += 1), Ok(()));
        assert_eq!(count, 7);
    }
}
