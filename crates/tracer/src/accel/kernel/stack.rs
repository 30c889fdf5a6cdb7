//! The stack of nodes and blocks that a ray has yet to visit.
#![allow(unsafe_code, reason = "clearing the array would cost a tenth of a short ray")]

use std::mem::MaybeUninit;

use super::test_ray::WIDENED;
use crate::accel::wide::{Child, WIDTH};

/// Children still to be visited, with the bits of the distance at which the ray enters them. Fixed arrays, and a vector
/// for entries beyond them.
pub(crate) struct Stack {
    /// The first `len` entries of both arrays have been written.
    enters: [MaybeUninit<u32>; FIXED],
    children: [MaybeUninit<Child>; FIXED],
    len: usize,
    spilled: Vec<(u32, Child)>,
}

/// Small in tests, so that tests reach the vector.
const FIXED: usize = if cfg!(test) { 12 } else { 128 };

impl Stack {
    #[inline(always)]
    pub(crate) fn new() -> Self {
        Self {
            enters: [const { MaybeUninit::uninit() }; FIXED],
            children: [const { MaybeUninit::uninit() }; FIXED],
            len: 0,
            spilled: Vec::new(),
        }
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.len = 0;
        self.spilled.clear();
    }

    #[inline(always)]
    pub(crate) fn push(&mut self, enter_bits: u32, child: Child) {
        if self.len < FIXED {
            self.enters[self.len].write(enter_bits);
            self.children[self.len].write(child);
            self.len += 1;
        } else {
            self.spill(enter_bits, child);
        }
    }

    /// The next eight free entries of the arrays, to be written before [`Self::commit`]; `None` if fewer are free.
    #[inline(always)]
    pub(super) fn free_slots(&mut self) -> Option<FreeSlots<'_>> {
        let enters = self.enters.get_mut(self.len..)?.first_chunk_mut()?;
        let children = self.children.get_mut(self.len..)?.first_chunk_mut()?;
        Some(FreeSlots { enters, children })
    }

    /// Adds the first `count` entries (at most eight) of [`Self::free_slots`] to the stack.
    ///
    /// # Safety
    ///
    /// [`Self::free_slots`] has returned slots, and the first `count` of them have been written since the last push.
    #[inline(always)]
    pub(super) unsafe fn commit(&mut self, count: usize) {
        self.len += count;
    }

    #[cold]
    #[inline(never)]
    fn spill(&mut self, enter_bits: u32, child: Child) {
        self.spilled.push((enter_bits, child));
    }

    #[cold]
    #[inline(never)]
    fn unspill(&mut self) -> Option<(u32, Child)> {
        self.spilled.pop()
    }

    /// The last child in the arrays, to prefetch its memory.
    #[inline(always)]
    pub(crate) fn top(&self) -> Option<Child> {
        let last = self.len.checked_sub(1)?;
        // SAFETY: every entry below `len` has been written, as shown in `pop`.
        Some(unsafe { self.children[last].assume_init() })
    }

    /// Pops children until one is found that the ray enters before `limit`.
    #[inline(always)]
    pub(crate) fn pop(&mut self, limit: f32) -> Option<Child> {
        loop {
            let (enter_bits, child) = if self.len == FIXED && !self.spilled.is_empty() {
                self.unspill()?
            } else {
                self.len = self.len.checked_sub(1)?;
                // SAFETY: `len` grows only after the entries it then includes have been written: one in `push`, `count`
                // before `commit`. So every entry below the old `len` has been written.
                unsafe { (self.enters[self.len].assume_init(), self.children[self.len].assume_init()) }
            };
            if f32::from_bits(enter_bits) <= limit * WIDENED {
                return Some(child);
            }
        }
    }
}

/// The next eight free entries of a stack.
pub(super) struct FreeSlots<'s> {
    pub(super) enters: &'s mut [MaybeUninit<u32>; WIDTH],
    pub(super) children: &'s mut [MaybeUninit<Child>; WIDTH],
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_in_is_the_first_out_however_many() {
        let mut stack = Stack::new();
        let count = 3 * FIXED as u32;
        for k in 0..count {
            stack.push((k as f32).to_bits(), Child(k));
        }
        for k in (0..count).rev() {
            assert_eq!(stack.pop(f32::INFINITY), Some(Child(k)));
        }
        assert_eq!(stack.pop(f32::INFINITY), None);
        stack.push(2.0_f32.to_bits(), Child(7));
        stack.push(5.0_f32.to_bits(), Child(8));
        assert_eq!(stack.pop(3.0), Some(Child(7)));
    }
}
