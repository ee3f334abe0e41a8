//! An engine that renders fog by radiance caching, with vectors, ray caster and job queue of its own: nothing of
//! `fogbow_std`, and no threads but those of `std`. Prints digests of its caches and of its picture; the test `engine`
//! has the same ones from the adapter.

mod host;
mod queue;
mod world;

fn main() -> Result<(), Box<dyn core::error::Error>> {
    let (caches, picture) = host::run()?;
    println!("caches {caches:016x}, picture {picture:016x}");
    Ok(())
}
