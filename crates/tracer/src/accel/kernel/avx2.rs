//! The kernel for processors with AVX2, FMA and the bit instructions of the same generation. [`Portable`] shows the
//! formulas for a single lane.

use std::arch::x86_64::*;

use super::{Block, BoxRay, Boxes, Kernel, Node, Portable, Stack, TriangleRay, Triangles, WIDENED, WIDTH};

/// A proof that this processor supports the instructions: only [`Self::detect`] creates it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// `Some` if the processor supports the instructions.
    pub(crate) fn detect() -> Option<Self> {
        let vectors = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        let bits = is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2");
        let counts = is_x86_feature_detected!("lzcnt") && is_x86_feature_detected!("popcnt");
        (vectors && bits && counts).then_some(Self(()))
    }

    /// Runs `work`; what is inlined into it is compiled for AVX2.
    #[inline]
    pub(crate) fn run<R>(self, work: impl FnOnce(Self) -> R) -> R {
        // SAFETY: `self` proves that the processor supports the instructions.
        unsafe { compiled_for_avx2(self, work) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
fn compiled_for_avx2<R>(kernel: Avx2, work: impl FnOnce(Avx2) -> R) -> R {
    work(kernel)
}

impl Kernel for Avx2 {
    type Lanes = __m256;

    #[inline(always)]
    fn boxes(self, node: &Node, ray: &BoxRay, limit: f32) -> Boxes<Self::Lanes> {
        // SAFETY: `self` proves that the processor supports the instructions.
        unsafe { boxes(node, ray, limit) }
    }

    #[inline(always)]
    fn push_sorted(self, node: &Node, boxes: &Boxes<Self::Lanes>, stack: &mut Stack) {
        // SAFETY: `self` proves that the processor supports the instructions.
        unsafe { push_sorted(node, boxes, stack) }
    }

    #[inline(always)]
    fn triangles(self, block: &Block, ray: &TriangleRay, limit: f32) -> Triangles {
        // SAFETY: `self` proves that the processor supports the instructions.
        unsafe { watertight(block, ray, limit) }
    }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn load(values: &[f32; WIDTH]) -> __m256 {
    // SAFETY: the reference is to eight floats.
    unsafe { _mm256_loadu_ps(values.as_ptr()) }
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn store(lanes: __m256) -> [f32; WIDTH] {
    let mut values = [0.0; WIDTH];
    // SAFETY: the reference is to eight floats.
    unsafe { _mm256_storeu_ps(values.as_mut_ptr(), lanes) };
    values
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn boxes(node: &Node, ray: &BoxRay, limit: f32) -> Boxes<__m256> {
    let (mut enter, mut leave) = (_mm256_setzero_ps(), _mm256_set1_ps(limit));
    for axis in 0..3 {
        // `& 1` lets the compiler see that both indices are in range.
        let (nearer, farther) = (ray.near[axis] & 1, 1 ^ (ray.near[axis] & 1));
        let inverse = _mm256_set1_ps(ray.inverse[axis]);
        let near_origin = _mm256_set1_ps(ray.near_origin[axis]);
        let far_origin = _mm256_set1_ps(ray.far_origin[axis]);
        let near = _mm256_fmsub_ps(load(&node.bounds[nearer][axis]), inverse, near_origin);
        let far = _mm256_fmsub_ps(load(&node.bounds[farther][axis]), inverse, far_origin);
        enter = _mm256_max_ps(near, enter);
        leave = _mm256_min_ps(far, leave);
    }
    let widened = _mm256_mul_ps(leave, _mm256_set1_ps(WIDENED));
    let met = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, widened)) as u32;
    Boxes { met: met & node.filled, enter }
}

/// Sorts all eight lanes, stores all of them, then commits those that were met: no branch depends on their number.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn push_sorted(node: &Node, boxes: &Boxes<__m256>, stack: &mut Stack) {
    let keys = sorted(boxes.met, boxes.enter);
    let Some(slots) = stack.free_slots() else { return Portable.push_sorted(node, &boxes.to_array(), stack) };
    // SAFETY: children and distances are 32-bit numbers, and each reference is to eight of them.
    unsafe {
        let children = _mm256_loadu_si256(node.children.as_ptr().cast());
        _mm256_storeu_si256(slots.children.as_mut_ptr().cast(), _mm256_permutevar8x32_epi32(children, keys));
        _mm256_storeu_si256(slots.enters.as_mut_ptr().cast(), _mm256_andnot_si256(_mm256_set1_epi32(7), keys));
    }
    // SAFETY: `free_slots` returned slots, and all eight have been written.
    unsafe { stack.commit(boxes.met.count_ones() as usize) };
}

/// The keys of the boxes met, the farthest first, followed by those of the others. A bitonic sorting network (Batcher)
/// of six compare-and-exchange rounds.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn sorted(met: u32, enter: __m256) -> __m256i {
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let keys = _mm256_or_si256(_mm256_andnot_si256(_mm256_set1_epi32(7), _mm256_castps_si256(enter)), lanes);
    let one_bit = _mm256_sllv_epi32(_mm256_set1_epi32(1), lanes);
    let wanted = _mm256_and_si256(_mm256_set1_epi32(met as i32), one_bit);
    // Boxes not met get the key -1, which is below every distance.
    let keys = _mm256_or_si256(keys, _mm256_cmpeq_epi32(wanted, _mm256_setzero_si256()));
    // The bits select the lanes that keep the smaller key of a pair.
    let keys = exchange::<0b0110_0110>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange::<0b0011_1100>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange::<0b0101_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange::<0b1111_0000>(keys, _mm256_permute2x128_si256::<1>(keys, keys));
    let keys = exchange::<0b1100_1100>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    exchange::<0b1010_1010>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys))
}

