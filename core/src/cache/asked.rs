//! Where light is asked for: along the eye rays of a picture, or anywhere in a box.

use super::eye::{Place, places, places_around};
use super::settings::Settings;
use crate::bytes::Crc;
use crate::host::{Medium, Scene};
use crate::math::{Bounds, Ray, Vec3};
use crate::sampling::uniform::mix;
use crate::sampling::{Generator, even2, even3, uniform2, warp};
use crate::world::World;

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

    /// Calls `visit(place, distance of the eye)` for the places that ray number `number` asks for.
    pub(super) fn visit<M: Medium + ?Sized, S: Scene + ?Sized>(
        &self,
        number: u32,
        world: &World<'_, M, S>,
        settings: &Settings,
        mut visit: impl FnMut(Place, f32),
    ) {
        let mut rng = Generator::new(mix(settings.seed ^ 0x70_1a_ce) ^ u64::from(number));
        match self {
            Self::View { ray, .. } => {
                let ray = ray(Asked::at(number));
                places(&ray, world, &settings.eye, &mut rng, |place| visit(place, place.point.distance(ray.origin)));
            }
            Self::Box(bounds) => {
                let point = bounds.min + bounds.size() * Vec3::from(even3(number + 1));
                let direction = warp::uniform_sphere(uniform2(&mut rng));
                places_around(point, direction, world, |place| visit(place, f32::INFINITY));
            }
        }
    }
}
