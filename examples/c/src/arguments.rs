//! Pointers of C, checked before they are followed: null, alignment, number of elements, sizes of structures.

use core::ptr;
use core::slice;

use fogbow::math::{Bounds, Vec3};
use fogbow::spectrum::Spectrum;

use crate::status::{FOGBOW_ERROR_NULL, FOGBOW_ERROR_SIZE, Failure, Outcome, wrong};

/// A structure that begins with its size in bytes (`u32`), of which any bytes are a value.
///
/// # Safety
/// `repr(C)`, the first field a `u32`, all others numbers, pointers, optional functions, or arrays and structures of those.
pub(crate) unsafe trait Versioned: Copy {
    /// Its size when it was first published.
    const FIRST: usize = size_of::<Self>();
}

/// A structure of the host may be so much larger than the one known here. More: nobody's structure, but a size that was not set.
const LARGEST: usize = 4096;

pub(crate) fn null(name: &str) -> Failure {
    Failure(FOGBOW_ERROR_NULL, format!("`{name}` is null"))
}

fn check<T>(pointer: *const T, name: &str) -> Outcome {
    if pointer.is_null() {
        return Err(null(name));
    }
    if !pointer.is_aligned() {
        return wrong(format!("`{name}` is not aligned to {} bytes", align_of::<T>()));
    }
    Ok(())
}

/// The size that a structure of the host says it has.
///
/// # Safety
/// If not null, `pointer` must be good to read its first four bytes, and as many as these say.
unsafe fn said<T: Versioned>(pointer: *const T, name: &str) -> Outcome<usize> {
    check(pointer, name)?;
    // SAFETY: not null, aligned, and readable by this function's contract.
    let size = unsafe { pointer.cast::<u32>().read() } as usize;
    if size < T::FIRST || size > LARGEST {
        let message = format!("`{name}->size` is {size}; set it to sizeof(*{name}), at least {} bytes", T::FIRST);
        return Err(Failure(FOGBOW_ERROR_SIZE, message));
    }
    Ok(size)
}

/// A structure of the host. One of an older header is filled up with zeros, one of a newer header may have zeros in what is not known here.
///
/// # Safety
/// As [`said`].
pub(crate) unsafe fn read<T: Versioned>(pointer: *const T, name: &str) -> Outcome<T> {
    // SAFETY: by contract.
    let size = unsafe { said(pointer, name)? };
    let known = size.min(size_of::<T>());
    // SAFETY: the host says so many bytes are there; zeros are a value of `T`, and so are any bytes.
    let (value, rest) = unsafe {
        let mut value: T = core::mem::zeroed();
        ptr::copy_nonoverlapping(pointer.cast::<u8>(), (&raw mut value).cast::<u8>(), known);
        (value, slice::from_raw_parts(pointer.cast::<u8>().add(known), size - known))
    };
    if rest.iter().any(|byte| *byte != 0) {
        let message = format!("`{name}` has fields set that this version of fogbow does not know");
        return Err(Failure(FOGBOW_ERROR_SIZE, message));
    }
    Ok(value)
}

/// Fills a structure of the host, as far as it goes; its size stays.
///
/// # Safety
/// As [`said`], and good to write.
pub(crate) unsafe fn write_sized<T: Versioned>(pointer: *mut T, name: &str, value: T) -> Outcome {
    // SAFETY: by contract.
    let known = unsafe { said(pointer, name)? }.min(size_of::<T>());
    // SAFETY: so many bytes are there, by contract; the first four are the size, which the host has set.
    unsafe { ptr::copy_nonoverlapping((&raw const value).cast::<u8>().add(4), pointer.cast::<u8>().add(4), known - 4) };
    Ok(())
}

/// One value.
///
/// # Safety
/// If not null and aligned, `pointer` must be good to read.
pub(crate) unsafe fn value<T: Copy>(pointer: *const T, name: &str) -> Outcome<T> {
    check(pointer, name)?;
    // SAFETY: not null, aligned, and readable by contract.
    Ok(unsafe { pointer.read() })
}

fn bytes_of<T>(count: usize, name: &str) -> Outcome {
    match count.checked_mul(size_of::<T>()) {
        Some(bytes) if bytes <= isize::MAX as usize => Ok(()),
        _ => wrong(format!("`{name}`: {count} elements are more than memory can hold")),
    }
}

