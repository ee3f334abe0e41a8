//! What the package does in Node, natively: prints the CRC-64 of what comes of a world and of jobs that `tests/digests.mjs` has described in words.
//!
//! ```text
//! digests WORLD CACHES PICTURE PROBES
//! ```

use std::{env, error, fs};

use fogbow::bytemuck;
use fogbow::bytes::Crc;
use fogbow_web::{Fault, Part, View, WebCaches, WebProbes, WebWorld, Words};

fn words(path: &str) -> Result<Vec<u32>, Box<dyn error::Error>> {
    Ok(fs::read(path)?.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect())
}

fn digest(bytes: &[u8]) -> u64 {
    let mut crc = Crc::new();
    crc.add(bytes);
    crc.value()
}

/// Seconds that the processor has worked for this program; 0 where the system does not tell.
fn cpu_seconds() -> f64 {
    let told = fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    told.split(' ').next().and_then(|nanoseconds| nanoseconds.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}

fn main() -> Result<(), Box<dyn error::Error>> {
    let said = |Fault(message)| message;
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [world, caches, picture, probes] = &arguments[..] else {
        return Err("digests WORLD CACHES PICTURE PROBES".into());
    };
    let began = cpu_seconds();
    let world = WebWorld::new(&words(world)?).map_err(said)?;
    let mut filled = WebCaches::new(&world, &words(caches)?).map_err(said)?;
    while filled.fill(&world, 64) {}
    println!("caches {:016x}", digest(&filled.save().map_err(said)?));
    let words_of_picture = words(picture)?;
    let mut asked = Words::new(&words_of_picture);
    let (view, part) = (View::read(&mut asked).map_err(said)?, Part::read(&mut asked).map_err(said)?);
    let cached = filled.picture(&world, &view, &part).map_err(said)?;
    println!("cached {:016x}", digest(bytemuck::cast_slice(&cached)));
    eprintln!("{:.3} s", cpu_seconds() - began);
    let traced = world.path_trace(&view, &part).map_err(said)?;
    println!("traced {:016x}", digest(bytemuck::cast_slice(&traced)));
    let mut baked = WebProbes::new(&world, &words(probes)?).map_err(said)?;
    while baked.bake(&world, Some(&filled), 64).map_err(said)? {}
    println!("probes {:016x}", digest(&baked.save().map_err(said)?));
    Ok(())
}
