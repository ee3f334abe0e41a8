//! Where light is asked for: along the eye rays of a picture, or anywhere in a box.

use super::places::{Place, places, places_around};
use super::settings::Settings;
use crate::bytes::Crc;
use crate::host::{Medium, Scene};
use crate::math::{Bounds, Ray, Vec3};
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, even2, even3, uniform2, warp};
use crate::world::{World, nearest_surface};

/// Where light is asked for.
#[derive(Debug, Clone, Copy)]
pub enum Asked<F = fn([f32; 2]) -> Ray> {
    /// Along the eye rays of a picture.
    View {
        /// The eye ray of a point of the film, both coordinates in [0, 1].
        ray: F,
        /// Angular width of a pixel (rad): bounds radii.
        pixel: f32,
    },
    /// Anywhere in a box of the medium, for probes: points spread evenly over it, and the surfaces that light them.
    Box(Bounds),
}

/// A place where light is asked for, and from where.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    pub(super) place: Place,
    /// How far the eye is (m); infinite if there is none.
    pub(super) distance: f32,
    /// The number of the ray that asks.
    pub(super) ray: u32,
}

impl Wanted {
    /// What a record of a radius (m) at this place covers of a film that is seen under such angles: from, and to.
    pub(super) fn on_film(&self, radius: f32, angles: [f32; 2]) -> [f32; 4] {
        let [x, y] = Asked::at(self.ray);
        let of = |angle: f32| radius / (self.distance * angle);
        // All of it, where there is no film.
        let [across, down] = angles.map(|angle| if of(angle).is_finite() { of(angle) } else { 1.0 });
        [x - across, y - down, x + across, y + down]
    }
}

/// By how much of the film across the ray beside an eye ray is apart. More: mirrors that are small on the film are missed; less: rounding.
const BESIDE: f32 = 1.0 / 1024.0;

/// Cosine of the angle beyond which a place is not on the ray that an eye has sent.
const STRAIGHT: f32 = 1.0 - 1e-6;

/// Cosine of the greatest angle between normals of what may be one surface.
const SAME_SIDE: f32 = 0.9;

/// Whether a place, so far from where a ray begins (m), is on a surface to which mirrors or glass have bent the ray.
fn is_mirrored(place: &Place, ray: &Ray, distance: f32) -> bool {
    let along = (place.point - ray.origin).dot(ray.direction);
    place.is_seen && place.normal.is_some() && along < STRAIGHT * distance
}

impl Asked {
    /// [`Asked::Box`] where no eye rays tell the type of `F`.
    ///
    /// ```
    /// # use fogbow::{cache::Asked, math::{Bounds, Vec3}};
    /// let bounds = Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE };
    /// assert!(matches!(Asked::anywhere_in(bounds), Asked::Box(inside) if inside == bounds));
    /// ```
    #[must_use]
    pub fn anywhere_in(bounds: Bounds) -> Self {
        Self::Box(bounds)
    }

    /// Where on the film ray number `number` of a view begins.
    pub(super) fn at(number: u32) -> [f32; 2] {
        even2(number + 1)
    }
}

