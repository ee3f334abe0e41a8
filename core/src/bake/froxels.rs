//! Fog in front of a camera as engines show it: the frustum in cells, slices of which grow with distance.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::host::Medium;
use crate::march::{EyeRay, attenuated_length};
use crate::math::Ray;
use crate::math::float::{ln, powf};
use crate::spectrum::Spectrum;

/// Fog in a cell of a frustum.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Froxel {
    /// Radiance scattered towards the eye per length (W·m⁻³·sr⁻¹), `σₛ L_i`.
    pub scattered: Spectrum,
    /// Extinction (m⁻¹).
    pub extinction: Spectrum,
}

/// The cells of a frustum: columns around rays from the eye, cut at distances that grow exponentially.
///
/// ```text
/// t_k = near (far/near)^(k/n),   k = 0 … n
/// ```
///
/// Fog nearer than `near` is left out. Slices are filled independently of each other ([`Froxels::fill`]), so that a host may deal them out; then one
/// pass over the columns ([`Froxels::integrate`]) leaves what a shader multiplies and adds at any depth.
///
/// ```
/// # use fogbow::{math::{Ray, Vec3}, medium::Homogeneous, phase::Phase, spectrum::Spectrum};
/// use fogbow::bake::{Froxel, Froxels};
/// let fog = Homogeneous::new(Spectrum::splat(0.1), Spectrum::splat(0.3), Phase::ISOTROPIC)?;
/// let froxels = Froxels::new([2, 1, 8], 0.5, 32.0).unwrap();
/// let ray = |at: [f32; 2]| Ray::new(Vec3::ZERO, Vec3::new(at[0] - 0.5, 0.0, -1.0).normalize());
/// let mut cells = [Froxel::default(); 2 * 8];
/// for (slice, cells) in cells.chunks_mut(froxels.slice_len()).enumerate() {
///     froxels.fill(slice as u32, ray, &fog, |_, _| Spectrum::ONE, cells);   // or ProbeGrid::value
/// }
/// let mut seen = [fogbow::march::EyeRay { radiance: Spectrum::ZERO, transmittance: Spectrum::ONE }; 2 * 8];
/// froxels.integrate(&cells, &mut seen);
/// // Behind the third slice, 0.5 m to 0.5 · 64^(3/8) m of fog.
/// let length = froxels.distance(3.0) - 0.5;
/// let through = (-0.4 * length).exp();
/// assert!((seen[2 * 2].transmittance[0] - through).abs() < 1e-6);
/// assert!((seen[2 * 2].radiance[0] - 0.75 * (1.0 - through)).abs() < 1e-6);
/// assert!((froxels.slice_at(froxels.distance(3.0)) - 3.0).abs() < 1e-5);
/// # Ok::<(), fogbow::medium::MediumError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Froxels {
    counts: [u32; 3],
    near: f32,
    far: f32,
}

impl Froxels {
    /// So many columns along both sides of the picture, so many slices, from `near` to `far` (m). `None` without cells or with 2³² and more, or where distances do not
    /// grow from above 0.
    #[must_use]
    pub fn new(counts: [u32; 3], near: f32, far: f32) -> Option<Self> {
        let grows = near > 0.0 && far > near && far.is_finite();
        let cells = counts.iter().try_fold(1_u32, |product, count| product.checked_mul(*count));
        (grows && cells.is_some_and(|cells| cells > 0)).then_some(Self { counts, near, far })
    }

    /// Cells of a slice, and columns.
    #[must_use]
    pub fn slice_len(&self) -> usize {
        self.counts[0] as usize * self.counts[1] as usize
    }

    /// Distance from the eye (m) at which a slice begins; halves lie between.
    #[must_use]
    pub fn distance(&self, slice: f32) -> f32 {
        self.near * powf(self.far / self.near, slice / self.counts[2] as f32)
    }

    /// The slice at a distance from the eye (m), from 0 to as many as there are: where a shader looks.
    #[must_use]
    pub fn slice_at(&self, distance: f32) -> f32 {
        let slices = self.counts[2] as f32;
        (slices * ln(distance.max(self.near) / self.near) / ln(self.far / self.near)).clamp(0.0, slices)
    }

    /// Fills a slice, at the middle of each of its cells: x first, then y. `ray` gives the eye ray of a point of the picture, both coordinates in [0, 1];
    /// `in_scattering(point, to_eye)` is radiance (W·m⁻²·sr⁻¹) *without* `σₛ`, of probes, of lights, or of both. As many cells as there is room for.
    pub fn fill(
        &self,
        slice: u32,
        ray: impl Fn([f32; 2]) -> Ray,
        medium: &(impl Medium + ?Sized),
        mut in_scattering: impl FnMut(Vec3, Vec3) -> Spectrum,
        cells: &mut [Froxel],
    ) {
        let [across, down, _] = self.counts;
        let middle = 0.5 * (self.distance(slice as f32) + self.distance(slice as f32 + 1.0));
        for (index, cell) in (0..across * down).zip(cells) {
            let at = [(index % across) as f32 + 0.5, (index / across) as f32 + 0.5];
            let ray = ray([at[0] / across as f32, at[1] / down as f32]);
            let point = ray.at(middle);
            let properties = medium.properties(point);
            let is_lit = !properties.scattering.is_black();
            let light = if is_lit { in_scattering(point, -ray.direction) } else { Spectrum::ZERO };
            *cell = Froxel { scattered: properties.scattering * light, extinction: properties.extinction() };
        }
    }

