//! An engine's host without the adapter, and the adapter: the same world and settings give the same bits.

use std::fs;
use std::path::Path;

use fogbow::cache::{Asked, RadianceCaches, Settings};
use fogbow::picture::{Sample, Tiles};
use fogbow::sampling::{Generator, Independent};
use fogbow::spectrum::Spectrum;
use fogbow::world::{Outline, World};
use fogbow_std::progress::Control;
use fogbow_std::threads::{Ending, Threads, run};

#[path = "../../examples/examples/engine/host.rs"]
mod host;
#[path = "../../examples/examples/engine/queue.rs"]
mod queue;
#[path = "../../examples/examples/engine/world.rs"]
mod world;

fn source(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/examples/engine");
    fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn an_engine_with_a_queue_of_its_own_has_the_bits_of_the_adapter() {
    let level = world::level().unwrap();
    let world = World { medium: &level.fog, scene: &level.room, lights: (&level.lamps).into() };
    let pixels = world::SIZE[0] * world::SIZE[1];
    let settings = Settings::for_outline(&Outline::of(&world, world::BOUNDS), 0.02).for_pixels(pixels);
    let settings = host::quick(settings);
    let (threads, control) = (Threads::new(2).unwrap(), Control::default());

    let asked = Asked::View { ray: world::eye_ray, pixel: world::PIXEL };
    let mut filling = RadianceCaches::new(settings).fill(asked);
    assert_eq!(run(&mut filling, &world, &threads, &control, None, |_| ()).ending, Ending::Done);
    let caches = filling.finish();
    let integrand = |sample: &Sample<'_, ()>, rng: &mut Generator, layers: &mut [Spectrum]| {
        layers[0] = caches.radiance(&world::eye_ray(host::film_point(sample)), &world, rng).total();
    };
    let mut picture = Tiles::new(host::picture_settings(), Independent);
    assert_eq!(run(&mut picture, &integrand, &threads, &control, None, |_| ()).ending, Ending::Done);

    assert_eq!((picture.counts().non_finite, picture.count(0, 0)), (0, world::SAMPLES));
    assert!(picture.mean(8, 8, 0).min_element() > 0.0);
    assert_eq!(host::run().unwrap(), host::digests(&caches.to_bytes(host::TAG), &picture));
}

#[test]
fn its_set_up_is_short_and_has_no_tuned_number() {
    let source = source("host.rs");
    let mut marked = Vec::new();
    let mut is_marked = false;
    for line in source.lines().map(str::trim) {
        match line {
            "// set-up {" => is_marked = true,
            "// }" => is_marked = false,
            _ if is_marked => marked.push(line),
            _ => {}
        }
    }
    assert!(!is_marked && (5..=15).contains(&marked.len()), "{} lines", marked.len());
    let words = marked.iter().flat_map(|line| line.split(|c: char| !c.is_alphanumeric() && !"._".contains(c)));
    let numbers: Vec<_> = words.filter(|word| word.starts_with(|c: char| c.is_ascii_digit())).collect();
    assert!(!numbers.is_empty() && numbers.iter().all(|number| ["0", "1"].contains(number)), "{numbers:?}");
}

#[test]
fn it_needs_the_core_and_the_standard_library_only() {
    for name in ["main.rs", "host.rs", "queue.rs", "world.rs"] {
        let source = source(name);
        let uses = source.lines().filter_map(|line| line.strip_prefix("use "));
        let roots: Vec<_> = uses.map(|path| path.split([':', ';']).next().unwrap()).collect();
        assert!(roots.iter().all(|root| ["core", "std", "fogbow", "super"].contains(root)), "{name}: {roots:?}");
        let code = source.lines().filter(|line| !line.trim_start().starts_with("//"));
        assert!(code.clone().all(|line| !line.contains("fogbow_std") && !line.contains("rayon")), "{name}");
    }
}
