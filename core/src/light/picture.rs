//! Lights that show a picture: projectors, and flat ones whose radiance varies.

use glam::{Mat3, Vec2, Vec3};

use super::area::{surface_sample, to_solid_angle};
use super::geometry::{Falloff, Source, spot};
use super::{LightError, LightSample};
use crate::math::float::{self, PI};
use crate::math::{Bounds, Ray};
use crate::sampling::discrete::Table2;
use crate::spectrum::Spectrum;

/// A picture on the unit square, row by row, from which points are drawn by how bright they are.
///
/// ```
/// # use fogbow::{light::LightImage, math::Vec2, spectrum::Spectrum};
/// let (mut weights, mut column) = ([0.0; 2], [0.0; 1]);
/// let texels = [Spectrum::ZERO, Spectrum::splat(4.0)];
/// let half = LightImage::new(2, &texels, &mut weights, &mut column, false)?;
/// assert_eq!((half.value(Vec2::new(0.2, 0.5)), half.mean()), (Spectrum::ZERO, Spectrum::splat(2.0)));
/// assert_eq!(half.density(Vec2::new(0.7, 0.5)), 2.0);   // all of it in one half
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct LightImage<'a> {
    width: usize,
    texels: &'a [Spectrum],
    table: Table2<'a>,
    mean: Spectrum,
    is_smooth: bool,
}

impl<'a> LightImage<'a> {
    /// From texels in rows of `width`, two lent tables of as many entries as there are texels and rows, and whether values
    /// between the middles of texels are interpolated (the outermost reach to the border).
    ///
    /// # Errors
    /// Sizes that do not fit, texels that are negative or not finite.
    pub fn new(
        width: usize,
        texels: &'a [Spectrum],
        weights: &'a mut [f32],
        column: &'a mut [f32],
        is_smooth: bool,
    ) -> Result<Self, LightError> {
        let height = column.len();
        if width == 0 || height == 0 || texels.len() != weights.len() || width.checked_mul(height) != Some(texels.len())
        {
            return Err(LightError::Size);
        }
        if !texels.iter().all(|t| t.is_valid()) {
            return Err(LightError::Emission);
        }
        let mut sum = [0.0_f64; 3];
        for (i, texel) in texels.iter().enumerate() {
            for (sum, value) in sum.iter_mut().zip(texel.0) {
                *sum += f64::from(value);
            }
            let (x, y) = (i % width, i / width);
            weights[i] = if is_smooth {
                // Interpolation brings in the neighbours, less than half of each on the mean.
                let (columns, rows) =
                    (x.saturating_sub(1)..=(x + 1).min(width - 1), y.saturating_sub(1)..=(y + 1).min(height - 1));
                let around = rows.flat_map(|y| columns.clone().map(move |x| texels[y * width + x].mean()));
                texel.mean() + 0.25 * around.fold(0.0, f32::max)
            } else {
                texel.mean()
            };
        }
        // Of a black picture every point is as good as any.
        if weights.iter().all(|weight| *weight == 0.0) {
            weights.fill(1.0);
        }
        let mean = Spectrum(sum.map(|sum| (sum / texels.len() as f64) as f32));
        let table = Table2::build(width, weights, column).ok_or(LightError::Emission)?;
        Ok(Self { width, texels, table, mean, is_smooth })
    }

    /// The mean of all texels.
    #[must_use]
    pub fn mean(&self) -> Spectrum {
        self.mean
    }

    /// The mean over the triangle above the diagonal from the upper right to the lower left.
    fn mean_of_triangle(&self) -> Option<Spectrum> {
        let n = self.width;
        if n != self.height() || self.is_smooth {
            return None;
        }
        // Of texels on the diagonal a half.
        let share = |i: usize| match (i % n + i / n + 1).cmp(&n) {
            core::cmp::Ordering::Less => 1.0,
            core::cmp::Ordering::Equal => 0.5,
            core::cmp::Ordering::Greater => 0.0,
        };
        let sum: Spectrum = self.texels.iter().enumerate().map(|(i, texel)| *texel * share(i)).sum();
        Some(sum * (2.0 / (n * n) as f32))
    }

    fn height(&self) -> usize {
        self.texels.len() / self.width
    }

