//! Covariances of light fields and what happens to them: Belcour et al. 2014, Fig. 3 and Eq. 6 to 14.

use fogbow::covariance::{LIMIT, Symmetric4, operators, phase_covariance};
use fogbow::math::Symmetric2;
use fogbow::phase::Deflection;

use crate::arguments;
use crate::host::fogbow_phase;
use crate::status::{Outcome, fogbow_status, guard, wrong};

/// A symmetric 2 × 2 matrix. Fixed for ever.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_symmetric2 {
    /// First row, first column.
    pub xx: f32,
    /// Off the diagonal.
    pub xy: f32,
    /// Second row, second column.
    pub yy: f32,
}

/// The covariance of a light field's spectrum around a ray, over places (u, v) across it and directions (theta, phi). Fixed for ever.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_covariance {
    /// Over places (cycles²/m²).
    pub spatial: fogbow_symmetric2,
    /// Of places with directions (cycles²/(m rad)): u theta, u phi, v theta, v phi.
    pub mixed: [f32; 4],
    /// Over directions (cycles²/rad²).
    pub angular: fogbow_symmetric2,
}

impl fogbow_symmetric2 {
    fn of(matrix: &Symmetric2) -> Self {
        Self { xx: matrix.xx, xy: matrix.xy, yy: matrix.yy }
    }

    /// # Safety
    /// As [`arguments::value`].
    unsafe fn read(pointer: *const Self, name: &str) -> Outcome<Symmetric2> {
        // SAFETY: by contract.
        let Self { xx, xy, yy } = unsafe { arguments::value(pointer, name)? };
        finite(&[xx, xy, yy], name)?;
        Ok(Symmetric2 { xx, xy, yy })
    }
}

fn finite(numbers: &[f32], name: &str) -> Outcome {
    if numbers.iter().all(|number| number.is_finite()) {
        Ok(())
    } else {
        wrong(format!("`{name}` is not finite: {numbers:?}"))
    }
}

impl fogbow_covariance {
    fn of(matrix: &Symmetric4) -> Self {
        Self {
            spatial: fogbow_symmetric2::of(&matrix.spatial),
            mixed: matrix.mixed,
            angular: fogbow_symmetric2::of(&matrix.angular),
        }
    }

    /// # Safety
    /// As [`arguments::value`].
    unsafe fn read(pointer: *const Self, name: &str) -> Outcome<Symmetric4> {
        // SAFETY: by contract.
        let Self { spatial: x, mixed, angular: p } = unsafe { arguments::value(pointer, name)? };
        finite(&[x.xx, x.xy, x.yy, p.xx, p.xy, p.yy], name)?;
        finite(&mixed, name)?;
        let part = |of: fogbow_symmetric2| Symmetric2 { xx: of.xx, xy: of.xy, yy: of.yy };
        Ok(Symmetric4 { spatial: part(x), mixed, angular: part(p) })
    }
}

/// One covariance to another; both may be the same place.
///
/// # Safety
/// As [`arguments::value`] and [`arguments::place`].
unsafe fn change(
    light: *const fogbow_covariance,
    changed: *mut fogbow_covariance,
    by: impl FnOnce(&Symmetric4) -> Outcome<Symmetric4>,
) -> Outcome {
    // SAFETY: by contract.
    let (light, place) = unsafe { (fogbow_covariance::read(light, "light")?, arguments::place(changed, "changed")?) };
    place.set(fogbow_covariance::of(&by(&light)?));
    Ok(())
}

fn number(of: f32, name: &str) -> Outcome<f32> {
    finite(&[of], name).map(|()| of)
}

fn cosine(of: f32, name: &str) -> Outcome<f32> {
    arguments::within(of, -1.0, 1.0, name)
}

/// After a flight of `distance` (m): Fig. 3. `light` and `changed` may be the same in all operators.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_travelled(
    light: *const fogbow_covariance,
    distance: f32,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    // SAFETY: what the head of the header asks of pointers.
    guard(|| unsafe { change(light, changed, |light| Ok(light.travelled(number(distance, "distance")?))) })
}

/// Multiplied in space by a mask of the covariance `mask` (cycles²/m²): an occluder, a texture. Fig. 3.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_masked(
    light: *const fogbow_covariance,
    mask: *const fogbow_symmetric2,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    // SAFETY: what the head of the header asks of pointers.
    guard(|| unsafe { change(light, changed, |light| Ok(light.masked(&fogbow_symmetric2::read(mask, "mask")?))) })
}

/// Attenuated along `distance` (m) by a medium whose extinction has the Hessian `hessian` (1/m³) across the ray: Eq. 6 and 7.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_attenuated(
    light: *const fogbow_covariance,
    hessian: *const fogbow_symmetric2,
    distance: f32,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    guard(|| {
        let distance = arguments::within(distance, 0.0, f32::MAX, "distance")?;
        // SAFETY: what the head of the header asks of pointers.
        unsafe {
            change(
                light,
                changed,
                |light| Ok(light.attenuated(&fogbow_symmetric2::read(hessian, "hessian")?, distance)),
            )
        }
    })
}

