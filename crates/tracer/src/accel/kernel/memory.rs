//! Wishes about memory: that it be near soon, that it lie in large pages. What is computed does not depend on them.
#![allow(unsafe_code, reason = "a processor's instruction and a call of the system")]

/// Bytes that the processor fetches at once.
const LINE: usize = 64;

/// Asks for the value at `place`.
#[inline(always)]
pub(crate) fn prefetch<T>(place: &T) {
    let start = std::ptr::from_ref(place).cast::<u8>();
    for line in 0..size_of::<T>().div_ceil(LINE) {
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

/// The same values in memory for which the system has been asked for huge pages, where it knows such: rays jump about in
/// more memory than a processor keeps the addresses of small pages for.
pub(crate) fn on_huge_pages<T: Copy>(values: Vec<T>) -> Vec<T> {
    let mut moved = Vec::with_capacity(values.len());
    ask_for_huge_pages(moved.spare_capacity_mut());
    moved.extend_from_slice(&values);
    moved
}

/// Changes nothing but how memory is mapped; a refusal costs only time.
#[cfg(target_os = "linux")]
fn ask_for_huge_pages<T>(memory: &mut [std::mem::MaybeUninit<T>]) {
    /// The system takes whole pages alone. On processors with larger ones it refuses.
    const PAGE: usize = 4096;
    let start = memory.as_mut_ptr().cast::<libc::c_void>();
    let skipped = start.align_offset(PAGE);
    let length = size_of_val(memory).saturating_sub(skipped) / PAGE * PAGE;
    if length > 0 {
        // SAFETY: whole pages within a piece of our own memory; the advice leaves what they hold as it is.
        unsafe { libc::madvise(start.wrapping_byte_add(skipped), length, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_huge_pages<T>(_: &mut [std::mem::MaybeUninit<T>]) {}
