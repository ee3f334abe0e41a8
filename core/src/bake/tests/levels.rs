//! Levels of finer bricks.

use super::*;

/// A lamp in fog beside a wall that ends in the box: light that varies next to the lamp and behind the wall's edge, in cells that do not fill bricks.
fn refined(
    photons: bool,
    test: impl FnOnce(BakeSettings, ProbeLevels<'static>, &World<'_, Placed<Homogeneous>, Panel>),
) {
    let lights = [lamp(Vec3::new(0.35, 0.2, -0.3), Spectrum::ONE)];
    let ball = Placed::new(haze(0.9, 0.8, 0.3), Region::sphere(Vec3::ZERO, 1.9).unwrap());
    let world = World { medium: &ball, scene: &Panel, lights: (&lights).into() };
    let basis = ProbeBasis::SphericalHarmonics { degree: 1 };
    let paths = path::Settings { max_scatterings: 4, ..path::Settings::default() };
    let settings = BakeSettings { basis, paths, error: 0.1, most_passes: 3, ..settings(&world, [13, 11, 10]) };
    let bake_of = |grid: ProbeGrid<'static>, settings: BakeSettings| {
        let bounds = Bounds { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
        let mut bake = Bake::resume(grid, settings).unwrap();
        if photons {
            bake = bake.with_photons(FlightMemory::default(), bounds);
        }
        finish(&mut bake, &world, &mut BakedProbes::default());
        assert!(!bake.is_cut());
        bake.finish()
    };
    let mut levels = ProbeLevels::new(bake_of(Bake::new(settings).unwrap().finish(), settings));
    let level = levels.levels()[0].level();
    for (times, error) in [(2, 0.3), (4, 0.6)] {
        let finer = levels.finest().finer(level, error, BakeMemory::default()).unwrap().unwrap();
        let settings =
            BakeSettings { counts: settings.counts.map(|n| times * n), level: Some(level as f32), ..settings };
        levels.push(bake_of(finer, settings)).unwrap();
    }
    test(settings, levels, &world);
}

#[test]
fn bricks_of_half_the_spacing_are_those_of_a_grid_that_has_all() {
    for photons in [false, true] {
        refined(photons, |settings, levels, world| {
            let grids = levels.levels();
            let level = Some(grids[0].level() as f32);
            let settings = BakeSettings { counts: settings.counts.map(|n| 2 * n), level, ..settings };
            let bounds = Bounds { min: Vec3::splat(-2.0), max: Vec3::splat(2.0) };
            let mut bake = Bake::new(settings).unwrap();
            if photons {
                bake = bake.with_photons(FlightMemory::default(), bounds);
            }
            finish(&mut bake, world, &mut BakedProbes::default());
            let (dense, finer) = (bake.finish(), &grids[1]);
            let bricks = finer.places().len();
            assert!(bricks > 8 && 2 * bricks < dense.brick_counts().iter().product::<u32>() as usize, "{bricks}");
            let mut same = 0;
            for number in 0..finer.probes().len() {
                let Some(cell) = finer.cell_of(number) else {
                    assert_eq!(finer.probes()[number], Probe::default(), "beyond the border");
                    continue;
                };
                assert_eq!(finer.number_of(cell), Some(number));
                let probe = Probe { state: finer.probes()[number].state & !probe::INNER, ..finer.probes()[number] };
                assert_eq!(probe, dense.probes()[cell]);
                // Photons serve all probes, until the error of all is small: here all have the most passes.
                assert_eq!(finer.held(number), dense.held(cell), "{number}");
                assert_eq!(finer.error(number, 0), dense.error(cell, 0));
                same += 1;
            }
            assert!(same > 500 && same < finer.probes().len(), "{same}: some bricks reach beyond the border");
        });
    }
}

