//! Adaptive sampling of images ([`fogbow::covariance::image_sampling`]): pictures filled in on threads.

use fogbow::covariance::image_sampling::{Computed, FillingIn, Plan};
use fogbow::spectrum::Spectrum;
use fogbow::storage::Full;

use crate::film::Image;
use crate::progress::Control;
use crate::threads::{self, Threads};

/// The image that the computed pixels of `image` give; the others' values are not read.
///
/// # Errors
/// [`Full`] if the image is not of the plan's size.
///
/// ```
/// use fogbow::covariance::image_sampling::{Outlook, PlanOutput, Planning};
/// use fogbow::{spectrum::Spectrum, work};
/// use fogbow_std::{film::Image, image_sampling::filled, threads::Threads};
/// let mut planning = Planning::new([16, 16], 0.3)?;
/// work::finish(&mut planning, &[Outlook::default(); 256][..], &mut PlanOutput::default());
/// let image = Image::new(16, 16, Spectrum::ONE).unwrap();
/// let filled = filled(&planning.finish(), &image, &Threads::new(2)?)?;
/// assert!(filled.pixels.iter().all(|colour| (colour[0] - 1.0).abs() < 1e-6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn filled(plan: &Plan<'_>, image: &Image, threads: &Threads) -> Result<Image, Full> {
    if plan.size() != [image.width, image.height] {
        return Err(Full);
    }
    let mut pixels = vec![Spectrum::ZERO; image.pixels.len()];
    let mut work = FillingIn::new(plan, &mut pixels[..])?;
    let computed = Computed { plan, pixels: &image.pixels };
    threads::run(&mut work, &computed, threads, &Control::default(), None, |_| {});
    Ok(Image { width: image.width, height: image.height, pixels })
}
