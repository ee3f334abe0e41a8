//! Slices of a bake side by side, as pictures.

use fogbow::bake::ProbeState;
use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;

use super::Baked;

/// Slices in a row and in a column, about as many of both.
///
/// ```
/// assert_eq!(fogbow_examples::bake::sheets::tiles(32), [6, 6]);
/// assert_eq!(fogbow_examples::bake::sheets::tiles(3), [2, 2]);
/// ```
#[must_use]
pub fn tiles(depth: u32) -> [u32; 2] {
    let mut across = 1;
    while across * across < depth {
        across += 1;
    }
    [across, depth.div_ceil(across)]
}

/// A picture for each number of a probe and for what lies beside, with its name. Slice `z` is tile `z` in rows from the top left; in a tile, x
/// goes to the right and y down.
///
/// # Errors
/// More pixels than a picture has; bricks of half the spacing, which sheets have no place for.
pub fn sheets(baked: &Baked) -> Result<Vec<(String, Image)>, String> {
    baked.is_even("a sheet of slices")?;
    let grid = baked.grid();
    let valid = |index: usize| if grid.probes()[index].state() == ProbeState::Valid { 1.0 } else { 0.0 };
    let mut all = Vec::new();
    for (number, name) in Baked::names(grid.basis()).into_iter().enumerate() {
        all.push((name, sheet(baked, |index| grid.held(index)[number] * baked.scale)?));
    }
    all.push(("validity".to_owned(), sheet(baked, |index| Spectrum::splat(valid(index)))?));
    all.push(("extinction".to_owned(), sheet(baked, |index| grid.probes()[index].extinction)?));
    all.push(("albedo".to_owned(), sheet(baked, |index| grid.probes()[index].albedo)?));
    Ok(all)
}

fn sheet(baked: &Baked, of: impl Fn(usize) -> Spectrum) -> Result<Image, String> {
    let [nx, ny, nz] = baked.grid().lattice().size();
    let [across, down] = tiles(nz);
    let mut image = Image::new(across * nx, down * ny, Spectrum::ZERO).map_err(|error| error.to_string())?;
    for index in 0..nx * ny * nz {
        let [x, y, z] = [index % nx, index / nx % ny, index / (nx * ny)];
        let [column, row] = [x + nx * (z % across), y + ny * (z / across)];
        image.pixels[(column + image.width * row) as usize] = of(index as usize);
    }
    Ok(image)
}