#[test]
fn levels_go_over_into_each_other_and_hold_what_is_linear() {
    refined(false, |_, mut levels, _| {
        assert!(levels.finest().places().len() > 2);
        let mut rng = Generator::new(9);
        // Any light, without regard to walls: of walls alone light may jump.
        for grid in levels.grids_mut() {
            grid.memory.probes.as_mut_slice().iter_mut().for_each(|probe| {
                (probe.near, probe.other, probe.state) = (Vec3::ZERO, Vec3::ZERO, probe.state & probe::INNER | 1)
            });
            grid.memory.values.as_mut_slice().iter_mut().for_each(|value| *value = Spectrum::splat(uniform(&mut rng)));
        }
        let first = |levels: &ProbeLevels<'_>, point: Vec3| {
            let mut held = [Spectrum::ZERO; 4];
            assert!((levels.look_up(point, &mut held) - 1.0).abs() < 1e-5);
            held[0][0]
        };
        // Lines through the box: within a step, light changes by no more than the steepest pair of probes allows.
        let cell = levels.finest().lattice().cell().min_element();
        let (steps, mut parts) = (20_000, [0; MOST_LEVELS + 1]);
        for _ in 0..6 {
            let [a, b] = [warp_to_box(&mut rng), warp_to_box(&mut rng)];
            let step = (b - a).length() / steps as f32;
            let mut before = first(&levels, a);
            for i in 1..=steps {
                let point = a.lerp(b, i as f32 / steps as f32);
                let here = first(&levels, point);
                // A weight changes by one over a cell, along three axes; on two levels at once.
                assert!((here - before).abs() < 6.0 * step / cell + 1e-4, "{point}: from {before} to {here}");
                before = here;
                parts[crate::bake::levels::levels_at(levels.levels(), point)] += 1;
            }
        }
        assert!(parts[1] > 1000 && parts[2] > 1000, "on one level alone, and where two meet: {parts:?}");

        for grid in levels.grids_mut() {
            for number in 0..grid.probes().len() {
                let Some(cell) = grid.cell_of(number) else { continue };
                let Vec3 { x, y, z } = grid.lattice().centre(cell);
                let each = grid.basis.count();
                grid.memory.values.as_mut_slice()[number * each] = Spectrum::splat(3.0 + x - 0.5 * y + 2.0 * z);
            }
        }
        for _ in 0..2000 {
            let point = 0.8 * warp_to_box(&mut rng);
            let due = 3.0 + point.x - 0.5 * point.y + 2.0 * point.z;
            assert!((first(&levels, point) - due).abs() < 1e-5, "{point}");
        }
    });
}