    /// The value at a point of the unit square; beyond, that at its border.
    #[inline]
    #[must_use]
    pub fn value(&self, at: Vec2) -> Spectrum {
        let size = Vec2::new(self.width as f32, self.height() as f32);
        let texel = |x: f32, y: f32| {
            let x = (x.max(0.0) as usize).min(self.width - 1);
            let y = (y.max(0.0) as usize).min(self.height() - 1);
            self.texels[y * self.width + x]
        };
        if !self.is_smooth {
            return texel(at.x * size.x, at.y * size.y);
        }
        let (x, y) = (at.x * size.x - 0.5, at.y * size.y - 0.5);
        let (x0, y0) = (float::floor(x), float::floor(y));
        let (fx, fy) = (x - x0, y - y0);
        let row = |y: f32| texel(x0, y) * (1.0 - fx) + texel(x0 + 1.0, y) * fx;
        row(y0) * (1.0 - fy) + row(y0 + 1.0) * fy
    }

    /// A point of the unit square and its density.
    ///
    /// ```
    /// # use fogbow::{light::LightImage, math::Vec2, spectrum::Spectrum};
    /// let (mut weights, mut column) = ([0.0; 2], [0.0; 1]);
    /// let texels = [Spectrum::ONE, Spectrum::splat(3.0)];
    /// let image = LightImage::new(2, &texels, &mut weights, &mut column, false)?;
    /// let (at, density) = image.sample(Vec2::splat(0.5));
    /// assert_eq!((at.x > 0.5, density, image.density(at)), (true, 1.5, 1.5));
    /// # Ok::<(), fogbow::light::LightError>(())
    /// ```
    #[inline]
    #[must_use]
    pub fn sample(&self, u: Vec2) -> (Vec2, f32) {
        self.table.sample(u)
    }

    /// Density of [`LightImage::sample`] at a point of the unit square; beyond, that at its border.
    #[inline]
    #[must_use]
    pub fn density(&self, at: Vec2) -> f32 {
        self.table.pdf(at.max(Vec2::ZERO))
    }
}

/// A parallelogram or triangle that shines to the side of its normal `edge_u × edge_v`, with a picture as its radiance.
///
/// ```
/// # use fogbow::{light::{LightImage, PictureLight}, math::Vec3, spectrum::Spectrum};
/// let (mut weights, mut column) = ([0.0; 2], [0.0; 1]);
/// let texels = [Spectrum::ONE, Spectrum::splat(3.0)];
/// let image = LightImage::new(2, &texels, &mut weights, &mut column, false)?;
/// let sign = PictureLight::new([Vec3::ZERO, 2.0 * Vec3::X, Vec3::Y], false, image)?;
/// assert_eq!((sign.area(), sign.normal(), sign.centre()), (2.0, Vec3::Z, Vec3::new(1.0, 0.5, 0.0)));
/// assert_eq!(sign.edges(), [2.0 * Vec3::X, Vec3::Y]);
/// assert_eq!(sign.radiance_at(Vec3::new(1.5, 0.5, 0.0)), Spectrum::splat(3.0));
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct PictureLight<'a> {
    corner: Vec3,
    edges: [Vec3; 2],
    /// What gives the shares of the edges of a point, from the corner.
    shares: [Vec3; 2],
    normal: Vec3,
    /// Of the parallelogram.
    area: f32,
    is_triangle: bool,
    image: LightImage<'a>,
    /// Over the light.
    mean: Spectrum,
}

impl<'a> PictureLight<'a> {
    /// From a corner and two edges (m) and radiance (W·m⁻²·sr⁻¹) as a picture whose rows run along the first edge. Of a triangle the
    /// picture covers the parallelogram: it is square, not interpolated, and should be black beyond the diagonal.
    ///
    /// # Errors
    /// Values that are not finite, edges that span no area, for a triangle a picture that is not square or is interpolated.
    pub fn new(
        [corner, edge_u, edge_v]: [Vec3; 3],
        is_triangle: bool,
        image: LightImage<'a>,
    ) -> Result<Self, LightError> {
        if !(corner.is_finite() && edge_u.is_finite() && edge_v.is_finite()) {
            return Err(LightError::Geometry);
        }
        let cross = edge_u.cross(edge_v);
        let area = cross.length();
        let normal = cross.try_normalize().filter(|_| area.is_finite()).ok_or(LightError::NoArea)?;
        let share = |across: Vec3, edge: Vec3| across / across.dot(edge);
        let shares = [share(edge_v.cross(normal), edge_u), share(normal.cross(edge_u), edge_v)];
        let mean = if is_triangle { image.mean_of_triangle().ok_or(LightError::Size)? } else { image.mean };
        Ok(Self { corner, edges: [edge_u, edge_v], shares, normal, area, is_triangle, image, mean })
    }

