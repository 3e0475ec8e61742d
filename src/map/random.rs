//! Pseudorandom numbers that are equal on every machine: SplitMix64 (Steele, Lea, Flood 2014).

/// A stream of numbers, determined by its seed.
pub struct Random(u64);

impl Random {
    /// Begins the stream of `seed`.
    pub fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// Returns 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    /// Returns a number below `bound`, which must not be 0. The bias is below `bound / 2^64`.
    pub fn below(&mut self, bound: usize) -> usize {
        ((u128::from(self.bits()) * bound as u128) >> 64) as usize
    }

    /// Returns a multiple of 2^-53 from 0 (included) to 1 (excluded).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * 2f64.powi(-53)
    }

    /// Moves `count` random entries to the front. All choices and orders are equally likely.
    pub fn draw<T>(&mut self, list: &mut [T], count: usize) {
        for i in 0..count.min(list.len()) {
            let from = i + self.below(list.len() - i);
            list.swap(i, from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_stream() {
        let mut random = Random::new(1_234_567);
        let stream: [u64; 3] = std::array::from_fn(|_| random.bits());
        assert_eq!(stream, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    #[test]
    fn draws_are_even_and_repeat() {
        let mut counts = [0; 5];
        for seed in 0..5000 {
            let mut list = [0, 1, 2, 3, 4];
            Random::new(seed).draw(&mut list, 2);
            counts[list[0]] += 1;
            counts[list[1]] += 1;
            let mut again = [0, 1, 2, 3, 4];
            Random::new(seed).draw(&mut again, 2);
            assert_eq!(list, again);
        }
        assert!(counts.iter().all(|count| (1850..2150).contains(count)), "{counts:?}");
    }
}
