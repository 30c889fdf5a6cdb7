//! Hints about memory: prefetching and huge pages. Results do not depend on them.
#![allow(unsafe_code, reason = "a processor's instruction and a call of the system")]

/// Bytes of a cache line.
const LINE: usize = 64;

/// Prefetches the cache lines of the value at `place`.
#[inline(always)]
pub(crate) fn prefetch<T>(place: &T) {
    let start = std::ptr::from_ref(place).cast::<u8>();
    for line in 0..size_of::<T>().div_ceil(LINE) {
        prefetch_line(start.wrapping_add(LINE * line));
    }
}

/// Prefetches the cache line that holds `address`, which may be any address: the program reads nothing from it.
#[inline(always)]
pub(crate) fn prefetch_line(address: *const u8) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: every x86-64 processor has the instruction, and it never faults, whatever the address.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast::<i8>()) };
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = address;
}

/// Copies values to memory for which the system has been asked to use huge pages, where it has them. Rays access more
/// memory at random than the processor can keep small-page addresses for.
pub(crate) fn on_huge_pages<T: Copy>(values: Vec<T>) -> Vec<T> {
    let mut moved = Vec::with_capacity(values.len());
    ask_for_huge_pages(moved.spare_capacity_mut());
    moved.extend_from_slice(&values);
    moved
}

/// The system accepts whole pages only. On processors with larger pages it refuses.
#[cfg(target_os = "linux")]
const PAGE: usize = 4096;

/// Only changes how memory is mapped; a refusal costs nothing but time.
#[cfg(target_os = "linux")]
fn ask_for_huge_pages<T>(memory: &mut [std::mem::MaybeUninit<T>]) {
    let start = memory.as_mut_ptr().cast::<libc::c_void>();
    let skipped = start.align_offset(PAGE);
    let length = size_of_val(memory).saturating_sub(skipped) / PAGE * PAGE;
    if length > 0 {
        // SAFETY: the range is whole pages within our own memory, and the advice does not change their contents.
        unsafe { libc::madvise(start.wrapping_byte_add(skipped), length, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn ask_for_huge_pages<T>(_: &mut [std::mem::MaybeUninit<T>]) {}

/// Asks the system to move `values` to huge pages now, at unchanged addresses. Many textures are smaller than a huge
/// page, so the range extends beyond both ends and neighbouring memory moves too, unnoticed by its owners.
#[cfg(target_os = "linux")]
pub(crate) fn move_to_huge_pages(values: &[u8]) {
    const HUGE_PAGE: usize = 512 * PAGE;
    /// Since Linux 6.1; older ones refuse.
    const MADV_COLLAPSE: libc::c_int = 25;
    let range = values.as_ptr_range();
    let start = range.start.addr() / HUGE_PAGE * HUGE_PAGE;
    let length = range.end.addr().next_multiple_of(HUGE_PAGE) - start;
    for advice in [libc::MADV_HUGEPAGE, MADV_COLLAPSE] {
        // SAFETY: neither advice changes the contents of memory or the permission to access it; for memory that is not
        // mapped the system only refuses.
        unsafe { libc::madvise(std::ptr::without_provenance_mut(start), length, advice) };
    }
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn move_to_huge_pages(_: &[u8]) {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Buffers from one byte to more than a huge page keep their contents, and so do their neighbours.
    #[test]
    fn what_moves_stays_the_same() {
        let filled = |length: usize| (0..length).map(|k| (k % 251) as u8).collect::<Vec<u8>>();
        let lengths = [1, 5000, 700_000, 3_000_000];
        let pieces = lengths.map(filled);
        pieces.iter().for_each(|piece| move_to_huge_pages(piece));
        assert_eq!(pieces, lengths.map(filled));
        assert_eq!(on_huge_pages(filled(3_000_000)), filled(3_000_000));
    }
}