    /// From `cells`, slice after slice, what is seen of the fog up to the far end of each: radiance to be added to what lies there times transmittance.
    ///
    /// ```text
    /// L ← L + T σₛ L_i (1 − e^{−σₜ Δ})/σₜ,   T ← T e^{−σₜ Δ}
    /// ```
    ///
    /// Exact where fog and light are the same all through a cell. As many cells as both have.
    pub fn integrate(&self, cells: &[Froxel], seen: &mut [EyeRay]) {
        let columns = self.slice_len();
        for index in 0..cells.len().min(seen.len()) {
            let slice = (index / columns) as f32;
            let length = self.distance(slice + 1.0) - self.distance(slice);
            let nothing = EyeRay { radiance: Spectrum::ZERO, transmittance: Spectrum::ONE };
            let before = if index < columns { nothing } else { seen[index - columns] };
            let Froxel { scattered, extinction } = cells[index];
            let weight = extinction.map(|sigma| attenuated_length(sigma, length));
            seen[index] = EyeRay {
                radiance: before.radiance + before.transmittance * scattered * weight,
                transmittance: before.transmittance * (extinction * length).transmitted(),
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::march::eye_ray;
    use crate::medium::{FractalNoise, Noise};
    use crate::phase::Phase;

    /// Light and fog that vary, against fine steps along the same rays: the error falls with the square of the slices.
    #[test]
    fn frustums_show_what_eye_rays_see() {
        let cloud = Noise::new(FractalNoise::default(), Spectrum::splat(0.2), Spectrum::splat(0.8), Phase::ISOTROPIC);
        let cloud = cloud.unwrap();
        let light =
            |point: Vec3, to_eye: Vec3| Spectrum::new(2.0 + point.x, 1.0 + to_eye.z, 1.0 / (1.0 + point.length()));
        let ray =
            |at: [f32; 2]| Ray::new(Vec3::new(0.3, 0.2, 0.1), Vec3::new(at[0] - 0.5, at[1] - 0.5, 1.0).normalize());
        const MOST: usize = 6 * 256;
        let error = |slices: u32| {
            let froxels = Froxels::new([3, 2, slices], 0.25, 4.0).unwrap();
            let mut cells = [Froxel::default(); MOST];
            for (slice, cells) in cells.chunks_mut(froxels.slice_len()).take(slices as usize).enumerate() {
                froxels.fill(slice as u32, ray, &cloud, light, cells);
            }
            let mut seen = [EyeRay { radiance: Spectrum::ZERO, transmittance: Spectrum::ONE }; MOST];
            froxels.integrate(&cells[..6 * slices as usize], &mut seen);
            let mut worst = 0.0_f32;
            for column in 0..6 {
                let at = [(column % 3) as f32 + 0.5, (column / 3) as f32 + 0.5];
                let whole = ray([at[0] / 3.0, at[1] / 2.0]);
                // Fog before the near end is not shown.
                let shown = Ray { origin: whole.at(0.25), ..whole }.with_length(3.75);
                let due = eye_ray(&shown, &cloud, |_| 1e-3, |point, to_eye, _| light(point, to_eye), 0.5);
                let found = seen[6 * (slices as usize - 1) + column];
                for c in 0..3 {
                    worst = worst.max((found.radiance[c] / due.radiance[c] - 1.0).abs());
                    worst = worst.max((found.transmittance[c] / due.transmittance[c] - 1.0).abs());
                }
            }
            worst
        };
        let [coarse, fine] = [32, 256].map(error);
        assert!(fine < 1e-3 && fine < coarse / 16.0, "{coarse} with 32 slices, {fine} with 256");
    }

    #[test]
    fn frustums_that_cannot_be_are_none() {
        for (counts, near, far) in [
            ([0, 1, 1], 1.0, 2.0),
            ([1, 1, 0], 1.0, 2.0),
            ([1 << 16, 1 << 16, 1], 1.0, 2.0),
            ([1, 1, 1], 0.0, 2.0),
            ([1, 1, 1], 2.0, 2.0),
            ([1, 1, 1], f32::NAN, 2.0),
            ([1, 1, 1], 1.0, f32::INFINITY),
        ] {
            assert_eq!(Froxels::new(counts, near, far), None, "{counts:?} {near} {far}");
        }
        let froxels = Froxels::new([1, 1, 4], 1.0, 16.0).unwrap();
        assert_eq!([0.0, 1.0, 20.0, f32::NAN].map(|at| froxels.slice_at(at)), [0.0, 0.0, 4.0, 0.0]);
    }
}
