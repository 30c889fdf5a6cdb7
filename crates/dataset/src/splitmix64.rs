//! SplitMix64 (Steele et al., "Fast splittable pseudorandom number generators", OOPSLA 2014) as a function of seed and
//! index, so that every random number can be computed without those before it.

use mateval_files::untrusted::sha256_of_bytes;

/// The difference between two successive states of the generator.
pub const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

/// The number at `index`, counted from 0, of the sequence that starts from `seed`.
#[inline]
pub fn number(seed: u64, index: u64) -> u64 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(INCREMENT));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The seed that `text` names: the first 64 bits of its SHA-256.
pub fn seed_of(text: &str) -> u64 {
    u64::from_str_radix(&sha256_of_bytes(text.as_bytes())[..16], 16).expect("a hash is hexadecimal")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers from seed 1234567 as the reference implementation gives them (Vigna's splitmix64.c; Rosetta
    /// Code, "Pseudo-random numbers/Splitmix64").
    #[test]
    fn equals_the_reference_implementation() {
        let expected = [6457827717110365317, 3203168211198807973, 9817491932198370423];
        assert_eq!([0, 1, 2].map(|index| number(1_234_567, index)), expected);
        assert_ne!(number(1_234_568, 0), expected[0]);
    }

    /// FIPS 180-2's example.
    #[test]
    fn seeds_are_the_start_of_the_hash() {
        assert_eq!(seed_of("abc"), 0xba78_16bf_8f01_cfea);
        assert_ne!(seed_of("abd"), seed_of("abc"));
    }
}
