//! Clamped connections of virtual lights, and the light that clamping takes: Engelhardt et al. 2012, § 3.4 and Eq. 3 to 5.

use fogbow::math::Vec3;
use fogbow::sampling::independent;
use fogbow::vpl::{Bound, Compensation, Flights, Receiver, Scatterer, contraction, geometry, next_vertex};

use crate::arguments;
use crate::host::fogbow_properties;
use crate::status::{Outcome, fogbow_status, guard, wrong};
use crate::world::{self, fogbow_chance, fogbow_world};

fn bound_of(radius: f32) -> Outcome<Bound> {
    Bound::within(radius).map_err(|error| crate::status::refused("radius")(&error))
}

/// What clamping within `radius` (m, above 0) leaves and takes of a connection over `distance` (m, above 0) with the product of
/// cosines `cosines` (1 in a medium): `clamped` is
/// min(G, 1/radius²) (1/m²) with G = cosines/distance², `missing` the share of G that is taken. Each may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_clamped_connection(
    radius: f32,
    distance: f32,
    cosines: f32,
    clamped: *mut f32,
    missing: *mut f32,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let (clamped, missing) =
            unsafe { (arguments::place_if_any(clamped, "clamped")?, arguments::place_if_any(missing, "missing")?) };
        let bound = bound_of(radius)?;
        let distance = arguments::within(distance, 1e-18, 1e18, "distance")?;
        let cosines = arguments::within(cosines, -1.0, 1.0, "cosines")?;
        let distance2 = distance * distance;
        clamped.iter().for_each(|place| place.set(bound.clamped(geometry(distance2, cosines))));
        missing.iter().for_each(|place| place.set(bound.missing(distance2, cosines)));
        Ok(())
    })
}

/// What one step of compensation within `radius` (m) makes of the light it is given, in an even isotropic medium of this extinction
/// (1/m) and albedo: after n steps
/// its n-th power is still missing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_contraction(
    extinction: f32,
    albedo: f32,
    radius: f32,
    share: *mut f32,
) -> fogbow_status {
    guard(|| {
        // SAFETY: what the head of the header asks of pointers.
        let share = unsafe { arguments::place(share, "share")? };
        let extinction = arguments::within(extinction, 0.0, 1e18, "extinction")?;
        let albedo = arguments::within(albedo, 0.0, 1.0, "albedo")?;
        share.set(contraction(extinction, albedo, arguments::within(radius, 0.0, 1e18, "radius")?));
        Ok(())
    })
}

/// Unbiased: delta tracking, and all surfaces are looked at.
pub const FOGBOW_COMPENSATION_FULL: u32 = 0;
/// As if the medium around were even: cheaper, biased where it is not.
pub const FOGBOW_COMPENSATION_APPROXIMATE: u32 = 1;

/// A point of a medium that light is gathered for.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_receiver {
    /// sizeof(fogbow_receiver).
    pub size: u32,
    /// Where (m).
    pub point: [f32; 3],
    /// Where the light leaves to (unit).
    pub to_eye: [f32; 3],
    /// What scatters it there; absorption and emission do not count.
    pub properties: fogbow_properties,
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl arguments::Versioned for fogbow_receiver {}

/// The next vertex of a compensation path.
#[repr(C)]
#[derive(Debug, Clone, Copy)]
pub struct fogbow_vertex {
    /// sizeof(fogbow_vertex).
    pub size: u32,
    /// 0: the path ends here, and all else is 0. 1: in the medium. 2: on a surface.
    pub kind: u32,
    /// Where (m).
    pub point: [f32; 3],
    /// Back to where it came from (unit).
    pub to_eye: [f32; 3],
    /// Factor on the light that leaves the vertex towards `to_eye`; in the mean over vertices that makes what clamping takes.
    pub weight: [f32; 3],
}

// SAFETY: `repr(C)`, the size first, then numbers.
unsafe impl arguments::Versioned for fogbow_vertex {}

/// Draws the next vertex of a compensation path within `radius` (m) of a receiver (Eq. 3 to 5), with the random numbers of `chance`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fogbow_compensation_vertex(
    world: *const fogbow_world,
    receiver: *const fogbow_receiver,
    radius: f32,
    compensation: u32,
    chance: fogbow_chance,
    vertex: *mut fogbow_vertex,
) -> fogbow_status {
    guard(|| {
        let world = world::get(world)?;
        // SAFETY: what the head of the header asks of pointers.
        let receiver = unsafe { arguments::read(receiver, "receiver")? };
        let compensation = match compensation {
            FOGBOW_COMPENSATION_FULL => Compensation::FULL,
            FOGBOW_COMPENSATION_APPROXIMATE => {
                Compensation { flights: Flights::LocallyHomogeneous, ..Compensation::FULL }
            }
            other => return wrong(format!("`compensation` is {other}, which none is")),
        };
        let bound = bound_of(radius)?;
        let (point, to_eye) = (
            arguments::vector(receiver.point, "receiver->point")?,
            arguments::unit(receiver.to_eye, "receiver->to_eye")?,
        );
        let properties = receiver.properties.check("receiver->properties")?;
        let mut answer = fogbow_vertex { size: 0, kind: 0, point: [0.0; 3], to_eye: [0.0; 3], weight: [0.0; 3] };
        let mut rng = independent(chance.seed, chance.first_key, chance.sample);
        let next = Receiver::in_medium(point, to_eye, &properties)
            .and_then(|receiver| next_vertex(&world.get(), &receiver, bound, &compensation, &mut rng));
        if let Some((next, weight)) = next {
            answer.kind = if matches!(next.scatterer, Scatterer::Medium { .. }) { 1 } else { 2 };
            let plain = |vector: Vec3| vector.to_array();
            (answer.point, answer.to_eye, answer.weight) = (plain(next.point), plain(next.to_eye), weight.0);
        }
        // SAFETY: as above.
        unsafe { arguments::write_sized(vertex, "vertex", answer) }
    })
}
