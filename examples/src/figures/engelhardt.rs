//! Figures of Engelhardt et al. 2012, *Approximate Bias Compensation for Rendering Scenes with Heterogeneous Participating
//! Media* (E), rebuilt.

use fogbow::spectrum::Spectrum;
use fogbow_std::film::Image;

use super::rendered::{self, Shot};
use super::{Plan, clamping, costs, montage, strategies, together, visibility};
use crate::cli::Failure;

/// Figures made together: their numbers, and what makes their files and returns their section of the page.
type Section = (&'static [u32], fn(&Plan) -> Result<String, Failure>);

/// In the order of the page.
const SECTIONS: [Section; 6] = [
    (&[2, 4, 5], clamping::smoke),
    (&[6, 7], strategies::section),
    (&[8], visibility::section),
    (&[10], costs::section),
    (&[11], clamping::room),
    (&[13], clamping::statues),
];

/// Numbers of the figures that there are.
pub const NUMBERS: [u32; 9] = [2, 4, 5, 6, 7, 8, 10, 11, 13];

/// Makes the figures and `README.md`, the page.
///
/// # Errors
/// Scenes that are missing, files that cannot be written, a render that was stopped.
pub fn rebuild(plan: &Plan) -> Result<(), Failure> {
    together(plan, head, |plan| {
        let mut page = String::new();
        for (numbers, make) in SECTIONS {
            if numbers.iter().any(|number| plan.wants(*number)) {
                plan.say(&format!("figure {}", numbers[0]));
                page += &make(plan)?;
            }
        }
        Ok(page)
    })
}

fn head(plan: &Plan, seconds: f64) -> String {
    let quick = if plan.quick { " --quick" } else { "" };
    let note = if plan.quick { " These are the quick ones: small, with little effort.\n" } else { "\n" };
    format!(
        "# Figures of *Approximate Bias Compensation for Rendering Scenes with Heterogeneous Participating Media*\n\n\
         Figures of Engelhardt et al. 2012 (E), with the scenes of this repository.{note}\n\
         ```sh\ncargo run --release --bin fogbow -- figures engelhardt{quick}\n```\n\n\
         makes all of this, the numbers on this page among it; here in {:.1} minutes. Virtual lights that are compared are \
         the same: each picture is one pass, whose lights depend on the seed alone, \
         and on the bound where the best of many are kept. Where it says *of light scattered more \
         than once*, light that comes straight from the lamps and is scattered once is left out; no virtual light is \
         needed for it.\n\n",
        seconds / 60.0
    )
}

/// A picture by virtual lights.
pub(super) fn seen(plan: &Plan, scene: &str, size: [u32; 2], options: &str) -> Result<Shot, Failure> {
    let words: Vec<&str> = ["--method", "vpl", "--aov"].into_iter().chain(options.split_whitespace()).collect();
    rendered::shot(plan, &rendered::scene_of(plan, scene), size, &words)
}

/// What steps of compensation add.
pub(super) const STEPS: [&str; 4] = ["compensated_1", "compensated_2", "compensated_3", "compensated_rest"];

/// `a + b f`, pixel by pixel.
pub(super) fn plus(a: &Image, b: &Image, f: f32) -> Image {
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b): (&Spectrum, &Spectrum)| *a + *b * f).collect();
    Image { width: a.width, height: a.height, pixels }
}

/// Sum of layers.
pub(super) fn layers(shot: &Shot, names: &[&str]) -> Image {
    let black = montage::brightened(&shot.image, 0.0);
    names.iter().fold(black, |sum, name| plus(&sum, &shot.layer(name), 1.0))
}

/// Mean over pixels and channels.
pub(super) fn mean(image: &Image) -> f64 {
    image.pixels.iter().map(|p| f64::from(p.mean())).sum::<f64>() / image.pixels.len().max(1) as f64
}

/// What `image` lacks of `truth` in green, what it has too much in red.
pub(super) fn wrong(image: &Image, truth: &Image, gain: f32) -> Result<Image, Failure> {
    montage::made(image.width, image.height, |x, y| {
        let of = |image: &Image| image.get(x, y).map_or(0.0, Spectrum::mean);
        let d = (of(image) - of(truth)) * gain;
        Spectrum::new(d.max(0.0), (-d).max(0.0), 0.0)
    })
}

/// Means over 5 × 5 pixels.
pub(super) fn evened(image: &Image) -> Result<Image, Failure> {
    montage::made(image.width, image.height, |x, y| {
        let around = (0..25_u32).filter_map(|i| image.get((x + i % 5).checked_sub(2)?, (y + i / 5).checked_sub(2)?));
        let (sum, count) = around.fold((Spectrum::ZERO, 0.0), |(sum, n), p| (sum + p, n + 1.0));
        sum * (1.0 / f32::max(count, 1.0))
    })
}

/// Pictures beside each other, brightened, every pixel `by` × `by`.
pub(super) fn strip(by: u32, images: &[Image], gain: f32) -> Result<Image, Failure> {
    let shown = |image: &Image| montage::enlarged(&montage::brightened(image, gain), by);
    montage::beside(&images.iter().map(shown).collect::<Result<Vec<_>, _>>()?)
}
