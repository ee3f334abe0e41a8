//! The core in WebAssembly: one export per question that `run.mjs` asks. No imports.

#![no_std]

use fogbow_kernel::SECTIONS;

// SAFETY of the names below: no other symbol of this module is called so.

/// How many sections there are.
#[unsafe(no_mangle)]
pub extern "C" fn section_count() -> usize {
    SECTIONS.len()
}

/// Where in memory a section's name lies (UTF-8).
#[unsafe(no_mangle)]
pub extern "C" fn section_name(index: usize) -> *const u8 {
    SECTIONS[index].name.as_ptr()
}

/// How many bytes a section's name has.
#[unsafe(no_mangle)]
pub extern "C" fn section_name_length(index: usize) -> usize {
    SECTIONS[index].name.len()
}

/// Computes a section: the folded bits of all its results.
#[unsafe(no_mangle)]
pub extern "C" fn section_bits(index: usize) -> u64 {
    SECTIONS[index].bits()
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(target_arch = "wasm32")]
    core::arch::wasm32::unreachable();
    #[cfg(not(target_arch = "wasm32"))]
    loop {}
}
