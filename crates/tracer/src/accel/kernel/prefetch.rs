//! Asks for memory that will be needed soon. What is computed does not depend on it.
#![allow(unsafe_code, reason = "a processor's instruction")]

/// Bytes that the processor fetches at once.
const LINE: usize = 64;

/// Asks for the value at `place`, or its first 256 bytes.
#[inline(always)]
pub(crate) fn prefetch<T>(place: &T) {
    let start = std::ptr::from_ref(place).cast::<u8>();
    for line in 0..size_of::<T>().div_ceil(LINE).min(4) {
        prefetch_line(start.wrapping_add(LINE * line));
    }
}

/// Asks for the line that holds `address`, which may be any: nothing is read that a program could see.
#[inline(always)]
pub(crate) fn prefetch_line(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 has the instruction, and it does not fault whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast::<i8>()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}
