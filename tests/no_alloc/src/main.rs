//! The core at work in a program without the standard library and without an allocator.
//!
//! It prints the bits of every section of `fogbow-kernel`. That it links at all is the proof: no
//! global allocator exists, so any use of `alloc` is an error, and any use of `std` a second panic
//! handler.

#![no_std]
#![no_main]

use core::ffi::{c_char, c_int, c_void};
use core::fmt::Write;

#[link(name = "c")]
unsafe extern "C" {
    fn write(file: c_int, bytes: *const c_void, count: usize) -> isize;
    safe fn abort() -> !;
}

/// Standard output, unbuffered.
struct Output;

impl Write for Output {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let mut rest = text.as_bytes();
        while !rest.is_empty() {
            // SAFETY: the pointer and the length are those of one live slice.
            let written = unsafe { write(1, rest.as_ptr().cast(), rest.len()) };
            let written = usize::try_from(written).map_err(|_| core::fmt::Error)?;
            rest = rest.get(written..).ok_or(core::fmt::Error)?;
        }
        Ok(())
    }
}

/// Entry point, called by the C start-up code. Returns 0 once everything is printed.
// SAFETY: no other symbol of this program is called `main`.
#[unsafe(no_mangle)]
pub extern "C" fn main(_: c_int, _: *const *const c_char) -> c_int {
    c_int::from(fogbow_kernel::report(&mut Output).is_err())
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    abort()
}
