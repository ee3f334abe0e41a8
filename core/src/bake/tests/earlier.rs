//! Bakes after an earlier one, of a world that has changed since; and probes beside surfaces.

use super::*;

/// A long box of fog, dark but for two lamps at its ends and what they light.
const LONG: Bounds = Bounds { min: Vec3::new(-4.0, -1.0, -1.0), max: Vec3::new(4.0, 1.0, 1.0) };

fn frame(power: f32) -> [Light<'static>; 2] {
    [lamp(Vec3::new(-3.0, 0.0, 2.0), Spectrum::ONE), lamp(Vec3::new(3.0, 0.0, 2.0), Spectrum::splat(power))]
}

/// Runs a test with the world in which the lamp at the far end has some power, and settings that have light of degree 1.
fn in_frame<T>(power: f32, test: impl FnOnce(BakeSettings, &World<'_, Placed<Homogeneous>, Empty>) -> T) -> T {
    let (fog, lights) = (haze(0.9, 1.5, 0.2), frame(power));
    let block = Placed::new(fog, Region::bounds(LONG).unwrap());
    let world = World { medium: &block, scene: &Empty, lights: (&lights).into() };
    let basis = ProbeBasis::SphericalHarmonics { degree: 1 };
    let settings = BakeSettings { bounds: LONG, basis, error: 0.04, ..settings(&world, [32, 4, 4]) };
    test(settings, &world)
}

fn after<'c>(earlier: &'c ProbeGrid<'c>, settings: BakeSettings, photons: bool) -> Bake<'static, 'c> {
    let bake = Bake::new(settings).unwrap().after(earlier).unwrap();
    if photons { bake.with_photons(FlightMemory::default(), LONG) } else { bake }
}

fn frame_after(earlier: &ProbeGrid<'_>, power: f32, photons: bool) -> (ProbeGrid<'static>, usize) {
    in_frame(power, |settings, world| {
        let mut bake = after(earlier, settings, photons);
        finish(&mut bake, world, &mut BakedProbes::default());
        let kept = bake.kept();
        (bake.finish(), kept)
    })
}

fn first(photons: bool) -> ProbeGrid<'static> {
    in_frame(1.0, |settings, world| {
        if !photons {
            return baked(settings, world);
        }
        let mut bake = Bake::new(settings).unwrap().with_photons(FlightMemory::default(), LONG);
        finish(&mut bake, world, &mut BakedProbes::default());
        bake.finish()
    })
}

#[test]
fn what_has_not_changed_stays_bit_for_bit_and_the_rest_is_that_of_the_new_world() {
    for photons in [false, true] {
        let earlier = first(photons);
        let (same, kept) = frame_after(&earlier, 1.0, photons);
        assert!(kept >= 7, "{kept} of 8 bricks stay where nothing changes");
        let equal = (0..512).filter(|probe| same.held(*probe) == earlier.held(*probe)).count();
        assert!(equal >= 64 * kept);

        // The lamp at one end is half as bright: at the other end nothing is to be seen of that.
        let (found, kept) = frame_after(&earlier, 0.5, photons);
        let (due, _) = frame_after(&in_frame(0.5, |settings, _| Bake::new(settings).unwrap().finish()), 0.5, false);
        let is_kept = |x: usize| (0..16).all(|row| found.held(x + 32 * row) == earlier.held(x + 32 * row));
        assert!(is_kept(0) && is_kept(4) && !is_kept(28) && !is_kept(31), "{kept}");
        assert!((2..=6).contains(&kept), "{kept}");
        // As near to the new light as a bake that begins anew: what was kept is off by half an error more.
        let apart = found.deviation(&due);
        assert!(apart.bias.abs() < 4.0 * apart.bias_error + 0.02 && apart.spread < 0.06, "{apart:?}");
        let stale = earlier.deviation(&due);
        assert!(stale.spread > 0.3, "{stale:?}");
    }
}

#[test]
fn small_changes_do_not_add_up() {
    // A lamp that fades by less than the error from frame to frame.
    let mut grids = alloc::vec![first(false)];
    let mut kept = 0;
    for frame in 1..8 {
        let (next, of_it) = frame_after(&grids[frame - 1], 1.0 - 0.03 * frame as f32, false);
        kept += of_it;
        grids.push(next);
    }
    let due = in_frame(1.0 - 0.03 * 7.0, |settings, world| baked(BakeSettings { seed: 1, ..settings }, world));
    let apart = grids[7].deviation(&due);
    assert!(apart.spread < 0.06, "{apart:?}, while the light has changed by {:?}", grids[0].deviation(&due));
    assert!(kept > 7 * 3, "{kept} of 56");
}

