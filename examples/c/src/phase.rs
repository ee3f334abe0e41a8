//! Phase functions and spherical harmonics.

use fogbow::math::Vec2;
use fogbow::phase::{Deflection, Phase};
use fogbow::sh;

use crate::arguments;
use crate::host::fogbow_phase;
use crate::status::{Outcome, fogbow_status, guard, wrong};

/// # Safety
/// As [`arguments::value`].
unsafe fn read(phase: *const fogbow_phase) -> Outcome<Phase> {
    // SAFETY: by contract.
    unsafe { arguments::value(phase, "phase")? }.check("phase")
}

/// # Safety
/// As [`arguments::many`] and [`arguments::room`].
unsafe fn by_cosine(
    phase: *const fogbow_phase,
    (cosines, count, answers): (*const f32, usize, *mut f32),
    of: impl Fn(&Phase, Deflection) -> f32,
) -> Outcome {
    // SAFETY: by contract.
    let (phase, cosines, answers) = unsafe {
        (read(phase)?, arguments::many(cosines, count, "cosines")?, arguments::room(answers, count, "answers")?)
    };
    for (cosine, answer) in cosines.iter().zip(answers) {
        let cosine = arguments::within(*cosine, -1.0, 1.0, "cosines[i]")?;
        *answer = of(&phase, Deflection::from_cos(cosine));
    }
    Ok(())
}

/// Values (1/sr) of a phase function at cosines of the deflection (1: straight on). Their integral over the sphere is 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_phase_value(
    phase: *const fogbow_phase,
    cosines: *const f32,
    count: usize,
    values: *mut f32,
) -> fogbow_status {
    // SAFETY: what the head of the header asks of pointers.
    guard(|| unsafe { by_cosine(phase, (cosines, count, values), |phase, at| phase.value(at)[0]) })
}

/// Derivatives (1/sr) of a phase function with respect to the cosine of the deflection: Jarosz et al. 2008, Eq. 44 and 45.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_phase_derivative(
    phase: *const fogbow_phase,
    cosines: *const f32,
    count: usize,
    derivatives: *mut f32,
) -> fogbow_status {
    // SAFETY: what the head of the header asks of pointers.
    guard(|| unsafe { by_cosine(phase, (cosines, count, derivatives), |phase, at| phase.derivative(at)[0]) })
}

/// The Legendre moment of a phase function for a degree from 0 to 16: 1 for degree 0, the mean cosine for degree 1.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_phase_moment(
    phase: *const fogbow_phase,
    degree: u32,
    moment: *mut f32,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (phase, moment) = unsafe { (read(phase)?, arguments::place(moment, "moment")?) };
        if degree as usize > sh::MAX_DEGREE {
            return wrong(format!("`degree` is {degree}, more than {}", sh::MAX_DEGREE));
        }
        moment.set(phase.moment(degree as usize)[0]);
        Ok(())
    })
}

/// Draws a direction (x, y, z; unit) from which light comes that leaves towards `to_eye` (unit), by two numbers `u` in [0, 1).
/// `density` (1/sr; may be null): with which it
/// was drawn, the value of the phase function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_phase_sample(
    phase: *const fogbow_phase,
    to_eye: *const f32,
    u: *const f32,
    to_light: *mut f32,
    density: *mut f32,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (phase, to_eye, u, to_light, density) = unsafe {
            let to_light = arguments::room::<f32>(to_light, 3, "to_light")?;
            let of = (arguments::value(to_eye.cast(), "to_eye")?, arguments::value::<[f32; 2]>(u.cast(), "u")?);
            (read(phase)?, of.0, of.1, to_light, arguments::place_if_any(density, "density")?)
        };
        let to_eye = arguments::unit(to_eye, "to_eye")?;
        for number in u {
            arguments::within(number, 0.0, 1.0 - f32::EPSILON / 2.0, "u[i]")?;
        }
        let sample = phase.sample(to_eye, Vec2::from_array(u));
        to_light.copy_from_slice(&sample.to_light.to_array());
        density.iter().for_each(|place| place.set(sample.pdf));
        Ok(())
    })
}

/// Real spherical harmonics up to a degree from 0 to 16 in a direction (x, y, z; unit): (degree + 1)² values, number l² + l + m of
/// degree l and order m, without the
/// Condon–Shortley phase.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_sh_evaluate(direction: *const f32, degree: u32, values: *mut f32) -> fogbow_status {
    guard(|| {
        if degree as usize > sh::MAX_DEGREE {
            return wrong(format!("`degree` is {degree}, more than {}", sh::MAX_DEGREE));
        }
        let count = sh::coefficient_count(degree as usize);
        // SAFETY: what the head of the header asks of pointers.
        let (direction, values) =
            unsafe { (arguments::value(direction.cast(), "direction")?, arguments::room(values, count, "values")?) };
        sh::evaluate(arguments::unit(direction, "direction")?, degree as usize, values);
        Ok(())
    })
}
