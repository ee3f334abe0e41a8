//! Pixels in which lamps without extent are seen.
//!
//! Around such a lamp fog is as bright as `1/r` on the film, whose square has no mean over the pixel: sample after sample may be the brightest by far. So samples of such
//! a pixel are drawn towards the lamp.

use fogbow::host::Scene;
use fogbow::light::Lights;
use fogbow::math::{Ray, Vec2};
use fogbow::sampling::warp::steep_square;

use crate::camera::Eye;

/// Lights up to which their glare is looked for. More: where each is a small part of the light, time for what nobody sees.
const MOST_LIGHTS: usize = 64;

/// Just inside the border of the unit square.
const EDGE: f32 = 1.0 - f32::EPSILON;

/// Where, in the filters of which pixels, lamps without extent are seen.
#[derive(Debug, Clone, Default)]
pub struct Glares {
    /// Pixels, in order, each as often as it has lamps, and where in the unit square of their random numbers.
    pixels: Vec<[u32; 2]>,
    lamps: Vec<Vec2>,
}

/// Where a sample of a pixel with lamps looks for light that fog scatters once: it is that of the two places, each as often as is said, together.
///
/// ```text
/// ∫ f du = E[w (f(u) − f(v))] + f(v)   for any v,   w = 1/density of u
/// ```
///
/// Where the pixel is even but for the lamp the difference has the lamp alone. Not so at the edges of what is bright: other light is no business of these looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoPlaces {
    /// Places in the unit square: one drawn towards the lamps, and the corner that is farthest from them. Where the share is 0 nobody need look.
    pub at: [Vec2; 2],
    /// How much what is seen there counts: in sum 1.
    pub shares: [f32; 2],
}

impl Glares {
    /// Lamps that the eye sees past all surfaces, on a film of some size (pixels).
    #[must_use]
    pub fn new(eye: &Eye<'_>, size: [u32; 2], lights: &Lights<'_>, scene: &impl Scene) -> Self {
        if lights.len() > MOST_LIGHTS {
            return Self::default();
        }
        let mut found = Vec::new();
        for lamp in lights.iter().filter_map(|light| light.near_field().filter(|field| field.radius().is_none())) {
            let Some(film) = eye.camera.project(lamp.centre()) else { continue };
            let at = film * Vec2::new(size[0] as f32, size[1] as f32);
            // Casts saturate: what lies beyond the film has pixels at its border, whose filters do not reach it.
            let range = |x: f32, size: u32| {
                let reach = eye.filter.radius();
                (x - reach - 0.5).floor().max(0.0) as u32..((x + reach + 0.5).ceil().max(0.0) as u32).min(size)
            };
            let seen = || !scene.is_blocked(&Ray::between(eye.camera.ray(film).origin, lamp.centre()));
            let mut is_seen = None;
            for y in range(at.y, size[1]) {
                for x in range(at.x, size[0]) {
                    if let Some(within) = eye.filter.within([x, y], size, at)
                        && *is_seen.get_or_insert_with(seen)
                    {
                        found.push(([y, x], within));
                    }
                }
            }
        }
        // Stable, so that lamps of one pixel stay in their order.
        found.sort_by_key(|(pixel, _)| *pixel);
        let (pixels, lamps) = found.into_iter().unzip();
        Self { pixels, lamps }
    }

    /// Where a sample of a pixel looks, for two random numbers; `None` if it has no lamps.
    #[must_use]
    pub fn places(&self, [x, y]: [u32; 2], u: Vec2) -> Option<TwoPlaces> {
        let first = self.pixels.partition_point(|pixel| *pixel < [y, x]);
        let count = self.pixels[first..].partition_point(|pixel| *pixel == [y, x]);
        if count == 0 {
            return None;
        }
        let lamps = &self.lamps[first..first + count];
        let corners = [Vec2::ZERO, Vec2::new(EDGE, 0.0), Vec2::new(0.0, EDGE), Vec2::splat(EDGE)];
        let away = |corner: Vec2| lamps.iter().map(|lamp| lamp.distance(corner)).fold(f32::INFINITY, f32::min);
        let aside = corners.into_iter().max_by(|a, b| away(*a).total_cmp(&away(*b)))?;
        let (at, share) = steep_square(u, lamps);
        Some(TwoPlaces { at: [at, aside], shares: [share, 1.0 - share] })
    }
}

#[cfg(test)]
mod tests {
    use fogbow::host::{Empty, Hit};
    use fogbow::light::{Light, PointLight};
    use fogbow::math::Vec3;
    use fogbow::sampling::{Generator, uniform2};
    use fogbow::spectrum::Spectrum;
    use fogbow::surface::Surface;