    /// Area (m²).
    #[must_use]
    pub fn area(&self) -> f32 {
        if self.is_triangle { 0.5 * self.area } else { self.area }
    }

    /// The side it shines to (unit).
    #[must_use]
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Centre of gravity (m).
    #[must_use]
    pub fn centre(&self) -> Vec3 {
        self.corner + (self.edges[0] + self.edges[1]) * if self.is_triangle { 1.0 / 3.0 } else { 0.5 }
    }

    /// The two edges (m).
    #[must_use]
    pub fn edges(&self) -> [Vec3; 2] {
        self.edges
    }

    /// Radiance (W·m⁻²·sr⁻¹) of a point of it (m).
    #[inline]
    #[must_use]
    pub fn radiance_at(&self, point: Vec3) -> Spectrum {
        self.image.value(self.at(point))
    }

    pub(super) fn mean_radiance(&self) -> Spectrum {
        self.mean
    }

    fn at(&self, point: Vec3) -> Vec2 {
        let offset = point - self.corner;
        Vec2::new(self.shares[0].dot(offset), self.shares[1].dot(offset))
    }

    /// Density over the unit square of what [`PictureLight::anchor`] draws: points beyond a triangle's diagonal are folded back.
    fn density(&self, at: Vec2) -> f32 {
        let density = self.image.density(at);
        if self.is_triangle { density + self.image.density(Vec2::ONE - at) } else { density }
    }

    pub(super) fn bounds(&self) -> Bounds {
        let [u, v] = self.edges;
        let last = if self.is_triangle { self.corner } else { self.corner + u + v };
        Bounds::of([self.corner, self.corner + u, self.corner + v, last])
    }

    /// A point, its radiance and its density over area (m⁻²).
    #[inline]
    fn draw(&self, u: Vec2) -> Option<(Vec3, Spectrum, f32)> {
        let (mut at, mut density) = self.image.sample(u);
        if self.is_triangle {
            if at.x + at.y > 1.0 {
                at = Vec2::ONE - at;
            }
            density = self.density(at);
        }
        let position = self.corner + self.edges[0] * at.x + self.edges[1] * at.y;
        (density > 0.0).then(|| (position, self.image.value(at), density / self.area))
    }

    #[inline]
    pub(super) fn anchor(&self, u: Vec2) -> Option<Source> {
        let (position, radiance, pdf_area) = self.draw(u)?;
        Some(Source { position, normal: self.normal, weight: radiance / pdf_area, falloff: Falloff::Area })
    }

    #[inline]
    pub(super) fn sample(&self, from: Vec3, u: Vec2) -> Option<LightSample> {
        let (position, radiance, pdf_area) = self.draw(u)?;
        surface_sample(from, position, self.normal, radiance, pdf_area)
    }

    #[inline]
    pub(super) fn pdf(&self, from: Vec3, to_light: Vec3, distance: f32) -> f32 {
        let density = self.density(self.at(from + to_light * distance));
        to_solid_angle(density / self.area, to_light, distance, self.normal)
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        if self.normal.dot(from - self.corner) <= 0.0 {
            return 0.0;
        }
        super::area::importance(self.mean_radiance(), self.area(), self.centre(), from)
    }
}

/// How the intensity of a [`Projector`] goes with the angle from its axis, beside the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Throw {
    /// `1/cos³`: a screen across the axis shows the picture as it is.
    Screen,
    /// As a [`SpotLight`](super::SpotLight): full within `beam` (rad), falling linearly in the angle to 0 at `cutoff`.
    Spot {
        /// Half angle of the full beam (rad).
        beam: f32,
        /// Half angle where light ends (rad).
        cutoff: f32,
    },
}

