//! What a ray has still to visit.
#![allow(unsafe_code, reason = "clearing the array would cost a tenth of a short ray")]

use std::mem::MaybeUninit;

use super::WIDENED;
use crate::accel::wide::Child;

/// Children still to be visited and the bits of the distance where the ray enters them: a fixed array, and a vector for
/// what it cannot hold.
pub(in crate::accel) struct Stack {
    /// The first `len` entries have been written.
    fixed: [MaybeUninit<(u32, Child)>; FIXED],
    len: usize,
    spilled: Vec<(u32, Child)>,
}

const FIXED: usize = 96;

impl Stack {
    #[inline(always)]
    pub(in crate::accel) fn new() -> Self {
        Self { fixed: [const { MaybeUninit::uninit() }; FIXED], len: 0, spilled: Vec::new() }
    }

    #[inline(always)]
    pub(in crate::accel) fn push(&mut self, enter_bits: u32, child: Child) {
        if let Some(slot) = self.fixed.get_mut(self.len) {
            slot.write((enter_bits, child));
            self.len += 1;
        } else {
            self.spill(enter_bits, child);
        }
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

    /// The child pushed last of those that the ray enters before `limit`.
    #[inline(always)]
    pub(in crate::accel) fn pop(&mut self, limit: f32) -> Option<Child> {
        loop {
            let (enter_bits, child) = if self.len == FIXED && !self.spilled.is_empty() {
                self.unspill()?
            } else {
                self.len = self.len.checked_sub(1)?;
                // SAFETY: `len` grows only where `push` writes the entry at its old value, so every entry below the old
                // `len` has been written.
                unsafe { self.fixed[self.len].assume_init() }
            };
            if f32::from_bits(enter_bits) <= limit * WIDENED {
                return Some(child);
            }
        }
    }
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
