//! Eye rays of pictures.

use core::ffi::c_void;

use fogbow::math::{Ray, Vec3};

use crate::arguments::{self, Versioned};
use crate::host::fogbow_ray;
use crate::status::{Outcome, complain};

/// The eye rays of a picture.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_view {
    /// sizeof(fogbow_view).
    pub size: u32,
    /// Angular width of a pixel (rad), above 0.
    pub pixel: f32,
    /// Passed to `ray`.
    pub context: *const c_void,
    /// Writes the ray through the point `at` of the picture: (0, 0) is the upper left corner, (1, 1) the lower right one. Pure,
    /// and called by every
    /// thread that runs jobs. `fogbow_camera_ray` is one.
    pub ray: Option<unsafe extern "C" fn(context: *const c_void, at: *const f32, ray: *mut fogbow_ray)>,
}

// SAFETY: `repr(C)`, the size first, then a number, a pointer and an optional function.
unsafe impl Versioned for fogbow_view {}

/// A perspective camera, for `fogbow_camera_ray`.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_camera {
    /// Where the eye is (m).
    pub eye: [f32; 3],
    /// What it looks at (m).
    pub target: [f32; 3],
    /// What is up; not along the way to `target`.
    pub up: [f32; 3],
    /// Angle (rad) between the lower and the upper border of the picture, below pi.
    pub field_of_view: f32,
    /// Width of the picture over its height.
    pub aspect: f32,
}

/// The ray of a camera through a point `at` (x, y; [0, 1]; the first from the left, the second from above): fits `fogbow_view.ray`, with a
/// `fogbow_camera` as the context. A camera that cannot be, or a null pointer, gives a ray of length 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_camera_ray(camera: *const c_void, at: *const f32, ray: *mut fogbow_ray) {
    let nothing = Ray { origin: Vec3::ZERO, direction: Vec3::Z, length: 0.0 };
    // SAFETY: what the head of the header asks of pointers.
    let parts = unsafe {
        (
            arguments::value(camera.cast::<fogbow_camera>(), ""),
            arguments::value(at.cast(), ""),
            arguments::place(ray, ""),
        )
    };
    let (camera, at, place) = match parts {
        (Ok(camera), Ok(at), Ok(place)) => (camera, at, place),
        (.., Ok(place)) => return place.set(fogbow_ray::of(&nothing)),
        _ => return,
    };
    place.set(fogbow_ray::of(&through(&camera, at).unwrap_or(nothing)));
}

fn through(camera: &fogbow_camera, [x, y]: [f32; 2]) -> Option<Ray> {
    let eye = Vec3::from_array(camera.eye);
    let forward = (Vec3::from_array(camera.target) - eye).try_normalize()?;
    let right = forward.cross(Vec3::from_array(camera.up)).try_normalize()?;
    let half = fogbow::math::float::tan(0.5 * camera.field_of_view);
    let (across, upwards) = ((2.0 * x - 1.0) * half * camera.aspect, (1.0 - 2.0 * y) * half);
    let direction = (forward + right * across + right.cross(forward) * upwards).try_normalize()?;
    eye.is_finite().then_some(Ray { origin: eye, direction, length: f32::INFINITY })
}

/// The eye rays of a host.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Eye {
    context: *const c_void,
    ray: unsafe extern "C" fn(*const c_void, *const f32, *mut fogbow_ray),
    pub(crate) pixel: f32,
}

// SAFETY: the host promises that its callbacks may be called from every thread that calls fogbow.
unsafe impl Send for Eye {}
// SAFETY: as above.
unsafe impl Sync for Eye {}

/// A function of eye rays, of a type that has a name.
pub(crate) type EyeRays = Box<dyn Fn([f32; 2]) -> Ray + Send + Sync>;

impl Eye {
    /// # Safety
    /// As [`arguments::read`].
    pub(crate) unsafe fn read(view: *const fogbow_view) -> Outcome<Self> {
        // SAFETY: by contract.
        let view = unsafe { arguments::read(view, "view")? };
        let ray = view.ray.ok_or_else(|| arguments::null("view->ray"))?;
        let pixel = arguments::within(view.pixel, f32::MIN_POSITIVE, 3.2, "view->pixel")?;
        Ok(Self { context: view.context, ray, pixel })
    }

    pub(crate) fn ray(&self, at: [f32; 2]) -> Ray {
        let mut ray = fogbow_ray { origin: [0.0; 3], direction: [0.0; 3], length: f32::INFINITY };
        // SAFETY: the host's function, with pointers that are good during the call.
        unsafe { (self.ray)(self.context, at.as_ptr(), &raw mut ray) };
        ray.check("").unwrap_or_else(|_| {
            complain("the callback `ray` gave an origin that is not finite, or a direction that is not of length 1");
            Ray { origin: Vec3::ZERO, direction: Vec3::Z, length: 0.0 }
        })
    }

    pub(crate) fn rays(self) -> EyeRays {
        Box::new(move |at| self.ray(at))
    }
}