/// A point that throws a picture.
///
/// ```text
/// I(ω) = P(½ + ½ x/(z tan α), ½ + ½ y/(z tan β)) f(z)       (x, y, z) the direction in the projector's frame
/// ```
///
/// Gradients of what it sends take its intensity for the same in all directions.
///
/// ```
/// # use fogbow::{light::{Light, LightImage, Projector, Throw}, math::{Mat3, Vec2, Vec3}, spectrum::Spectrum};
/// let (mut weights, mut column) = ([0.0; 1], [0.0; 1]);
/// let image = LightImage::new(1, &[Spectrum::ONE], &mut weights, &mut column, false)?;
/// let lamp = Projector::new(Vec3::ZERO, Mat3::IDENTITY, Vec2::ONE, Throw::Screen, image)?;
/// assert_eq!((lamp.axis(), lamp.intensity(Vec3::Z)), (Vec3::Z, Spectrum::ONE));
/// let aside = Vec3::new(0.6, 0.0, 0.8);
/// // On a screen one metre ahead: I cos³ is the same everywhere.
/// assert!((lamp.intensity(aside)[0] * 0.8_f32.powi(3) - 1.0).abs() < 1e-6);
/// assert_eq!(lamp.intensity(Vec3::X), Spectrum::ZERO);
/// // 4 m² of that screen are lit by 1 W·m⁻².
/// assert!((lamp.power()[0] - 4.0).abs() < 1e-5);
/// # Ok::<(), fogbow::light::LightError>(())
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Projector<'a> {
    /// Where (m).
    pub position: Vec3,
    to_world: Mat3,
    half: Vec2,
    throw: Throw,
    image: LightImage<'a>,
    power: Spectrum,
    most: f32,
}

/// Least cosine from the axis that a picture may reach.
const LEAST_COSINE: f32 = 1e-3;

impl<'a> Projector<'a> {
    /// Its axis (unit), and the tangent of the angle from there to its corners.
    pub(super) fn cone(&self) -> (Vec3, f32) {
        (self.to_world.z_axis, self.half.length())
    }

    /// From its place (m), its frame in the world (columns: along the picture's rows, along its columns, ahead), the tangents of its half
    /// angles, and radiant intensity (W/sr) as a picture, but for the [`Throw`].
    ///
    /// # Errors
    /// Values that are not finite, a matrix that is no rotation (it may mirror), half angles of 0 or nearly 90°, a spot whose angles are not
    /// in order.
    pub fn new(
        position: Vec3,
        to_world: Mat3,
        half: Vec2,
        throw: Throw,
        image: LightImage<'a>,
    ) -> Result<Self, LightError> {
        if !position.is_finite() || !(to_world * to_world.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-3) {
            return Err(LightError::Geometry);
        }
        let least = float::hypot(float::hypot(half.x, half.y), 1.0);
        if !(half.min_element() > 0.0 && least < 1.0 / LEAST_COSINE) {
            return Err(LightError::Cone);
        }
        if let Throw::Spot { beam, cutoff } = throw
            && !(beam >= 0.0 && beam <= cutoff && cutoff > 0.0 && cutoff <= PI)
        {
            return Err(LightError::Cone);
        }
        let mut projector = Self { position, to_world, half, throw, image, power: Spectrum::ZERO, most: 0.0 };
        let (width, height) = (image.width, image.height());
        let (mut power, mut most) = ([0.0_f64; 3], 0.0_f32);
        for i in 0..width * height {
            let at =
                Vec2::new((i % width) as f32 + 0.5, (i / width) as f32 + 0.5) / Vec2::new(width as f32, height as f32);
            let (direction, cosine) = projector.direction(at);
            let intensity = projector.intensity(direction);
            most = most.max(intensity.mean());
            let solid = f64::from(projector.screen() / (width * height) as f32 * cosine * cosine * cosine);
            for (sum, value) in power.iter_mut().zip(intensity.0) {
                *sum += f64::from(value) * solid;
            }
        }
        projector.power = Spectrum(power.map(|sum| sum as f32));
        projector.most = most;
        Ok(projector)
    }

    /// Area of the picture (m²) on a screen one metre ahead.
    fn screen(&self) -> f32 {
        4.0 * self.half.x * self.half.y
    }

