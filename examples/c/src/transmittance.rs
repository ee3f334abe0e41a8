//! Transmittance and its gradients, through media of this library or of the host.

use fogbow::spectrum::Gradient;
use fogbow::transmittance::thickness::{self, Marching, Steps};

use crate::arguments;
use crate::handles;
use crate::host::fogbow_ray;
use crate::medium::{Shared, fogbow_medium};
use crate::status::{Outcome, fogbow_status, guard, wrong};

/// So many steps of equal length, sampled in their middle.
pub const FOGBOW_STEPS_MIDPOINTS: u32 = 0;
/// So many panels of 8 Gauss–Legendre nodes: for smooth media as good as exact.
pub const FOGBOW_STEPS_GAUSS: u32 = 1;

/// Gradient of a colour: derivatives (per metre) along x, y and z, of three channels each. Fixed for ever.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_gradient {
    /// Derivative along x.
    pub x: [f32; 3],
    /// Derivative along y.
    pub y: [f32; 3],
    /// Derivative along z.
    pub z: [f32; 3],
}

impl fogbow_gradient {
    fn of(gradient: &Gradient) -> Self {
        Self { x: gradient.x.0, y: gradient.y.0, z: gradient.z.0 }
    }
}

/// Transmittance along a ray, with its gradients with respect to the ray's origin. Fixed for ever: arrays of it cross the interface.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_transmittance {
    /// T = exp(-optical thickness).
    pub value: [f32; 3],
    /// Its gradient with the far end held fixed.
    pub gradient_fixed: fogbow_gradient,
    /// Its gradient when the whole segment is moved.
    pub gradient_joint: fogbow_gradient,
}

/// Steps of a part at most. More: jobs that never end.
const MOST_STEPS: u32 = 1 << 16;

fn marching(kind: u32, count: u32) -> Outcome<Marching> {
    if count == 0 || count > MOST_STEPS {
        return wrong(format!("`step_count` is {count}; there are from 1 to {MOST_STEPS}"));
    }
    match kind {
        FOGBOW_STEPS_MIDPOINTS => Ok(Marching::midpoints(count)),
        FOGBOW_STEPS_GAUSS => Ok(Marching { steps: Steps::Gauss(count), offset: 0.5 }),
        _ => wrong(format!("`steps` is {kind}, which none are")),
    }
}

/// Transmittance along rays with its gradients: Jarosz et al. 2008, Eq. 16 to 22. Exact where the medium says that it is constant;
/// elsewhere marched, in
/// `step_count` steps (`FOGBOW_STEPS_…`) of every part of a ray in between. A medium of the host is asked by its callbacks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_transmittance_along(
    medium: *const fogbow_medium,
    rays: *const fogbow_ray,
    count: usize,
    steps: u32,
    step_count: u32,
    answers: *mut fogbow_transmittance,
) -> fogbow_status {
    guard(|| {
        let medium = handles::get::<Shared>(medium, "medium")?;
        // SAFETY: what the head of the header asks of pointers.
        let (rays, answers) =
            unsafe { (arguments::many(rays, count, "rays")?, arguments::room(answers, count, "answers")?) };
        let marching = marching(steps, step_count)?;
        for (ray, answer) in rays.iter().zip(answers) {
            let found = thickness::transmittance_with_gradients(&ray.check("rays[i]")?, medium.get(), marching);
            *answer = fogbow_transmittance {
                value: found.value.0,
                gradient_fixed: fogbow_gradient::of(&found.gradient_fixed),
                gradient_joint: fogbow_gradient::of(&found.gradient_joint),
            };
        }
        Ok(())
    })
}