/// So many values; none if `count` is 0, whatever the pointer.
///
/// # Safety
/// If not null and aligned, `pointer` must be good to read `count` values for `'a`.
pub(crate) unsafe fn many<'a, T: Copy>(pointer: *const T, count: usize, name: &str) -> Outcome<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    check(pointer, name)?;
    bytes_of::<T>(count, name)?;
    // SAFETY: not null, aligned, of a size that can be, and readable by contract.
    Ok(unsafe { slice::from_raw_parts(pointer, count) })
}

/// Room for so many values, which the host has set to something.
///
/// # Safety
/// If not null and aligned, `pointer` must be good to read and write `count` values for `'a`, and nobody else's meanwhile.
pub(crate) unsafe fn room<'a, T: Copy>(pointer: *mut T, count: usize, name: &str) -> Outcome<&'a mut [T]> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(pointer, name)?;
    bytes_of::<T>(count, name)?;
    // SAFETY: as in `many`, and writable by contract. Any bytes are a value of the numbers that C lends.
    Ok(unsafe { slice::from_raw_parts_mut(pointer, count) })
}

/// A place for one answer.
pub(crate) struct Place<T>(*mut T);

impl<T> Place<T> {
    pub(crate) fn set(&self, value: T) {
        // SAFETY: [`place`] has checked the pointer, and its contract says that it is writable.
        unsafe { self.0.write(value) };
    }
}

/// Where one answer goes.
///
/// # Safety
/// If not null and aligned, `pointer` must be good to write until the end of the call.
pub(crate) unsafe fn place<T>(pointer: *mut T, name: &str) -> Outcome<Place<T>> {
    check(pointer, name)?;
    Ok(Place(pointer))
}

/// Where an answer goes that the host may not want.
///
/// # Safety
/// As [`place`].
pub(crate) unsafe fn place_if_any<T>(pointer: *mut T, name: &str) -> Outcome<Option<Place<T>>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: by contract.
    unsafe { place(pointer, name) }.map(Some)
}

/// Memory for so many values, all `value`; an error where there is none.
pub(crate) fn filled<T: Copy>(count: usize, value: T, name: &str) -> Outcome<Vec<T>> {
    let mut memory = Vec::new();
    memory.try_reserve_exact(count).map_err(|_| crate::status::no_memory(name))?;
    memory.resize(count, value);
    Ok(memory)
}

/// A copy of the values, or an error where there is no memory.
pub(crate) fn copied<T: Copy>(values: &[T], name: &str) -> Outcome<Vec<T>> {
    let mut memory = Vec::new();
    memory.try_reserve_exact(values.len()).map_err(|_| crate::status::no_memory(name))?;
    memory.extend_from_slice(values);
    Ok(memory)
}

/// A point or a vector, all of whose coordinates are numbers.
pub(crate) fn vector(of: [f32; 3], name: &str) -> Outcome<Vec3> {
    let vector = Vec3::from_array(of);
    if vector.is_finite() { Ok(vector) } else { wrong(format!("`{name}` is not finite: {of:?}")) }
}

/// Lengths of unit vectors are off by so much at most. More: densities of directions are wrong by as much.
const UNIT: f32 = 1e-3;

pub(crate) fn is_unit(vector: Vec3) -> bool {
    // NaN is none, either.
    (vector.length_squared() - 1.0).abs() <= 2.0 * UNIT
}

/// A unit vector.
pub(crate) fn unit(of: [f32; 3], name: &str) -> Outcome<Vec3> {
    let vector = Vec3::from_array(of);
    if is_unit(vector) { Ok(vector) } else { wrong(format!("`{name}` is not of length 1: {of:?}")) }
}

/// A finite number in a range.
pub(crate) fn within(number: f32, least: f32, most: f32, name: &str) -> Outcome<f32> {
    if number >= least && number <= most {
        return Ok(number);
    }
    wrong(format!("`{name}` is {number}, outside [{least}, {most}]"))
}

/// Light or a coefficient: finite, and not negative.
pub(crate) fn light(of: [f32; 3], name: &str) -> Outcome<Spectrum> {
    if Spectrum(of).is_valid() {
        Ok(Spectrum(of))
    } else {
        wrong(format!("`{name}` is negative or not finite: {of:?}"))
    }
}

/// A box with a finite size.
pub(crate) fn bounds(of: &crate::host::fogbow_box, name: &str) -> Outcome<Bounds> {
    let (min, max) = (vector(of.lower, name)?, vector(of.upper, name)?);
    let is_box = max.cmpgt(min).all() && (max - min).is_finite();
    if is_box { Ok(Bounds { min, max }) } else { wrong(format!("`{name}`: upper is not above lower, {of:?}")) }
}