#[test]
fn the_finest_probes_that_are_there_count() {
    refined(false, |settings, levels, world| {
        let [coarse, finer, finest] = levels.levels() else { panic!() };
        let mut held = [[Spectrum::ZERO; 4]; 2];
        let mut alone = [0; 3];
        let mut rng = Generator::new(2);
        for _ in 0..20_000 {
            let point = warp_to_box(&mut rng);
            levels.look_up(point, &mut held[0]);
            for (number, grid) in [coarse, finer, finest].into_iter().enumerate() {
                let others = &levels.levels()[number + 1..];
                let is_inner = |grid: &ProbeGrid<'_>| {
                    let around = grid.around(point).map(|(number, ..)| number.map(|number| grid.probes()[number]));
                    around.map(|probe| probe.is_some_and(|probe| probe.is_inner()))
                };
                let is_alone = others.iter().all(|grid| !is_inner(grid).contains(&true));
                if is_alone && (number == 0 || !is_inner(grid).contains(&false)) {
                    grid.look_up(point, &mut held[1]);
                    for (found, due) in held[0].iter().zip(&held[1]) {
                        assert!((found[0] - due[0]).abs() <= 1e-5 * coarse.level() as f32, "{point} on level {number}");
                    }
                    alone[number] += 1;
                    break;
                }
            }
        }
        assert!(alone.iter().all(|count| *count > 100), "{alone:?}");

        // Nearer to the light of the lamp as it is than a grid without levels.
        let once = path::Settings { max_scatterings: 1, ..path::Settings::default() };
        let off = |levels: &ProbeLevels<'_>| {
            let mut rng = Generator::new(4);
            let mut squares = [0.0_f64; 2];
            for _ in 0..2000 {
                // Around the lamp, but not within a cell of it.
                let way = warp_to_box(&mut rng);
                if !(0.3..0.8).contains(&way.length()) {
                    continue;
                }
                let point = Vec3::new(0.35, 0.2, -0.3) + way;
                let due = path::in_scattered(world, point, Vec3::Z, &Phase::ISOTROPIC, &once, &mut rng).single[0];
                squares[0] += f64::from(levels.value(point, Vec3::Z)[0] - due).powi(2);
                squares[1] += f64::from(due).powi(2);
            }
            squares[0] / squares[1]
        };
        let settings = BakeSettings { paths: once, basis: ProbeBasis::Fluence, ..settings };
        let grid = baked(settings, world);
        let level = grid.level();
        let mut levels = ProbeLevels::new(grid);
        let before = off(&levels);
        for times in [2, 4] {
            let finer = levels.finest().finer(level, 0.05, BakeMemory::default()).unwrap().unwrap();
            let settings = BakeSettings { counts: settings.counts.map(|n| times * n), ..settings };
            let mut bake = Bake::resume(finer, settings).unwrap();
            finish(&mut bake, world, &mut BakedProbes::default());
            levels.push(bake.finish()).unwrap();
        }
        let after = off(&levels);
        // Errors of mixing go with the square of the spacing, their squares with its fourth power.
        assert!(after < before / 16.0, "{after} with bricks, {before} without");
    });
}

#[test]
fn levels_are_saved_and_gone_on_with_and_damage_is_told() {
    refined(false, |settings, levels, world| {
        let save = |levels: &ProbeLevels<'_>| {
            let mut all = Vec::new();
            let Ok(()) = bytes::write_levels(levels, 3, |part| {
                all.extend_from_slice(part);
                Ok::<_, core::convert::Infallible>(())
            });
            all
        };
        let read = |file: &[u8]| bytes::read_levels(file, 3, |_| BakeMemory::default());
        let file = save(&levels);
        assert!(save(&read(&file).unwrap()) == file);
        assert_eq!(file.len(), levels.levels().iter().map(bytes::byte_count).sum::<usize>());
        for length in (0..file.len()).step_by(997) {
            // Levels that are not there cannot be missed where one ends.
            assert!(read(&file[..length]).is_err(), "{length} bytes");
        }
        for at in (0..file.len()).step_by(1009) {
            let mut damaged = file.clone();
            damaged[at] ^= 4;
            assert!(read(&damaged).is_err(), "byte {at}");
        }
        // Levels in another order belong to no grid.
        let first = bytes::byte_count(&levels.levels()[0]);
        assert_eq!(read(&[&file[first..], &file[..first]].concat()).err(), Some(ProbeBytesError::Layout));

        // A level left half way, and one that is chosen anew, with more bricks: what is known stays.
        let level = levels.levels()[0].level();
        let settings = BakeSettings { counts: settings.counts.map(|n| 2 * n), level: Some(level as f32), ..settings };
        let choose = |error| levels.levels()[0].finer(level, error, BakeMemory::default()).unwrap().unwrap();
        let due = bits(&levels.levels()[1]);
        let mut bake = Bake::resume(choose(0.5), settings).unwrap();
        (0..50).for_each(|_| assert!(step(&mut bake, world, &mut BakedProbes::default())));
        let left = bytes::read(&bits(&bake.finish()), 0, BakeMemory::default()).unwrap();
        let mut more = choose(0.3);
        assert!(more.places().len() > left.places().len());
        more.merge(&left).unwrap();
        assert!(more.memory.bricks.as_slice().iter().any(|brick| brick.passes > 0));
        let mut bake = Bake::resume(more, settings).unwrap();
        finish(&mut bake, world, &mut BakedProbes::default());
        assert!(bits(&bake.finish()) == due);
    });
}
