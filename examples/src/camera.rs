//! Where eye rays start, and where they go.

use fogbow::math::{Ray, Vec2, Vec3};
use fogbow::rand_core::Rng;
use fogbow::sampling::uniform2;

use crate::filter::FilterTable;
use crate::scene_file::{FovAxis, Projection, Sensor};
use crate::transform::{normalized, to_vec3};

/// A camera: rays of Mitsuba's sensors `perspective`, `thinlens` and `orthographic`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: Vec3,
    /// Towards the right border of the film, one unit in front; where rays are parallel, to the border itself.
    right: Vec3,
    /// Towards the upper border.
    up: Vec3,
    forward: Vec3,
    near: f32,
    /// Corner and size of what is seen of the film.
    window: [Vec2; 2],
    /// Radius, and distance of what is sharp; of a pinhole, 0.
    lens: [f32; 2],
    is_parallel: bool,
}

impl Camera {
    /// The camera of a sensor whose film is `width` by `height` pixels.
    #[must_use]
    pub fn new(sensor: &Sensor, width: u32, height: u32) -> Self {
        let aspect = f64::from(width) / f64::from(height);
        let tangent = (0.5 * sensor.fov.to_radians()).tan();
        let across = match sensor.fov_axis {
            FovAxis::X => tangent,
            FovAxis::Y => tangent * aspect,
            FovAxis::Smaller => tangent * aspect.max(1.0),
            FovAxis::Larger => tangent * aspect.min(1.0),
            FovAxis::Diagonal => tangent * aspect / (1.0 + aspect * aspect).sqrt(),
        };
        let is_parallel = sensor.projection == Projection::Parallel;
        let axis = |index| normalized(sensor.to_world.column(index)).unwrap_or_default();
        let across = if is_parallel { 1.0 } else { across };
        let side = |index| if is_parallel { sensor.to_world.column(index) } else { axis(index) };
        let lens = match sensor.projection {
            Projection::Lens { radius, focus } => [radius as f32, focus as f32],
            Projection::Pinhole | Projection::Parallel => [0.0; 2],
        };
        let [low, high] = sensor.window.map(|[x, y]| Vec2::new(x as f32, y as f32));
        // Local +x is left in the image.
        let right = side(0).map(|c| -c * across);
        let up = side(1).map(|c| c * across / aspect);
        Self {
            eye: to_vec3(sensor.to_world.column(3)),
            right: to_vec3(right),
            up: to_vec3(up),
            forward: to_vec3(axis(2)),
            near: sensor.near as f32,
            window: [low, high - low],
            lens,
            is_parallel,
        }
    }

    /// The ray through a point of the film: `x` in [0, 1] from the left, `y` in [0, 1] from the top.
    /// It starts on the near plane. Of a lens, it is the one through its centre.
    #[inline]
    #[must_use]
    pub fn ray(&self, film: Vec2) -> Ray {
        let film = self.window[0] + film * self.window[1];
        let beside = self.right * (2.0 * film.x - 1.0) + self.up * (1.0 - 2.0 * film.y);
        if self.is_parallel {
            return Ray::new(self.eye + beside + self.forward * self.near, self.forward);
        }
        let across = self.forward + self.right * (2.0 * film.x - 1.0) + self.up * (1.0 - 2.0 * film.y);
        Ray::new(self.eye + across * self.near, across.normalize())
    }

    /// The same through any point of the lens; a pinhole draws no random numbers.
    #[inline]
    #[must_use]
    pub fn ray_through_lens(&self, film: Vec2, rng: &mut (impl Rng + ?Sized)) -> Ray {
        let [radius, focus] = self.lens;
        if radius == 0.0 {
            return self.ray(film);
        }
        let film = self.window[0] + film * self.window[1];
        let across = self.forward + self.right * (2.0 * film.x - 1.0) + self.up * (1.0 - 2.0 * film.y);
        let random = uniform2(rng);
        let (sin, cos) = (core::f32::consts::TAU * random.y).sin_cos();
        let on_lens = radius * random.x.sqrt();
        let offset = (self.right.normalize() * cos + self.up.normalize() * sin) * on_lens;
        let across = across - offset / focus;
        Ray::new(self.eye + offset + across * self.near, across.normalize())
    }

