//! The covariance of an image along an eye ray, from a grid: Belcour et al. 2014, § 5.2 and Eq. 17.

use super::grid::GridView;
use super::metrics::ImageCovariance;
use crate::host::Medium;
use crate::math::{Frame, Ray, Symmetric2, float};

/// Covariance (cycles²/rad²) over directions of the light that a medium scatters towards the origin of `ray`, whose
/// direction is `frame.w`; `None` where no photon came by.
///
/// Segments are the grid's cells and count by what they contribute, `T σₛ F` (means over the channels, as if light was
/// scattered alike in all directions).
///
/// ```
/// # use fogbow::{covariance::{GridView, Lattice, Voxel, image_covariance}, math::*, medium::Homogeneous, phase::Lobe};
/// # use fogbow::spectrum::Spectrum;
/// let lattice = Lattice::new(Bounds { min: Vec3::new(-1.0, -1.0, 3.9), max: Vec3::new(1.0, 1.0, 4.1) }, [1, 1, 1])?;
/// let voxels = [Voxel { sum: Symmetric3::from_upper([2.0, 0.0, 0.0, 0.0, 0.0, 0.0]), weight: 1.0 }];
/// let fog = Homogeneous::new(Spectrum::ZERO, Spectrum::splat(0.1), Lobe::Isotropic)?;
/// let frame = Frame { u: Vec3::X, v: Vec3::Y, w: Vec3::Z };
/// let seen = image_covariance(&Ray::new(Vec3::ZERO, Vec3::Z), &frame, &GridView::new(lattice, &voxels, 1)?, &fog).unwrap();
/// // What varies by √2 cycles per metre varies by 4√2 cycles per radian from 4 m away.
/// assert!((seen.xx - 32.0).abs() < 1e-3 && seen.yy == 0.0);
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[must_use]
pub fn image_covariance(
    ray: &Ray,
    frame: &Frame,
    grid: &GridView<'_>,
    medium: &(impl Medium + ?Sized),
) -> Option<Symmetric2> {
    let mut image = ImageCovariance::new(*frame);
    let (mut thickness, mut even_until, mut even) = (0.0, 0.0, true);
    for crossing in grid.lattice().cells(ray) {
        let (middle, length) = (0.5 * (crossing.enter + crossing.leave), crossing.leave - crossing.enter);
        let point = ray.at(middle);
        if !(middle < even_until) {
            let segment = medium.majorant_segment(ray, middle);
            (even_until, even) = (segment.until, segment.is_constant());
        }
        let properties = medium.properties(point);
        let passed = properties.extinction().mean() * length;
        let voxel = &grid.voxels()[crossing.cell];
        if let Some(covariance) = voxel.covariance() {
            let transmittance = float::exp(-(thickness + 0.5 * passed));
            let contribution = transmittance * properties.scattering.mean() * voxel.weight * length;
            let hessian = if even { None } else { Some(medium.extinction_hessian(point).mean()) };
            image.add(middle, length, contribution, &covariance, hessian.as_ref());
        }
        thickness += passed;
    }
    image.angular()
}
