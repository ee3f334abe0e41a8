//! Whether a picture shows anything in eight bits.

use fogbow_std::film::Image;

/// Part of the pixels that may be white. More: words about pictures of a bright sky.
const WHITE: f32 = 0.5;

/// Light of all but the brightest hundredth of the pixels, below which a picture is nearly black: 5 % of white are the tones up to 63 of 255.
const BLACK: f32 = 0.05;

/// Where bright pixels are to be.
const BRIGHT: f32 = 0.7;

/// What to do about a picture that is mostly white, or nearly black, at so many stops; of one that is black throughout nothing, as no exposure helps.
pub(super) fn advice(image: &Image, stops: f32) -> Option<String> {
    let mut light: Vec<f32> =
        image.pixels.iter().map(|light| light.mean()).filter(|light| *light > 0.0 && *light < f32::INFINITY).collect();
    light.sort_unstable_by(f32::total_cmp);
    let all = light.len().max(1) - 1;
    let at = |part: f32| light.get((part * all as f32) as usize).copied();
    let (dim, bright) = (at(WHITE)?, at(0.99)?);
    let shown = stops.exp2();
    // Not −0.
    let to = |light: f32| (BRIGHT / light).log2().round() + 0.0;
    if dim * shown > 1.0 {
        let better = to(dim).min(stops - 1.0);
        return Some(format!("most of the picture is white in a PNG; --exposure={better} shows more"));
    }
    (bright * shown < BLACK)
        .then(|| format!("the picture is nearly black in a PNG; --exposure={} shows more", to(bright)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fogbow::spectrum::Spectrum;

    #[test]
    fn what_shows_nothing_is_told_of_with_stops_that_show_it() {
        let told = |light: f32, stops: f32| advice(&Image::new(8, 8, Spectrum::splat(light)).unwrap(), stops);
        assert_eq!([0.0, 0.06, 0.9].map(|light| told(light, 0.0)), [None, None, None]);
        assert!(told(0.01, 0.0).unwrap().contains("black in a PNG; --exposure=6 "));
        assert!(told(20.0, 0.0).unwrap().contains("white in a PNG; --exposure=-5 "));
        assert!(told(0.9, 1.0).unwrap().contains("--exposure=0 "));
        for light in [1e-6, 0.01, 20.0, 1e6] {
            let stops: f32 =
                told(light, 0.0).and_then(|text| text.split(['=', ' ']).find_map(|word| word.parse().ok())).unwrap();
            assert_eq!(told(light, stops), None, "{light}");
        }
    }
}
