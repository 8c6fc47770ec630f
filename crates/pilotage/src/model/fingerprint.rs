//! A short name for all that a policy depends on, so that a policy knows the problem that it was made for.

mod canonical;

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use super::Model;
use crate::digest::Digest;
pub(crate) use canonical::{Canonical, Fields};

/// Version of the encoding. Another version says nothing about whether two models are the same.
const VERSION: u32 = 1;

/// The digest of a model's fields, written `v1-` and 16 hexadecimal digits.
///
/// The digest is 64 bits of FNV-1a, over these bytes:
///
/// - a number is its IEEE 754 bits, least significant byte first, and -0 is 0; whole numbers have 64 bits;
/// - a text is its length in bytes and its UTF-8; a list its length and its items; a matrix its rows, its columns and its entries, row
///   by row; what may be missing is a byte 0, or 1 and the value; one of several kinds is the name of the kind;
/// - a table is its fields, each a name and a value, and an empty name at the end.
///
/// A field that says nothing (no events, an episode that goes on, a region that is everywhere) is left out. So is any field that is added
/// later, where it has the value that models had before there was such a field: that leaves the fingerprints of all
/// models that do not use it, and policies that were made for them still fit. A default that changes its *meaning* is a new version.
///
/// Name and description of a model do not count, nor does what is true of its world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Fingerprint {
    version: u32,
    digest: u64,
}

impl Fingerprint {
    /// The fingerprint of a thing that has canonical bytes.
    pub(crate) fn of(fields: &impl Canonical) -> Self {
        let mut digest = Digest::new();
        fields.write(&mut digest);
        Self {
            version: VERSION,
            digest: digest.number(),
        }
    }

    /// Whether it can be compared with another: both are of the same version.
    pub fn comparable(&self, other: &Self) -> bool {
        self.version == other.version
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "v{}-{:016x}", self.version, self.digest)
    }
}

/// A text that is no fingerprint.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "a fingerprint is `v`, a version, `-` and 16 hexadecimal digits, such as v1-0123456789abcdef"
)]
pub struct NotAFingerprint;

impl FromStr for Fingerprint {
    type Err = NotAFingerprint;

    fn from_str(text: &str) -> Result<Self, NotAFingerprint> {
        let parsed = || {
            let (version, digest) = text.strip_prefix('v')?.split_once('-')?;
            Some(Self {
                version: version.parse().ok()?,
                digest: u64::from_str_radix(digest, 16).ok()?,
            })
        };
        // What is read is written in one way only.
        parsed()
            .filter(|fingerprint| fingerprint.to_string() == text)
            .ok_or(NotAFingerprint)
    }
}

impl Serialize for Fingerprint {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Fingerprint {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(de::Error::custom)
    }
}

impl Model {
    /// Changes when anything changes that a policy depends on. What is true of the world is no such thing.
    pub fn fingerprint(&self) -> Fingerprint {
        Fingerprint::of(self)
    }
}
