//! The product of two matrices.

/// Adds the matrix product `left * right` to `sum`. All are stored row by row: `sum` is rows x `columns`, `left` is
/// rows x `inner`, `right` is `inner` x `columns`. Runs on the calling thread, so that the order of sums depends on the
/// sizes and the processor alone.
///
/// Panics if the lengths do not fit.
pub(crate) fn add_product(sum: &mut [f32], left: &[f32], right: &[f32], inner: usize, columns: usize) {
    assert!(inner > 0 && columns > 0, "a product of matrices without rows or columns");
    let rows = sum.len() / columns;
    assert_eq!(sum.len(), rows * columns, "the sum is not rows x columns");
    assert_eq!(left.len(), rows * inner, "the left factor is not rows x inner");
    assert_eq!(right.len(), inner * columns, "the right factor is not inner x columns");
    // `gemm` takes (pointer, column stride, row stride); a Vec's length always fits an isize.
    let (row_of_sum, row_of_left) = (columns as isize, inner as isize);
    // SAFETY: by the three asserts every index row * row stride + column lies inside its slice; `sum` is borrowed
    // mutably and so overlaps neither factor.
    #[allow(unsafe_code)] // `gemm` has no safe entry
    unsafe {
        gemm::gemm(
            rows,
            columns,
            inner,
            sum.as_mut_ptr(),
            1,
            row_of_sum,
            true,
            left.as_ptr(),
            1,
            row_of_left,
            right.as_ptr(),
            1,
            row_of_sum,
            1.0,
            1.0,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_by_hand() {
        let mut sum = [1.0, 0.0, 0.0, 1.0];
        add_product(&mut sum, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0], &[1.0, 0.0, 0.0, 1.0, 2.0, 2.0], 3, 2);
        assert_eq!(sum, [8.0, 8.0, 16.0, 18.0]);
    }

    #[test]
    #[should_panic(expected = "left factor")]
    fn lengths_that_do_not_fit_are_refused() {
        add_product(&mut [0.0; 4], &[0.0; 5], &[0.0; 6], 3, 2);
    }
}
