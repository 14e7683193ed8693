//! A hash map for geometry: millions of small keys of plain bits.
//!
//! The standard map resists crafted keys at several times the cost. This one is seeded at random
//! per process too, so that no file can be made to collide, but mixes with one wide multiplication
//! per word instead of a cipher's rounds.

use std::{
    collections::HashMap,
    hash::{BuildHasher, Hasher, RandomState},
    sync::OnceLock,
};

/// A map from plain bits.
pub(super) type BitMap<K, V> = HashMap<K, V, Seeded>;

/// Makes [`Mixer`]s.
#[derive(Clone, Copy)]
pub(super) struct Seeded(u64);

impl Default for Seeded {
    fn default() -> Self {
        static SEED: OnceLock<u64> = OnceLock::new();
        Self(*SEED.get_or_init(|| RandomState::new().hash_one(0u8)))
    }
}

impl BuildHasher for Seeded {
    type Hasher = Mixer;

    fn build_hasher(&self) -> Mixer {
        Mixer { state: self.0, seed: self.0 | 1 }
    }
}

/// Multiplies each word in, both halves of the product folded.
pub(super) struct Mixer {
    state: u64,
    seed: u64,
}

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u64(&mut self, word: u64) {
        let product = u128::from(self.state ^ word) * u128::from(self.seed ^ 0x9e37_79b9_7f4a_7c15);
        self.state = (product as u64) ^ ((product >> 64) as u64).rotate_left(23) ^ self.seed;
    }

    fn finish(&self) -> u64 {
        self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_spread() {
        let seeded = Seeded::default();
        let mut buckets = [0u32; 256];
        for x in 0..64u32 {
            for y in 0..64u32 {
                buckets[seeded.hash_one([x, y, 0]) as usize >> 3 & 255] += 1;
            }
        }
        let (low, high) = (buckets.iter().min().unwrap(), buckets.iter().max().unwrap());
        assert!(*high < 60, "16 are expected in each, {low} to {high} are there");
    }
}