    /// Where on the film `point` is seen, beyond its borders too; `None` behind the near plane.
    #[must_use]
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let towards = point - self.eye;
        let depth = towards.dot(self.forward);
        let scale = if self.is_parallel { 1.0 } else { depth };
        let along = |axis: Vec3| towards.dot(axis) / (axis.length_squared() * scale);
        let film = || Vec2::new(0.5 + 0.5 * along(self.right), 0.5 - 0.5 * along(self.up));
        (depth > self.near).then(|| (film() - self.window[0]) / self.window[1])
    }

    /// Where it stands (m).
    #[must_use]
    pub fn position(&self) -> Vec3 {
        self.eye
    }

    /// Where it looks (unit).
    #[must_use]
    pub fn forward(&self) -> Vec3 {
        self.forward
    }

    /// The angle (rad) that a pixel at the centre of a film `width` pixels wide spans.
    #[must_use]
    pub fn pixel_angle(&self, width: u32) -> f32 {
        2.0 * self.right.length() / width as f32
    }
}

/// A camera whose film has a filter.
#[derive(Debug, Clone, Copy)]
pub struct Eye<'a> {
    /// The camera.
    pub camera: Camera,
    /// The filter.
    pub filter: &'a FilterTable,
}

impl Eye<'_> {
    /// An eye ray of a sample of pixel `(x, y)` of a film of some size, and how much what it sees counts.
    #[inline]
    #[must_use]
    pub fn ray(&self, pixel: [u32; 2], size: [u32; 2], rng: &mut (impl Rng + ?Sized)) -> (Ray, f32) {
        self.ray_at(pixel, size, uniform2(rng), rng)
    }

    /// The same for given random numbers in [0, 1), which decide where in the pixel's filter it is.
    #[inline]
    #[must_use]
    pub fn ray_at(&self, pixel: [u32; 2], size: [u32; 2], u: Vec2, rng: &mut (impl Rng + ?Sized)) -> (Ray, f32) {
        let (at, weight) = self.filter.sample(pixel, size, u);
        (self.camera.ray_through_lens(at / Vec2::new(size[0] as f32, size[1] as f32), rng), weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::Transform;

    fn sensor(fov: f64, fov_axis: FovAxis, width: u32, height: u32) -> Sensor {
        let to_world = Transform::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
        Sensor { fov, fov_axis, to_world, width, height, ..Sensor::default() }
    }

    fn at(sensor: &Sensor, x: f32, y: f32) -> Ray {
        Camera::new(sensor, sensor.width, sensor.height).ray(Vec2::new(x, y))
    }

    #[test]
    fn image_right_is_world_x_and_image_top_is_world_y() {
        let t = 18.0_f32.to_radians().tan();
        let wide = sensor(36.0, FovAxis::X, 200, 100);
        for (x, y) in [(0.5, 0.5), (1.0, 0.5), (0.0, 0.0), (0.25, 1.0)] {
            let expected = Vec3::new((2.0 * x - 1.0) * t, (1.0 - 2.0 * y) * t / 2.0, -1.0).normalize();
            assert!((at(&wide, x, y).direction - expected).length() < 1e-6, "({x}, {y})");
        }
    }

    #[test]
    fn the_angle_is_measured_along_its_axis() {
        let half =
            |axis, w, h, x, y| at(&sensor(60.0, axis, w, h), x, y).direction.dot(Vec3::NEG_Z).acos().to_degrees();
        assert!((half(FovAxis::X, 200, 100, 1.0, 0.5) - 30.0).abs() < 1e-3);
        assert!((half(FovAxis::Y, 200, 100, 0.5, 0.0) - 30.0).abs() < 1e-3);
        assert!((half(FovAxis::Smaller, 200, 100, 0.5, 0.0) - 30.0).abs() < 1e-3);
        assert!((half(FovAxis::Smaller, 100, 200, 1.0, 0.5) - 30.0).abs() < 1e-3);
        assert!((half(FovAxis::Larger, 100, 200, 0.5, 0.0) - 30.0).abs() < 1e-3);
        assert!((half(FovAxis::Diagonal, 200, 100, 1.0, 0.0) - 30.0).abs() < 1e-3);
    }

    #[test]
    fn a_point_is_seen_where_its_ray_leaves() {
        let camera = Camera::new(&sensor(60.0, FovAxis::X, 200, 100), 200, 100);
        for film in [Vec2::new(0.1, 0.9), Vec2::new(0.7, 0.2), Vec2::new(1.3, -0.4)] {
            let seen = camera.project(camera.ray(film).at(3.0)).unwrap();
            assert!((seen - film).length() < 1e-5, "{film}: {seen}");
        }
        assert_eq!(camera.project(Vec3::new(0.0, 0.0, 5.0)), None);
    }

    /// Rays of Mitsuba 3.9.1 for sensors of 200 × 100 pixels that look along +z from the origin, +x left.
    #[test]
    fn windows_lenses_and_parallel_rays_are_those_of_mitsuba() {
        let usual = Sensor { fov: 40.0, fov_axis: FovAxis::X, width: 200, height: 100, ..Sensor::default() };
        let check = |sensor: &Sensor, film: [f32; 2], origin: [f32; 3], direction: [f32; 3]| {
            let ray = at(sensor, film[0], film[1]);
            let is_close = |a: Vec3, b: [f32; 3]| (a - Vec3::from(b)).length() < 2e-6;
            assert!(is_close(ray.origin, origin) && is_close(ray.direction, direction), "{sensor:?} {film:?}: {ray:?}");
        };
        let shifted = Sensor { window: [[0.2, 0.1], [1.2, 1.1]], ..usual };
        check(&shifted, [0.5, 0.5], [-0.001_455_88, -0.000_363_97, 0.01], [-0.143_976, -0.035_994, 0.988_926]);
        check(&shifted, [0.0, 0.0], [0.002_183_82, 0.001_455_88, 0.01], [0.211_228, 0.140_819, 0.967_24]);
        let cropped = Sensor { window: [[0.05, 0.3], [0.3, 0.5]], ..usual };
        check(&cropped, [1.0, 0.5], [0.001_455_88, 0.000_363_97, 0.01], [0.143_976, 0.035_994, 0.988_926]);
        let scaled = Transform::scaling([2.0, 3.0, 1.0]);
        let to_world = scaled.then(&Transform::look_at([0.0, 0.0, 5.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap());
        let parallel = Sensor { projection: Projection::Parallel, to_world, ..usual };
        check(&parallel, [1.0, 0.5], [2.0, 0.0, 4.99], [0.0, 0.0, -1.0]);
        check(&parallel, [0.0, 0.0], [-2.0, 1.5, 4.99], [0.0, 0.0, -1.0]);
        let camera = Camera::new(&parallel, 200, 100);
        assert!((camera.project(Vec3::new(-2.0, 1.5, -7.0)).unwrap() - Vec2::ZERO).length() < 1e-6);
        let camera = Camera::new(&cropped, 200, 100);
        let film = Vec2::new(0.3, 0.8);
        assert!((camera.project(camera.ray(film).at(2.0)).unwrap() - film).length() < 1e-5);
    }

    #[test]
    fn rays_through_a_lens_meet_where_it_is_sharp_and_fill_it_evenly() {
        let lens = Projection::Lens { radius: 0.2, focus: 3.0 };
        let sensor = Sensor { projection: lens, fov: 40.0, fov_axis: FovAxis::X, ..Sensor::default() };
        let camera = Camera::new(&sensor, 200, 100);
        let film = Vec2::new(0.9, 0.3);
        let sharp = camera.ray(film).origin + camera.ray(film).direction * (2.99 / camera.ray(film).direction.z);
        let mut rng = fogbow::sampling::Generator::new(1);
        let (count, mut square) = (4000, 0.0);
        for _ in 0..count {
            let ray = camera.ray_through_lens(film, &mut rng);
            let at = |z: f32| ray.origin + ray.direction * ((z - ray.origin.z) / ray.direction.z);
            assert!((at(3.0) - sharp).length() < 1e-5);
            let on_lens = at(0.0).length();
            assert!(on_lens < 0.2 + 1e-5);
            square += on_lens * on_lens / count as f32;
        }
        // The mean square of a disk is half its radius squared; of 4000 points, within 1 % (its standard deviation is 0.9 %).
        assert!((square / 0.02 - 1.0).abs() < 0.03, "{square}");
    }

    #[test]
    fn rays_start_on_the_near_plane() {
        let ray = at(&sensor(90.0, FovAxis::X, 10, 10), 1.0, 0.0);
        assert!((ray.origin - Vec3::new(0.01, 0.01, 3.99)).length() < 1e-6);
    }
}
