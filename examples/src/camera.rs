//! The pinhole camera.

use fogbow::math::{Ray, Vec2, Vec3};

use crate::scene_file::{FovAxis, Sensor};
use crate::transform::{normalized, to_vec3};

/// A pinhole camera: rays of Mitsuba's `perspective` sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    eye: Vec3,
    /// Towards the right border of the film, one unit in front.
    right: Vec3,
    /// Towards the upper border.
    up: Vec3,
    forward: Vec3,
    near: f32,
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
        let axis = |index| normalized(sensor.to_world.column(index)).unwrap_or_default();
        // Local +x is left in the image.
        let right = axis(0).map(|c| -c * across);
        let up = axis(1).map(|c| c * across / aspect);
        Self {
            eye: to_vec3(sensor.to_world.column(3)),
            right: to_vec3(right),
            up: to_vec3(up),
            forward: to_vec3(axis(2)),
            near: sensor.near as f32,
        }
    }

    /// The ray through a point of the film: `x` in [0, 1] from the left, `y` in [0, 1] from the top.
    /// It starts on the near plane.
    #[inline]
    #[must_use]
    pub fn ray(&self, film: Vec2) -> Ray {
        let across = self.forward + self.right * (2.0 * film.x - 1.0) + self.up * (1.0 - 2.0 * film.y);
        Ray::new(self.eye + across * self.near, across.normalize())
    }

    /// Where on the film `point` is seen, beyond its borders too; `None` behind the near plane.
    #[must_use]
    pub fn project(&self, point: Vec3) -> Option<Vec2> {
        let towards = point - self.eye;
        let depth = towards.dot(self.forward);
        let along = |axis: Vec3| towards.dot(axis) / (axis.length_squared() * depth);
        (depth > self.near).then(|| Vec2::new(0.5 + 0.5 * along(self.right), 0.5 - 0.5 * along(self.up)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transform::Transform;

    fn sensor(fov: f64, fov_axis: FovAxis, width: u32, height: u32) -> Sensor {
        let to_world = Transform::look_at([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0]).unwrap();
        Sensor { fov, fov_axis, near: 0.01, far: 1e4, to_world, width, height, samples: 1 }
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

    #[test]
    fn rays_start_on_the_near_plane() {
        let ray = at(&sensor(90.0, FovAxis::X, 10, 10), 1.0, 0.0);
        assert!((ray.origin - Vec3::new(0.01, 0.01, 3.99)).length() < 1e-6);
    }
}
