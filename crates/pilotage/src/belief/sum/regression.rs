//! The linear update of a Gaussian by the regression of what is read on its sigma points, again and again where the posterior is (the
//! iterated posterior linearisation filter: A. Garcia-Fernandez, L. Svensson, M. Morelande and S. Sarkka, 2015). Once is the update of
//! S. Julier and J. Uhlmann (1997), exact for linear sensors.

use smallvec::smallvec;

use super::frame::{Few, Frame, Inner, root, root_into, whiten};
use super::sensor::Sensor;

/// Noise of no variance is taken for this share of the spread of what is read.
const SHARP: f64 = 1e-15;

/// Means that move by less, in standard deviations of the prior, have settled.
const SETTLED: f64 = 1e-3;

/// What is read, as a linear function of the coordinates of a frame: `A z + b`, with noise of covariance `noise`.
struct Line {
    /// `m x r`, row by row.
    a: Few,
    b: Few,
    noise: Few,
}

/// The posterior of a standard normal in the coordinates of a frame after at most so many rounds, and the logarithm of the density of
/// what was read.
pub(super) fn regress(
    sensor: &mut Sensor<'_>,
    frame: &Frame,
    read: &[f64],
    rounds: usize,
) -> (Inner, f64) {
    let mut inner = Inner::standard(frame.rank);
    let mut log = f64::NEG_INFINITY;
    for round in 0..rounds {
        let Some(line) = Line::new(sensor, frame, &inner) else {
            break;
        };
        let (next, evidence) = line.posterior(read, frame.rank);
        let moved = next.mean.iter().zip(&inner.mean);
        let moved = moved.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
        if !evidence.is_finite() {
            break;
        }
        (inner, log) = (next, evidence);
        if round > 0 && moved < SETTLED {
            break;
        }
    }
    (inner, log)
}

impl Line {
    /// The regression on the sigma points of a Gaussian in the frame; `None` where that has no width. What is a line already needs none.
    fn new(sensor: &mut Sensor<'_>, frame: &Frame, around: &Inner) -> Option<Self> {
        if let Some((h, noise)) = sensor.linear() {
            return Some(Self {
                a: frame.seen(h),
                b: frame.middle_seen(h),
                noise: Few::from_slice(noise),
            });
        }
        let (r, m) = (frame.rank, sensor.m);
        let spread = root(&around.covariance, r);
        if (0..r).any(|i| spread[i * r + i] <= 0.0) {
            return None;
        }
        let far = (r as f64).sqrt();
        let share = 0.5 / r as f64;
        let (mut z, mut at): (Few, Few) = (smallvec![0.0; r], smallvec![0.0; frame.dim()]);
        let mut values: Few = smallvec![0.0; 2 * r * m];
        let mut noise: Few = smallvec![0.0; m * m];
        let mut expected: Few = smallvec![0.0; m];
        for (k, value) in values.chunks_exact_mut(m).enumerate() {
            let step = if k % 2 == 0 { far } else { -far };
            for (i, z) in z.iter_mut().enumerate() {
                *z = around.mean[i] + step * spread[i * r + k / 2];
            }
            frame.place(&z, &mut at);
            sensor.ask(&at);
            value.copy_from_slice(&sensor.values);
            for (sum, value) in expected.iter_mut().zip(&sensor.values) {
                *sum += share * value;
            }
            for (sum, entry) in noise.iter_mut().zip(&sensor.noise) {
                *sum += share * entry;
            }
        }
        // How readings go with the whitened coordinates of `around`, and what of their spread that leaves over.
        let mut a: Few = smallvec![0.0; m * r];
        for i in 0..r {
            let (plus, minus) = (2 * i * m, (2 * i + 1) * m);
            for q in 0..m {
                a[q * r + i] = 0.5 / far * (values[plus + q] - values[minus + q]);
                for p in 0..m {
                    let even =
                        |q: usize| 0.5 * (values[plus + q] + values[minus + q]) - expected[q];
                    noise[p * m + q] += even(p) * even(q) / r as f64;
                }
            }
        }
        for row in a.chunks_exact_mut(r) {
            for j in (0..r).rev() {
                let later: f64 = (j + 1..r).map(|k| row[k] * spread[k * r + j]).sum();
                row[j] = (row[j] - later) / spread[j * r + j];
            }
        }
        let b = a.chunks_exact(r).zip(&expected).map(|(row, value)| {
            value
                - row
                    .iter()
                    .zip(&around.mean)
                    .map(|(a, z)| a * z)
                    .sum::<f64>()
        });
        Some(Self {
            b: b.collect(),
            a,
            noise,
        })
    }

