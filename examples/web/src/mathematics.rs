//! Single formulas, for who wants to see them: records with gradients, covariances, virtual lights.

use alloc::vec::Vec;

use fogbow::cache::{Limits, Record};
use fogbow::covariance::{self, Fill, GridOutput};
use fogbow::host::{Medium, Scene};
use fogbow::math::Vec3;
use fogbow::sampling::Generator;
use fogbow::single_scatter::{self, Sums, Towards};
use fogbow::spectrum::Spectrum;
use fogbow::transmittance::thickness::{Marching, Steps, transmittance};
use fogbow::vpl::{Bound, Receiver, VirtualLight};
use fogbow::work;

use super::words::{Fault, Words};
use super::world::{CoreWorld, WebWorld};

/// Samples of lights with extent. More: time; fewer: noise in a drawing.
const SAMPLES: u32 = 16;

/// Steps in which transmittance is marched (m).
const STEP: f32 = 0.05;

fn single(world: &CoreWorld<'_>, words: &mut Words<'_>) -> Result<(Vec3, Sums), Fault> {
    let (point, to_eye) = (words.vector()?, words.vector()?);
    let phase = world.medium.properties(point).phase;
    let settings = single_scatter::Settings { samples: SAMPLES, steps: Steps::Length(STEP) };
    // The same random numbers everywhere: what differs from point to point is light and not chance.
    let sums =
        single_scatter::sample(point, &Towards { to_eye, phase: &phase }, world, &settings, &mut Generator::new(1));
    Ok((point, sums))
}

/// Light of the lights scattered once, at points towards directions, without the scattering coefficient.
pub(crate) fn scattered_once(world: &WebWorld, words: &[u32]) -> Result<Vec<Spectrum>, Fault> {
    let of = |words: &[u32]| world.with(|world| Ok(single(world, &mut Words::new(words))?.1.value));
    words.chunks(6).map(of).collect()
}

/// The record of light scattered once at a point (Jarosz et al. 2008, Eq. 34): from words point, direction, tolerance, least and greatest radius.
pub(crate) fn record(world: &WebWorld, words: &[u32]) -> Result<Record, Fault> {
    let mut words = Words::new(words);
    let (point, sums) = world.with(|world| single(world, &mut words))?;
    let [tolerance, min, max] = words.floats()?;
    if !(tolerance > 0.0 && min >= 0.0 && min <= max) {
        return Err(Fault::new("a record needs a tolerance above 0, and a least radius not above the greatest"));
    }
    Record::new(point, &sums, tolerance, Limits { min, max }).ok_or_else(|| Fault::new("light is no number there"))
}

/// Counts of a covariance grid along x, y and z (integers), then for each cell the covariance of light (m⁻²; xx, xy, xz, yy, yz, zz), zeros where
/// no photon came. From words: cells along the longest side, photons.
pub(crate) fn covariances(world: &WebWorld, words: &[u32]) -> Result<Vec<u32>, Fault> {
    let mut words = Words::new(words);
    let (edge, photons) = (words.integer()?, words.integer()?);
    let settings =
        covariance::Settings { edge, photons: u64::from(photons), ..covariance::Settings::new(world.bounds()) };
    let mut fill = Fill::new(settings)?;
    world.with(|world| work::finish(&mut fill, world, &mut GridOutput::default()));
    let grid = fill.finish();
    let view = grid.view();
    let mut all = view.lattice().size().to_vec();
    for voxel in view.voxels() {
        let covariance = voxel.covariance().map_or([0.0; 6], |covariance| covariance.to_upper());
        all.extend(covariance.map(f32::to_bits));
    }
    Ok(all)
}

/// Light of a virtual light in the medium at points, towards an eye: for each the clamped part, and all of it (Engelhardt et al. 2012). From words:
/// position, direction in which light came, flux, bound (m⁻²), eye; then the points.
pub(crate) fn virtual_light(world: &WebWorld, words: &[u32]) -> Result<Vec<Spectrum>, Fault> {
    let mut words = Words::new(words);
    let (position, incoming, flux) = (words.vector()?, words.vector()?, words.colour()?);
    let bound = Bound::new(words.float()?)?;
    let eye = words.vector()?;
    world.with(|world| {
        let light = VirtualLight::in_medium(position, incoming, flux, 1, &world.medium.properties(position).phase);
        let mut all = Vec::new();
        while words.left() > 0 {
            let point = words.vector()?;
            let properties = world.medium.properties(point);
            let to_eye = (eye - point).normalize_or(Vec3::Z);
            let receiver = Receiver::in_medium(point, to_eye, &properties);
            let connection = receiver.and_then(|receiver| light.connect(&receiver));
            let light = connection.map_or([Spectrum::ZERO; 2], |connection| {
                if world.scene.is_blocked(&connection.shadow_ray()) {
                    return [Spectrum::ZERO; 2];
                }
                let reach = transmittance(&connection.way, world.medium, Marching::new(STEP, 0.5));
                [bound, Bound::NONE].map(|bound| connection.radiance(bound, reach))
            });
            all.extend(light);
        }
        Ok(all)
    })
}
