//! A short number for a long text: 64 bits of FNV-1a (Fowler, Noll and Vo).
//!
//! It is there against mistakes: two texts that differ by accident have the same number once in 2^64 times. Against somebody who
//! wants them to be the same it is no help.

use std::fmt;

/// A digest that takes in bytes as they come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Digest(u64);

impl fmt::Display for Digest {
    /// As in files: `fnv1a64-` and 16 hexadecimal digits.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "fnv1a64-{:016x}", self.0)
    }
}

impl Digest {
    /// The digest of a text.
    pub(crate) fn of(text: &str) -> Self {
        let mut digest = Self::new();
        digest.write(text.as_bytes());
        digest
    }

    /// The digest of nothing.
    pub(crate) const fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    /// Takes in the bytes that follow.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// The number for all bytes so far.
    pub(crate) const fn number(self) -> u64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::Digest;

    /// The test vectors of the authors of FNV.
    #[test]
    fn published_values() {
        for (text, expected) in [
            ("", 0xcbf2_9ce4_8422_2325),
            ("a", 0xaf63_dc4c_8601_ec8c),
            ("foobar", 0x8594_4171_f739_67e8),
        ] {
            assert_eq!(Digest::of(text).number(), expected, "{text}");
        }
    }
}