    fn posterior(&self, read: &[f64], r: usize) -> (Inner, f64) {
        // Loops whose lengths are known are unrolled.
        match (r, self.b.len()) {
            (1, 1) => self.posterior_in(1, 1, read),
            (2, 1) => self.posterior_in(2, 1, read),
            (2, 2) => self.posterior_in(2, 2, read),
            (r, m) => self.posterior_in(r, m, read),
        }
    }

    #[inline(always)]
    fn posterior_in(&self, r: usize, m: usize, read: &[f64]) -> (Inner, f64) {
        let (all, b) = (&self.a[..m * r], &self.b[..m]);
        let a = |q: usize, i: usize| all[q * r + i];
        let mut innovation = self.noise.clone();
        for p in 0..m {
            for q in 0..m {
                innovation[p * m + q] += (0..r).map(|i| a(p, i) * a(q, i)).sum::<f64>();
            }
        }
        let scale = (0..m).fold(0.0, |most: f64, q| most.max(innovation[q * m + q]));
        for q in 0..m {
            innovation[q * m + q] += (SHARP * scale).max(f64::MIN_POSITIVE);
        }
        let mut spread: Few = smallvec![0.0; m * m];
        root_into(&innovation, m, &mut spread);
        let mut apart: Few = read.iter().zip(b).map(|(o, b)| o - b).collect();
        let log = whiten(&spread, &mut apart);
        // Row by row, the gain is `A' S^-1`; whitened once here, twice below.
        let mut gain: Few = smallvec![0.0; r * m];
        for (i, row) in gain.chunks_exact_mut(m).enumerate() {
            for (q, value) in row.iter_mut().enumerate() {
                *value = a(q, i);
            }
            whiten(&spread, row);
        }
        let mean = gain.chunks_exact(m);
        let mean = mean.map(|row| row.iter().zip(&apart).map(|(g, x)| g * x).sum());
        let mean: Few = mean.collect();
        for row in gain.chunks_exact_mut(m) {
            for q in (0..m).rev() {
                let later: f64 = (q + 1..m).map(|p| spread[p * m + q] * row[p]).sum();
                let pivot = spread[q * m + q];
                row[q] = if pivot > 0.0 {
                    (row[q] - later) / pivot
                } else {
                    0.0
                };
            }
        }
        (
            Inner {
                mean,
                covariance: self.joseph(r, m, &gain),
            },
            log,
        )
    }

    /// `(I - K A)(I - K A)' + K R K'`, which keeps its digits where hardly anything is left (P. Joseph).
    #[inline(always)]
    fn joseph(&self, r: usize, m: usize, gain: &[f64]) -> Few {
        let (a, noise, gain) = (&self.a[..m * r], &self.noise[..m * m], &gain[..r * m]);
        let mut left: Few = smallvec![0.0; r * r];
        for i in 0..r {
            for j in 0..r {
                let known: f64 = (0..m).map(|q| gain[i * m + q] * a[q * r + j]).sum();
                left[i * r + j] = if i == j { 1.0 - known } else { -known };
            }
        }
        let mut covariance: Few = smallvec![0.0; r * r];
        for i in 0..r {
            for j in 0..=i {
                let mut sum: f64 = (0..r).map(|k| left[i * r + k] * left[j * r + k]).sum();
                for p in 0..m {
                    for q in 0..m {
                        sum += gain[i * m + p] * noise[p * m + q] * gain[j * m + q];
                    }
                }
                covariance[i * r + j] = sum;
                covariance[j * r + i] = sum;
            }
        }
        covariance
    }
}