    /// The direction (unit, in the world) towards a point of the picture, and its cosine to the axis.
    #[inline]
    fn direction(&self, at: Vec2) -> (Vec3, f32) {
        let plane = (at * 2.0 - Vec2::ONE) * self.half;
        let local = plane.extend(1.0);
        let cosine = 1.0 / local.length();
        ((self.to_world * (local * cosine)).normalize(), cosine)
    }

    /// The axis (unit).
    #[must_use]
    pub fn axis(&self) -> Vec3 {
        self.to_world.z_axis
    }

    /// Greatest angle (rad) from the axis at which there is light.
    pub(super) fn spread(&self) -> f32 {
        let corner = libm::atanf(float::hypot(self.half.x, self.half.y));
        match self.throw {
            Throw::Screen => corner,
            Throw::Spot { cutoff, .. } => corner.min(cutoff),
        }
    }

    /// Angle (rad) from texel to texel, about.
    pub(crate) fn resolution(&self) -> f32 {
        let texel = 2.0 * self.half / Vec2::new(self.image.width as f32, self.image.height() as f32);
        libm::atanf(texel.min_element()).max(1e-4)
    }

    /// Radiant intensity (W/sr) towards `direction` (unit).
    #[inline]
    #[must_use]
    pub fn intensity(&self, direction: Vec3) -> Spectrum {
        let local = self.to_world.transpose() * direction;
        if local.z <= LEAST_COSINE {
            return Spectrum::ZERO;
        }
        let at = Vec2::new(local.x, local.y) / (local.z * 2.0 * self.half) + 0.5;
        // Directions towards the outermost texels are rounded.
        if !(at.min_element() >= -1e-6 && at.max_element() <= 1.0 + 1e-6) {
            return Spectrum::ZERO;
        }
        let factor = match self.throw {
            Throw::Screen => 1.0 / (local.z * local.z * local.z),
            Throw::Spot { beam, cutoff } => spot(local.z, beam, cutoff),
        };
        self.image.value(at) * factor
    }

    /// Radiant power (W), as a sum over the texels.
    #[must_use]
    pub fn power(&self) -> Spectrum {
        self.power
    }

    /// Greatest intensity (W/sr, mean of the channels) at the middle of a texel.
    pub(super) fn most(&self) -> f32 {
        self.most
    }

    #[inline]
    pub(super) fn source(&self, direction: Vec3) -> Source {
        let weight = self.intensity(direction);
        Source { position: self.position, normal: self.axis(), weight, falloff: Falloff::Uniform }
    }

    #[inline]
    pub(super) fn sample(&self, from: Vec3) -> Option<LightSample> {
        let source = self.source((from - self.position).try_normalize()?);
        if source.weight.is_black() { None } else { LightSample::certain(source, from) }
    }

    /// A direction drawn from the picture and intensity over its density (W).
    #[inline]
    pub(super) fn emit(&self, u: Vec2) -> Option<(Vec3, Spectrum)> {
        let (at, density) = self.image.sample(u);
        let (direction, cosine) = self.direction(at);
        let solid = self.screen() * cosine * cosine * cosine;
        (density > 0.0).then(|| (direction, self.intensity(direction) * (solid / density)))
    }

    pub(super) fn importance(&self, from: Vec3) -> f32 {
        let offset = from - self.position;
        let direction = offset.normalize_or(self.axis());
        self.intensity(direction).mean() / offset.length_squared().max(1e-30)
    }

    /// The part of a ray within the pyramid of light.
    pub(super) fn lit_interval(&self, ray: &Ray, near: f32, far: f32) -> Option<(f32, f32)> {
        let to_local = self.to_world.transpose();
        let (o, d) = (to_local * (ray.origin - self.position), to_local * ray.direction);
        // A little wider, so that rounding cannot hide a point that is lit.
        let wide = self.half * 1.001 + 1e-4;
        let (mut low, mut high) = (near, far);
        for side in [
            Vec3::new(1.0, 0.0, wide.x),
            Vec3::new(-1.0, 0.0, wide.x),
            Vec3::new(0.0, 1.0, wide.y),
            Vec3::new(0.0, -1.0, wide.y),
        ] {
            let (height, slope) = (side.dot(o), side.dot(d));
            if slope > 0.0 {
                low = low.max(-height / slope);
            } else if slope < 0.0 {
                high = high.min(-height / slope);
            } else if height < 0.0 {
                return None;
            }
        }
        (high > low).then_some((low, high))
    }
}