impl<F: Fn([f32; 2]) -> Ray> Asked<F> {
    /// A mark of where eye rays go and how densely places are asked for.
    pub(super) fn mark(&self, settings: &Settings) -> u64 {
        let Settings { rays, margin, pixels, round, seed, ref eye, .. } = *settings;
        let pixel = if let Self::View { pixel, .. } = self { *pixel } else { 0.0 };
        let mut crc = Crc::new();
        let mut add = |numbers: &[f32]| numbers.iter().for_each(|n| crc.add(&n.to_bits().to_le_bytes()));
        add(&[
            margin,
            pixels[0],
            pixels[1],
            pixel,
            eye.density,
            f32::from(eye.lights_visible),
            f32::from(eye.indirect),
        ]);
        match self {
            Self::View { ray, .. } => {
                for at in [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.3, 0.6]] {
                    let ray = ray(at);
                    add(&ray.origin.to_array());
                    add(&ray.direction.to_array());
                }
            }
            Self::Box(bounds) => {
                add(&bounds.min.to_array());
                add(&bounds.max.to_array());
            }
        }
        for number in [u64::from(rays), u64::from(round), seed] {
            crc.add(&number.to_le_bytes());
        }
        crc.value()
    }

    /// Angles (rad) under which the film is seen from the eye, across and down, going by its middle; 0 without one.
    pub(super) fn film(&self) -> [f32; 2] {
        const PART: f32 = 1.0 / 16.0;
        let Self::View { ray, .. } = self else { return [0.0; 2] };
        let middle = ray([0.5; 2]).direction;
        let to = |at: [f32; 2]| ray(at).direction.distance(middle) / PART;
        [to([0.5 + PART, 0.5]), to([0.5, 0.5 + PART])]
    }

    /// Calls `visit(place, distance of the eye)` for the places that ray number `number` asks for. The first surface that is seen past mirrors and glass is as far away (m) as
    /// it seems: at that distance a pixel would be as wide as what it shows of it, as a ray beside this one tells.
    pub(super) fn visit<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        number: u32,
        world: &World<'_, M, S>,
        settings: &Settings,
        visit: &mut dyn FnMut(Place, f32),
    ) {
        let mut rng = Generator::new(mix(settings.seed ^ 0x70_1a_ce) ^ u64::from(number));
        match self {
            Self::View { ray, .. } => {
                let at @ [x, y] = Asked::at(number);
                // The ray beside goes first, and only where there is a mirror; by the same random numbers, so that both are sent on alike.
                let next = ray([if x < 0.5 { x + BESIDE } else { x - BESIDE }, y]);
                let rays = [next, ray(at)];
                let is_mirror = nearest_surface(&rays[1], world.scene).is_some_and(|hit| hit.surface.is_followed());
                let mut beside = None;
                for (i, ray) in rays.iter().enumerate().skip(usize::from(!is_mirror)) {
                    let see: &mut dyn FnMut(Place) = &mut |place| {
                        let mut distance = place.point.distance(ray.origin);
                        if is_mirrored(&place, ray, distance) {
                            if i == 0 {
                                beside.get_or_insert(place);
                            } else if let Some(Place { point, normal, .. }) = beside.take()
                                && normal.unwrap_or_default().dot(place.normal.unwrap_or_default()) > SAME_SIDE
                            {
                                // NaN, where both rays are the same, is not the greater.
                                let apart = ray.direction.distance(next.direction);
                                distance = distance.max(place.point.distance(point) / apart);
                            }
                        }
                        if i > 0 {
                            visit(place, distance);
                        }
                    };
                    places(ray, world, &settings.eye, &mut rng.clone(), see);
                }
            }
            Self::Box(bounds) => {
                let point = bounds.min + bounds.size() * Vec3::from(even3(number + 1));
                let direction = warp::uniform_sphere(uniform2(&mut rng));
                places_around(point, direction, world, &mut |place| visit(place, f32::INFINITY));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::host::Hit;
    use crate::math::float;
    use crate::medium::Homogeneous;
    use crate::phase::Phase;
    use crate::spectrum::Spectrum;
    use crate::surface::Surface;

    /// A mirror ball around the origin with a radius of 0.5 m, and a grey wall at z = 5 m.
    struct Ball;

    const RADIUS: f32 = 0.5;

    impl Scene for Ball {
        fn closest_hit(&self, ray: &Ray) -> Option<Hit> {
            let (b, c) = (ray.origin.dot(ray.direction), ray.origin.length_squared() - RADIUS * RADIUS);
            let to_ball = (b * b > c).then(|| -b - float::sqrt(b * b - c)).filter(|t| *t > 0.0 && *t < ray.length);
            if let Some(distance) = to_ball {
                let normal = ray.at(distance) / RADIUS;
                let surface = Surface::Mirror { reflectance: Spectrum::ONE };
                return Some(Hit { distance, normal, shading: normal, surface, light: None });
            }
            let distance = (5.0 - ray.origin.z) / ray.direction.z;
            let surface = Surface::Lambert { reflectance: Spectrum::splat(0.5) };
            let hit = Hit { distance, normal: Vec3::NEG_Z, shading: Vec3::NEG_Z, surface, light: None };
            (distance > 0.0 && distance < ray.length).then_some(hit)
        }
    }

    #[test]
    fn what_a_mirror_ball_shows_seems_as_far_away_as_it_is_small() {
        let nothing = Homogeneous::new(Spectrum::ZERO, Spectrum::ZERO, Phase::ISOTROPIC).unwrap();
        let world = World { medium: &nothing, scene: &Ball, lights: (&[]).into() };
        let settings = Settings::default();
        // Seen from 2 m before the ball, close to its middle.
        let eye = Vec3::new(0.0, 0.0, 2.0 + RADIUS);
        let narrow = |[x, y]: [f32; 2]| Ray::new(eye, Vec3::new(0.01 * (x - 0.5), 0.01 * (y - 0.5), -1.0).normalize());
        let mut seen = 0;
        for number in 0..32 {
            Asked::View { ray: narrow, pixel: 1e-3 }.visit(number, &world, &settings, &mut |place, distance| {
                if place.is_seen {
                    // To the ball d, from there to the wall D: what is seen moves by d + D (1 + 2 d/r) per radian; by a little more where the ball bends away.
                    let expected = 2.0 + (5.0 - RADIUS) * (1.0 + 2.0 * 2.0 / RADIUS);
                    assert!((distance / expected - 1.0).abs() < 0.02, "{distance} in place of {expected}");
                    seen += 1;
                }
            });
        }
        assert_eq!(seen, 32);
        // Straight, the eye is as far away as it is.
        let behind = |[x, y]: [f32; 2]| Ray::new(eye, Vec3::new(0.4 * (x - 0.5), 0.4 * (y - 0.5), 1.0).normalize());
        Asked::View { ray: behind, pixel: 1e-3 }.visit(3, &world, &settings, &mut |place, distance| {
            assert!(!place.is_seen || distance == place.point.distance(eye));
        });
    }
}