/// Scattered by a lobe of angular covariance `lobe` (cycles²/rad²; see `fogbow_phase_covariance`), turned by an angle of cosine
/// `cos_alpha` in the plane of u: Eq. 11 to 13.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_scattered(
    light: *const fogbow_covariance,
    cos_alpha: f32,
    lobe: *const fogbow_symmetric2,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    guard(|| {
        let cos_alpha = cosine(cos_alpha, "cos_alpha")?;
        // SAFETY: what the head of the header asks of pointers.
        unsafe {
            change(light, changed, |light| Ok(light.scattered(cos_alpha, &fogbow_symmetric2::read(lobe, "lobe")?)))
        }
    })
}

/// In a frame turned about the ray by an angle of this cosine and sine: u' = cos u + sin v.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_rotated(
    light: *const fogbow_covariance,
    cos: f32,
    sin: f32,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    guard(|| {
        let (cos, sin) = (cosine(cos, "cos")?, cosine(sin, "sin")?);
        // SAFETY: what the head of the header asks of pointers.
        unsafe { change(light, changed, |light| Ok(light.rotated(cos, sin))) }
    })
}

/// Reflected by a surface: met at an angle of this cosine in the plane of u, of curvature `curvature` (1/m, convex positive; first axis in
/// the plane of incidence), with a lobe of angular covariance `lobe` (cycles²/rad²; see `fogbow_phong_covariance`), and left at an
/// angle of cosine `cos_out`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_reflected(
    light: *const fogbow_covariance,
    cosines: *const f32,
    curvature: *const fogbow_symmetric2,
    lobe: *const fogbow_symmetric2,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (curvature, lobe, [to, from]) = unsafe {
            let curvature = fogbow_symmetric2::read(curvature, "curvature")?;
            (
                curvature,
                fogbow_symmetric2::read(lobe, "lobe")?,
                arguments::value::<[f32; 2]>(cosines.cast(), "cosines")?,
            )
        };
        let (to, from) = (cosine(to, "cosines[0]")?, cosine(from, "cosines[1]")?);
        // SAFETY: as above.
        unsafe {
            change(light, changed, |light| {
                let on_surface = light.projected(to).curved(&curvature, to).flipped();
                Ok(on_surface.reflected_in_lobe(&lobe).curved(&curvature, from).unprojected(from))
            })
        }
    })
}

/// Of the sum of two light fields in the same frame, with energies `weight` and `other_weight` (not negative).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_combined(
    light: *const fogbow_covariance,
    weight: f32,
    other: *const fogbow_covariance,
    other_weight: f32,
    changed: *mut fogbow_covariance,
) -> fogbow_status {
    guard(|| {
        let weight = arguments::within(weight, 0.0, f32::MAX, "weight")?;
        let other_weight = arguments::within(other_weight, 0.0, f32::MAX, "other_weight")?;
        // SAFETY: what the head of the header asks of pointers.
        unsafe {
            let other = fogbow_covariance::read(other, "other")?;
            change(light, changed, |light| Ok(light.combined(weight, &other, other_weight)))
        }
    })
}

/// Covariance (cycles²/m²) across the ray of the fluence: X - C P⁺ Cᵀ.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_covariance_slice(
    light: *const fogbow_covariance,
    slice: *mut fogbow_symmetric2,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (light, slice) = unsafe { (fogbow_covariance::read(light, "light")?, arguments::place(slice, "slice")?) };
        slice.set(fogbow_symmetric2::of(&light.slice()));
        Ok(())
    })
}

/// Angular covariance (cycles²/rad²) of a phase function around a deflection of this cosine: Eq. 13 and 14.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_phase_covariance(
    phase: *const fogbow_phase,
    cos_deflection: f32,
    lobe: *mut fogbow_symmetric2,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (phase, lobe) =
            unsafe { (arguments::value(phase, "phase")?.check("phase")?, arguments::place(lobe, "lobe")?) };
        let at = Deflection::from_cos(cosine(cos_deflection, "cos_deflection")?);
        lobe.set(fogbow_symmetric2::of(&phase_covariance(&phase, at)));
        Ok(())
    })
}

/// Angular covariance (cycles²/rad²) of a Phong lobe of an exponent (not negative).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_phong_covariance(exponent: f32, lobe: *mut fogbow_symmetric2) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let lobe = unsafe { arguments::place(lobe, "lobe")? };
        let exponent = arguments::within(exponent, 0.0, LIMIT, "exponent")?;
        lobe.set(fogbow_symmetric2::of(&operators::phong_lobe(exponent)));
        Ok(())
    })
}