impl Boxes<__m256> {
    fn to_array(&self) -> Boxes<[f32; WIDTH]> {
        // SAFETY: only `Avx2`, the proof of support, creates boxes of this type.
        Boxes { met: self.met, enter: unsafe { store(self.enter) } }
    }
}

/// In each lane the larger of two keys, or the smaller one if bit `LESSER` of the lane is set.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn exchange<const LESSER: i32>(keys: __m256i, partners: __m256i) -> __m256i {
    let (least, most) = (_mm256_min_epi32(keys, partners), _mm256_max_epi32(keys, partners));
    _mm256_blend_epi32::<LESSER>(most, least)
}

/// Three-dimensional vectors, one per lane.
type Vectors = [__m256; 3];

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn watertight(block: &Block, ray: &TriangleRay, limit: f32) -> Triangles {
    let [a, b, c] = [sheared(&block.corners[0], ray), sheared(&block.corners[1], ray), sheared(&block.corners[2], ray)];
    let (u, v, w) = (difference(c, b), difference(a, c), difference(b, a));
    let sum = _mm256_add_ps(_mm256_add_ps(u, v), w);
    let inside = inside([u, v, w], sum);
    if inside == 0 {
        return NONE;
    }
    let z = _mm256_fmadd_ps(w, c[2], _mm256_fmadd_ps(v, b[2], _mm256_mul_ps(u, a[2])));
    let distance = _mm256_div_ps(_mm256_mul_ps(z, _mm256_set1_ps(ray.distance_from_z)), sum);
    found(inside, distance, limit, [u, v, w])
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn sheared(corner: &[[f32; WIDTH]; 3], ray: &TriangleRay) -> Vectors {
    let [axis_x, axis_y, axis_z] = ray.axes;
    let z = _mm256_sub_ps(load(&corner[axis_z]), _mm256_set1_ps(ray.origin[axis_z]));
    let x = _mm256_sub_ps(load(&corner[axis_x]), _mm256_set1_ps(ray.origin[axis_x]));
    let y = _mm256_sub_ps(load(&corner[axis_y]), _mm256_set1_ps(ray.origin[axis_y]));
    [_mm256_fnmadd_ps(_mm256_set1_ps(ray.shear[0]), z, x), _mm256_fnmadd_ps(_mm256_set1_ps(ray.shear[1]), z, y), z]
}

/// See `difference` of [`Portable`].
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn difference(p: Vectors, q: Vectors) -> __m256 {
    let product = _mm256_mul_ps(p[1], q[0]);
    let lost = _mm256_fnmadd_ps(p[1], q[0], product);
    _mm256_add_ps(_mm256_fmsub_ps(p[0], q[1], product), lost)
}

const NONE: Triangles = Triangles { hit: 0, distance: [0.0; WIDTH], weights: [[0.0; WIDTH]; 3] };

/// The lanes in which all weights have the same sign and `sum` is not zero.
#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn inside([u, v, w]: Vectors, sum: __m256) -> u32 {
    let zero = _mm256_setzero_ps();
    let least = _mm256_min_ps(_mm256_min_ps(u, v), w);
    let most = _mm256_max_ps(_mm256_max_ps(u, v), w);
    let above = _mm256_cmp_ps::<_CMP_GE_OQ>(least, zero);
    let below = _mm256_cmp_ps::<_CMP_LE_OQ>(most, zero);
    let flat = _mm256_cmp_ps::<_CMP_EQ_OQ>(sum, zero);
    _mm256_movemask_ps(_mm256_andnot_ps(flat, _mm256_or_ps(above, below))) as u32
}

#[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
#[inline]
fn found(inside: u32, distance: __m256, limit: f32, [u, v, w]: Vectors) -> Triangles {
    let beyond_zero = _mm256_cmp_ps::<_CMP_GT_OQ>(distance, _mm256_setzero_ps());
    let before_limit = _mm256_cmp_ps::<_CMP_LE_OQ>(distance, _mm256_set1_ps(limit));
    let in_reach = _mm256_movemask_ps(_mm256_and_ps(beyond_zero, before_limit)) as u32;
    Triangles { hit: inside & in_reach, distance: store(distance), weights: [store(u), store(v), store(w)] }
}
