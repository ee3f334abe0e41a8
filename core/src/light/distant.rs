//! Lights at infinity.

use glam::{Mat3, Vec2, Vec3};

use super::geometry::{Falloff, Incident, Source};
use super::{LightError, LightSample};
use crate::math::float::{self, PI};
use crate::sampling::discrete::Table2;
use crate::sampling::warp;
use crate::spectrum::Spectrum;

/// Brightest texel over the mean radiance, up to which an environment counts as even. A clear sky
/// around a sun that was cut out has some 5, a sun thousands.
const MOST_EVEN: f32 = 8.0;

/// Parallel light.
///
/// ```
/// # use fogbow::{light::Sun, math::Vec3, spectrum::Spectrum};
/// let sun = Sun::new(Vec3::new(0.0, 3.0, 4.0), Spectrum::splat(1000.0)).unwrap();
/// let (here, there) = (sun.source().incident(Vec3::ZERO), sun.source().incident(1e6 * Vec3::X));
/// assert_eq!(here, there);   // the same everywhere
/// assert!((here.unwrap().to_light - Vec3::new(0.0, 0.6, 0.8)).length() < 1e-6);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Direction towards the sun (unit).
    pub to_light: Vec3,
    /// Irradiance on a plane across the light (W·m⁻²).
    pub irradiance: Spectrum,
}

impl Sun {
    /// From the direction towards the sun and the irradiance across it.
    ///
    /// # Errors
    /// A direction without length, an irradiance that is negative or not finite.
    pub fn new(to_light: Vec3, irradiance: Spectrum) -> Result<Self, LightError> {
        if !irradiance.is_valid() {
            return Err(LightError::Emission);
        }
        Ok(Self { to_light: to_light.try_normalize().ok_or(LightError::Geometry)?, irradiance })
    }

    /// The light as a [`Source`].
    #[inline]
    #[must_use]
    pub fn source(&self) -> Source {
        distant(self.to_light, self.irradiance)
    }
}

#[inline]
fn distant(to_light: Vec3, irradiance: Spectrum) -> Source {
    Source { position: Vec3::ZERO, normal: -to_light, weight: irradiance, falloff: Falloff::Distant }
}

#[inline]
fn distant_sample(to_light: Vec3, irradiance: Spectrum, pdf: f32) -> LightSample {
    let incident = Incident { to_light, distance: f32::INFINITY, irradiance };
    LightSample { source: distant(to_light, irradiance), incident, pdf }
}

#[inline]
pub(super) fn sample_sun(sun: &Sun) -> LightSample {
    distant_sample(sun.to_light, sun.irradiance, 0.0)
}

#[inline]
pub(super) fn sample_constant(radiance: Spectrum, u: Vec2) -> LightSample {
    distant_sample(warp::uniform_sphere(u), radiance * (4.0 * PI), float::INV_FOUR_PI)
}

/// An image of radiance around the world, latitude by longitude, bilinearly interpolated.
///
/// Column `i` of `width` lies at longitude `2π (i + ½)/width` with `atan2(x, −z)` as longitude;
/// row `j` of `height` at the polar angle `π j/(height − 1)` from +y: the layout of Mitsuba 3.
///
/// ```
/// # use fogbow::{light::EnvironmentMap, math::{Mat3, Vec3, float::PI}, spectrum::Spectrum};
/// // White above, black below, and what interpolation makes of it between.
/// let texels = [Spectrum::ONE, Spectrum::ONE, Spectrum::ZERO, Spectrum::ZERO];
/// let (mut weights, mut column) = ([0.0; 4], [0.0; 2]);
/// let map = EnvironmentMap::new(2, 2, &texels, &mut weights, &mut column, Mat3::IDENTITY).unwrap();
/// let seen = [Vec3::Y, Vec3::X, Vec3::NEG_Y].map(|direction| map.radiance(direction)[0]);
/// assert!((seen[0] - 1.0).abs() < 1e-6 && (seen[1] - 0.5).abs() < 1e-6 && seen[2].abs() < 1e-6);
/// assert!((map.mean_radiance()[0] - 0.5).abs() < 1e-6 && map.resolution() == PI);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct EnvironmentMap<'a> {
    width: usize,
    height: usize,
    texels: &'a [Spectrum],
    table: Table2<'a>,
    to_world: Mat3,
    mean: Spectrum,
    brightest: f32,
}

