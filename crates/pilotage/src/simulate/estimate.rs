//! Means with their standard errors.

use serde::{Deserialize, Serialize};

/// A mean with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Mean over episodes.
    pub mean: f64,
    /// Standard error of the mean; 0 for a single episode.
    pub stderr: f64,
}

impl Estimate {
    /// Mean and standard error of a sample, summed in its order.
    pub fn of(sample: impl ExactSizeIterator<Item = f64> + Clone) -> Self {
        let count = sample.len() as f64;
        let mean = sample.clone().sum::<f64>() / count;
        let squares: f64 = sample.map(|value| (value - mean) * (value - mean)).sum();
        Self::from_squares(mean, squares, count)
    }

    /// From the sum of squared deviations from the mean of so many numbers.
    fn from_squares(mean: f64, squares: f64, count: f64) -> Self {
        Self {
            mean,
            stderr: if count > 1.0 {
                (squares / (count - 1.0) / count).sqrt()
            } else {
                0.0
            },
        }
    }
}

/// What is kept of numbers that come one after the other, however many they are.
///
/// B. P. Welford, "Note on a method for calculating corrected sums of squares and products", Technometrics 4, 1962.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Moments {
    count: u64,
    sum: f64,
    mean: f64,
    squares: f64,
}

impl Moments {
    /// Takes in the next number.
    pub(super) fn add(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
    }

    /// Numbers so far.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// Mean and standard error; those of no number are none.
    pub(super) fn estimate(&self) -> Estimate {
        let count = self.count as f64;
        // The plain sum has the digits of `Estimate::of`.
        Estimate::from_squares(self.sum / count, self.squares, count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_whole_sample() {
        let samples: [Vec<f64>; 4] = [
            vec![3.5],
            vec![1e9, 1e9 + 1.0, 1e9 + 2.0],
            (0..10_000).map(|k| f64::from(k * 7919 % 104_729)).collect(),
            vec![-2.25; 1000],
        ];
        for sample in samples {
            let mut moments = Moments::default();
            sample.iter().for_each(|value| moments.add(*value));
            let (streamed, whole) = (moments.estimate(), Estimate::of(sample.iter().copied()));
            assert_eq!(moments.count(), sample.len() as u64);
            assert_eq!(streamed.mean.to_bits(), whole.mean.to_bits());
            assert!((streamed.stderr - whole.stderr).abs() <= 1e-12 * whole.stderr);
        }
    }
}
