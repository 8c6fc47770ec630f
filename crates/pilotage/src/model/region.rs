//! Axis-aligned regions of the state space.

use serde::{Deserialize, Serialize};

/// A half-open interval `[low, high)`, so that cells side by side share no point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// Lower end, included; may be `-inf`.
    #[serde(with = "maybe_infinite")]
    pub low: f64,
    /// Upper end, excluded; may be `inf`.
    #[serde(with = "maybe_infinite")]
    pub high: f64,
}

impl Interval {
    /// The whole line.
    pub const ALL: Self = Self {
        low: f64::NEG_INFINITY,
        high: f64::INFINITY,
    };

    /// `[low, high)`.
    pub const fn new(low: f64, high: f64) -> Self {
        Self { low, high }
    }

    /// Whether `x` lies in the interval.
    pub fn contains(&self, x: f64) -> bool {
        self.low <= x && x < self.high
    }

    /// The point of the interval that is nearest to `x`.
    pub fn clamp(&self, x: f64) -> f64 {
        x.min(self.high.next_down()).max(self.low)
    }

    /// `high - low`.
    pub fn width(&self) -> f64 {
        self.high - self.low
    }
}

/// A box given by intervals for some of the state variables; the others are free.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Region {
    /// Pairs of state variable and interval, each variable at most once, in rising order.
    pub sides: Vec<(usize, Interval)>,
}

impl Region {
    /// The region that holds every state.
    pub fn everywhere() -> Self {
        Self::default()
    }

    /// A box over the given variables.
    pub fn new(mut sides: Vec<(usize, Interval)>) -> Self {
        sides.sort_by_key(|&(variable, _)| variable);
        Self { sides }
    }

    /// Whether the state lies in the region.
    pub fn contains(&self, state: &[f64]) -> bool {
        self.sides
            .iter()
            .all(|&(variable, interval)| interval.contains(state[variable]))
    }

    /// Its interval along a variable.
    pub fn side(&self, variable: usize) -> Interval {
        let mut sides = self.sides.iter();
        let side = sides.find(|(known, _)| *known == variable);
        side.map_or(Interval::ALL, |(_, interval)| *interval)
    }

    /// The same region with another interval along a variable.
    fn with_side(&self, variable: usize, interval: Interval) -> Self {
        let others = self.sides.iter().filter(|(known, _)| *known != variable);
        Self::new(others.copied().chain([(variable, interval)]).collect())
    }

    /// What is left of it without another region, as boxes that do not overlap.
    pub fn without(&self, other: &Self) -> Vec<Self> {
        let meets = other.sides.iter().all(|&(variable, side)| {
            let own = self.side(variable);
            own.low < side.high && side.low < own.high
        });
        if !meets {
            return vec![self.clone()];
        }
        let mut rest = Vec::new();
        let mut core = self.clone();
        for &(variable, side) in &other.sides {
            let own = core.side(variable);
            if own.low < side.low {
                rest.push(core.with_side(variable, Interval::new(own.low, side.low)));
            }
            if side.high < own.high {
                rest.push(core.with_side(variable, Interval::new(side.high, own.high)));
            }
            let low = own.low.max(side.low);
            core = core.with_side(variable, Interval::new(low, own.high.min(side.high)));
        }
        rest
    }
}

/// JSON has no infinity: it is written as text.
mod maybe_infinite {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Number {
        Finite(f64),
        Infinite(Infinite),
    }

    #[derive(Serialize, Deserialize)]
    enum Infinite {
        #[serde(rename = "inf")]
        Positive,
        #[serde(rename = "-inf")]
        Negative,
    }

    pub(super) fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        let number = if value.is_finite() {
            Number::Finite(*value)
        } else {
            Number::Infinite(if *value > 0.0 {
                Infinite::Positive
            } else {
                Infinite::Negative
            })
        };
        number.serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(match Number::deserialize(deserializer)? {
            Number::Finite(value) => value,
            Number::Infinite(Infinite::Positive) => f64::INFINITY,
            Number::Infinite(Infinite::Negative) => f64::NEG_INFINITY,
        })
    }
}