    use super::*;
    use crate::camera::Camera;
    use crate::filter::{Filter, FilterTable};
    use crate::scene_file::{FovAxis, Sensor};

    const SIZE: [u32; 2] = [20, 10];

    /// Glares of lamps before a camera that looks along +z, +x left.
    fn glares(lamps: &[Vec3], filter: Filter, scene: &impl Scene) -> Glares {
        let sensor = Sensor { fov: 90.0, fov_axis: FovAxis::X, width: SIZE[0], height: SIZE[1], ..Sensor::default() };
        let (camera, filter) = (Camera::new(&sensor, SIZE[0], SIZE[1]), FilterTable::new(filter));
        let lights: Vec<_> =
            lamps.iter().map(|at| Light::Point(PointLight::new(*at, Spectrum::ONE).unwrap())).collect();
        Glares::new(&Eye { camera, filter: &filter }, SIZE, &(&lights[..]).into(), scene)
    }

    /// A wall across all rays, one metre away.
    struct Wall;

    impl Scene for Wall {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let (distance, normal) = ((1.0 - ray.origin.z) / ray.direction.z, Vec3::NEG_Z);
            let is_hit = distance > 0.0 && distance < ray.length;
            is_hit.then_some(Hit { distance, normal, shading: normal, surface: Surface::BLACK, light: None })
        }
    }

    #[test]
    fn lamps_are_where_they_are_seen() {
        let all = |glares: &Glares| glares.pixels.iter().map(|[y, x]| [*x, *y]).collect::<Vec<_>>();
        // A tenth of the half width to the right is a pixel.
        let (ahead, behind) = (Vec3::new(-0.13125, 0.025, 1.25), Vec3::new(-0.1, 0.0, -1.0));
        let found = glares(&[ahead, behind], Filter::PIXEL, &Empty);
        assert_eq!(all(&found), [[11, 4]]);
        assert!(found.lamps[0].distance(Vec2::new(0.05, 0.8)) < 1e-4, "{:?}", found.lamps);
        assert!(found.places([11, 5], Vec2::ZERO).is_none() && found.places([4, 11], Vec2::ZERO).is_none());
        assert!(glares(&[ahead], Filter::PIXEL, &Wall).pixels.is_empty());
        assert_eq!(all(&glares(&[ahead; 65], Filter::PIXEL, &Empty)), Vec::<[u32; 2]>::new());
        // A filter that is two pixels wide reaches it from four.
        assert_eq!(all(&glares(&[ahead], Filter::Tent { radius: 1.0 }, &Empty)), [[10, 4], [11, 4], [10, 5], [11, 5]]);
    }

    /// A pixel of light that rises to its left, and 1/r around lamps in it: the mean is right, and exact where light is the same everywhere.
    #[test]
    fn a_sample_has_the_mean_of_its_pixel() {
        let lamps = [Vec3::new(-0.05, 0.05, 1.0), Vec3::new(-0.03, 0.02, 1.0)];
        let found = glares(&lamps, Filter::PIXEL, &Empty);
        assert_eq!(found.pixels, [[4, 10]; 2]);
        let count = 200_000;
        let mut rng = Generator::new(7);
        let (mut sums, mut squares) = ([0.0; 2], 0.0);
        for _ in 0..count {
            let TwoPlaces { at, shares } = found.places([10, 4], uniform2(&mut rng)).unwrap();
            let glare = |at: Vec2| found.lamps.iter().map(|lamp| 0.1 / at.distance(*lamp)).sum::<f32>();
            let seen = |light: &dyn Fn(Vec2) -> f32| {
                let of = |k: usize| if shares[k] == 0.0 { 0.0 } else { shares[k] * light(at[k]) };
                f64::from(of(0) + of(1))
            };
            let light = seen(&|at| 2.0 - at.x + glare(at));
            assert!((seen(&|_| 3.0) - 3.0).abs() < 1e-5);
            sums = [sums[0] + light, sums[1] + seen(&glare)];
            squares += light * light;
        }
        let (mean, glare) = (sums[0] / f64::from(count), sums[1] / f64::from(count));
        let error = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
        assert!((mean - glare - 1.5).abs() < 4.0 * error, "{mean} {glare} {error}");
        // By the middles of the cells of a fine grid.
        let (cells, mut exact) = (1000, 0.0);
        for i in 0..cells * cells {
            let at = Vec2::new((i % cells) as f32 + 0.5, (i / cells) as f32 + 0.5) / cells as f32;
            exact += found.lamps.iter().map(|lamp| f64::from(0.1 / at.distance(*lamp).max(1e-4))).sum::<f64>();
        }
        exact /= f64::from(cells * cells);
        assert!((glare - exact).abs() < 4.0 * error + 0.003 * exact, "{glare} {exact} {error}");
    }
}
