//! Layers of a picture from caches: how far each region of it is off, and how well that is known.

use fogbow::cache::{BiasMap, Deviation};
use fogbow::spectrum::Spectrum;
use fogbow_std::film::{Film, SizeError};

/// Names of the layers.
pub(super) const LAYERS: [&str; 2] = ["bias", "bias_error"];

/// Of a region of which nothing is known: no light was seen there, and any number would do.
const UNKNOWN: f32 = 0.0;

/// The film with layers of the relative bias of what is cached and of its standard error, one value for each region.
pub(super) fn drawn(film: &Film, map: &BiasMap) -> Result<Film, SizeError> {
    let names: Vec<&str> = film.layers().iter().map(String::as_str).chain(LAYERS).collect();
    let (width, height) = (film.width(), film.height());
    let mut out = Film::new(width, height, &names)?;
    let layers: Vec<_> = (0..film.layers().len()).filter_map(|i| film.mean(i)).collect();
    let mut colours = Vec::new();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let at = [(x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32];
        let Deviation { bias, error } = map.at(at).cached;
        let own = if error.is_finite() { [bias as f32, error as f32] } else { [UNKNOWN; 2] };
        colours.clear();
        colours.extend(layers.iter().filter_map(|layer| layer.get(x, y)));
        colours.extend(own.map(Spectrum::splat));
        out.add(x, y, &colours);
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::LAYERS;
    use crate::cli::render::render;
    use crate::cli::{Arguments, Command};

    #[test]
    fn layers_show_the_map() {
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/smoke-box-homogeneous-isotropic.xml");
        let words = ["fogbow", "render", scene, "--size", "24x16", "--paths", "16", "--spp", "1", "--aov", "-q"];
        let Command::Render(arguments) = Arguments::try_parse_from(words).unwrap().command else { panic!() };
        let rendered = render(&arguments).unwrap();
        let (film, map) = (rendered.film, rendered.audited.unwrap().map);
        // As many as the audit's rays tell of, which are more where it was in doubt: 256 for each.
        let (side, rays) = (map.side(), map.regions().iter().map(|region| region.rays).sum::<u32>());
        assert!(side >= 4 && side * side * 256 <= rays);
        let layer =
            |name: &str| film.layers().iter().position(|layer| layer == name).and_then(|i| film.mean(i)).unwrap();
        let [bias, error] = LAYERS.map(layer);
        // The first and the last pixel whose middle lies in each region, from the upper left.
        let first = |number: u32, pixels: u32| (2 * number * pixels).saturating_sub(side).div_ceil(2 * side);
        for (number, region) in map.regions().iter().enumerate() {
            let at = [number as u32 % side, number as u32 / side];
            let [(x, to_x), (y, to_y)] =
                [(at[0], 24), (at[1], 16)].map(|(at, pixels)| (first(at, pixels), first(at + 1, pixels) - 1));
            let found = region.cached;
            // 256 rays each or more, which come in groups of 32 neighbours.
            assert!(found.error > 0.0 && found.error < 1.0 && region.rays > 100, "{region:?}");
            assert_eq!(bias.get(x, y).unwrap()[1], found.bias as f32);
            assert_eq!(error.get(to_x, to_y).unwrap()[2], found.error as f32);
        }
    }
}