impl<'a> EnvironmentMap<'a> {
    /// From `width × height` texels of radiance (row by row), two lent tables of `width × height`
    /// and `height` entries, and a rotation into the world.
    ///
    /// # Errors
    /// Sizes that do not fit, fewer than 2 rows or columns, radiance that is negative or not finite, a matrix
    /// that is no rotation, an image without light.
    pub fn new(
        width: usize,
        height: usize,
        texels: &'a [Spectrum],
        weights: &'a mut [f32],
        column: &'a mut [f32],
        to_world: Mat3,
    ) -> Result<Self, LightError> {
        let count = width.checked_mul(height).ok_or(LightError::Size)?;
        if width < 2 || height < 2 || texels.len() != count || weights.len() != count || column.len() != height {
            return Err(LightError::Size);
        }
        if !texels.iter().all(|t| t.is_valid()) {
            return Err(LightError::Emission);
        }
        if !(to_world * to_world.transpose()).abs_diff_eq(Mat3::IDENTITY, 1e-3) {
            return Err(LightError::Geometry);
        }
        let mut mean = [0.0_f64; 3];
        let mut total = 0.0_f64;
        for row in 0..height {
            // Cells of the table are bands of equal height in the polar angle.
            let sine = libm::sinf(PI * (row as f32 + 0.5) / height as f32);
            for col in 0..width {
                // The brightest texel that interpolation can bring into this cell.
                let top = (row * (height - 1)) / height;
                let bottom = ((row + 1) * (height - 1)).div_ceil(height).min(height - 1);
                let mut brightest = 0.0_f32;
                for y in top..=bottom {
                    for x in [(col + width - 1) % width, col, (col + 1) % width] {
                        brightest = brightest.max(texels[y * width + x].max_element());
                    }
                }
                weights[row * width + col] = brightest * sine;
                let texel = texels[row * width + col];
                for (sum, value) in mean.iter_mut().zip(texel.0) {
                    *sum += f64::from(value * sine);
                }
                total += f64::from(sine);
            }
        }
        let mean = Spectrum(mean.map(|sum| (sum / total) as f32));
        let table = Table2::build(width, weights, column).ok_or(LightError::Emission)?;
        let brightest = texels.iter().map(|t| t.max_element()).fold(0.0, f32::max);
        Ok(Self { width, height, texels, table, to_world, mean, brightest })
    }

    /// Angle (rad) between rows of texels.
    #[must_use]
    pub fn resolution(&self) -> f32 {
        PI / (self.height - 1).max(1) as f32
    }

    /// Mean radiance over all directions.
    #[must_use]
    pub fn mean_radiance(&self) -> Spectrum {
        self.mean
    }

    /// Whether no place of it is so bright that directions which know nothing of it would do badly.
    pub(super) fn is_even(&self) -> bool {
        self.brightest <= MOST_EVEN * self.mean.max_element()
    }

    fn texture(&self, to_light: Vec3) -> Vec2 {
        let local = self.to_world.transpose() * to_light;
        let longitude = float::atan2(local.x, -local.z) / (2.0 * PI);
        Vec2::new(if longitude < 0.0 { longitude + 1.0 } else { longitude }, float::acos(local.y) / PI)
    }

    /// Radiance that arrives along −`to_light`.
    #[must_use]
    pub fn radiance(&self, to_light: Vec3) -> Spectrum {
        let at = self.texture(to_light);
        let x = at.x * self.width as f32 - 0.5;
        let y = (at.y * (self.height - 1) as f32).clamp(0.0, (self.height - 1) as f32);
        let (x0, y0) = (float::floor(x), float::floor(y).min((self.height - 2) as f32));
        let (fx, fy) = (x - x0, y - y0);
        let column = |offset: usize| ((x0 + self.width as f32) as usize + offset) % self.width;
        let texel = |c: usize, r: usize| self.texels[(y0 as usize + r) * self.width + column(c)];
        (texel(0, 0) * (1.0 - fx) + texel(1, 0) * fx) * (1.0 - fy) + (texel(0, 1) * (1.0 - fx) + texel(1, 1) * fx) * fy
    }

    pub(super) fn sample(&self, u: Vec2) -> Option<LightSample> {
        let (at, density) = self.table.sample(u);
        let (sin_polar, cos_polar) = float::sin_cos(PI * at.y);
        let (sin_longitude, cos_longitude) = float::sin_cos(2.0 * PI * at.x);
        if sin_polar <= 0.0 || density <= 0.0 {
            return None;
        }
        let local = Vec3::new(sin_polar * sin_longitude, cos_polar, -sin_polar * cos_longitude);
        let to_light = (self.to_world * local).normalize();
        let pdf = density / (2.0 * PI * PI * sin_polar);
        Some(distant_sample(to_light, self.radiance(to_light) / pdf, pdf))
    }

    pub(super) fn pdf(&self, to_light: Vec3) -> f32 {
        let at = self.texture(to_light);
        let sine = libm::sinf(PI * at.y);
        if sine <= 0.0 { 0.0 } else { self.table.pdf(at) / (2.0 * PI * PI * sine) }
    }
}