#[test]
fn after_an_earlier_grid_any_interruption_gives_the_same_bits() {
    for photons in [false, true] {
        let earlier = first(photons);
        let due = bits(&frame_after(&earlier, 0.6, photons).0);
        in_frame(0.6, |settings, world| {
            let mut bake = after(&earlier, settings, photons);
            let mut left = true;
            while left {
                for _ in 0..61 {
                    left = left && step(&mut bake, world, &mut BakedProbes::default());
                }
                let saved = bits(bake.grid());
                let read = bytes::read(&saved, 0, BakeMemory::default()).unwrap();
                // Whichever is said first.
                let again = Bake::resume(read, settings).unwrap();
                bake = match (photons, left) {
                    (false, _) => again.after(&earlier).unwrap(),
                    (true, false) => again.with_photons(FlightMemory::default(), LONG).after(&earlier).unwrap(),
                    (true, true) => again.after(&earlier).unwrap().with_photons(FlightMemory::default(), LONG),
                };
            }
            // What is done is not gone on with.
            assert!(bake.share() == 1.0 && bits(bake.grid()) == due, "photons: {photons}");
        });
    }
}

#[test]
fn grids_of_other_cells_are_no_earlier_ones() {
    let earlier = first(false);
    in_frame(1.0, |settings, _| {
        for other in [
            BakeSettings { counts: [16, 4, 4], ..settings },
            BakeSettings { basis: ProbeBasis::Fluence, ..settings },
            BakeSettings { orders: Orders::Indirect, ..settings },
        ] {
            assert_eq!(Bake::new(other).unwrap().after(&earlier).err(), Some(BakeError::Grid));
        }
    });
}

/// A ledge that is narrower than a cell, above a dark floor: white on top.
struct Ledge;

impl Scene for Ledge {
    fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
        let distance = (-0.24 - ray.origin.y) / ray.direction.y;
        let at = ray.at(distance);
        let is_hit = distance > 1e-6 && distance < ray.length && (at.x - 0.25).abs() < 0.06 && at.z.abs() < 1.2;
        let normal = if ray.direction.y < 0.0 { Vec3::Y } else { Vec3::NEG_Y };
        let surface = Surface::Lambert { reflectance: Spectrum::splat(0.9) };
        is_hit.then_some(Hit { distance, normal, shading: normal, surface, light: None })
    }
}

#[test]
fn probes_beside_a_narrow_ledge_have_paths_among_photons() {
    let lights = [lamp(Vec3::new(0.25, 1.4, 0.1), Spectrum::ONE)];
    let ball = Placed::new(haze(0.8, 0.3, 0.0), Region::sphere(Vec3::ZERO, 2.0).unwrap());
    let world = World { medium: &ball, scene: &Ledge, lights: (&lights).into() };
    // In cells of half a metre, a row of probes at x = 0.25 and y = −0.23, a centimetre above the ledge.
    let settings = BakeSettings { orders: Orders::Indirect, error: 0.01, ..settings(&world, [4, 4, 4]) };
    let bounds =
        BakeSettings { bounds: Bounds { min: BOX.min + 0.02 * Vec3::Y, max: BOX.max + 0.02 * Vec3::Y }, ..settings };
    let found = by_photons(bounds, &world);
    let due = baked(BakeSettings { error: 0.01, ..bounds }, &world);
    let beside: Vec<usize> = (0..64).filter(|probe| found.probes()[*probe].is_by_paths()).collect();
    assert!((2..=8).contains(&beside.len()), "{beside:?}");
    let mean = due.level_of_numbers() as f32;
    for probe in beside {
        let [x, y, _] = due.at(probe);
        assert!(x == 2 && y == 1, "{x} {y}");
        let off = (found.held(probe)[0] - due.held(probe)[0]).mean().abs();
        let error = libm::hypotf(found.error(probe, 0), due.error(probe, 0));
        assert!(off < 4.0 * error && error < 0.2 * mean, "{probe}: {off}, error {error}, mean {mean}");
        // It is bright there: the ledge is half of what such a probe sees.
        assert!(due.held(probe)[0].mean() > 1.2 * mean);
    }
}
