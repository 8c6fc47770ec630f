//! How much a sensor changes over the width of a Gaussian.

use super::component::Component;
use super::frame::Few;
use super::sensor::Sensor;

/// Standard deviations over which that is looked at.
const WIDTH: f64 = 1.5;

/// Changes over a Gaussian that are small enough for one update of sigma points: by which factor variances of noise differ, and how far
/// readings bend in standard deviations of their noise.
const STRAIGHT: (f64, f64) = (1.2, 0.1);

/// Changes over a Gaussian that are too large for it to stay one.
const BENT: (f64, f64) = (4.0, 1.5);

/// What a reading spreads without noise counts as noise in this share.
const SHARP: f64 = 1e-12;

/// How a sensor behaves over the width of a Gaussian.
pub(super) struct Bend {
    /// Largest factor between variances of noise.
    noise: f64,
    /// How far readings bend, in standard deviations of the noise.
    reading: f64,
    /// The variable along which either is largest.
    pub(super) variable: usize,
}

impl Bend {
    /// Of numbers that are read; `at` is room for a state.
    pub(super) fn new(component: &Component, sensor: &mut Sensor<'_>, at: &mut [f64]) -> Self {
        let (n, m) = (component.dim(), sensor.m);
        let mut bend = Self {
            noise: 1.0,
            reading: 0.0,
            variable: 0,
        };
        if sensor.linear().is_some() {
            return bend;
        }
        let mut worst = 0.0;
        sensor.ask(&component.mean);
        let kept = |sensor: &Sensor<'_>| {
            let [values, noise] = [&sensor.values, &sensor.noise].map(|all| Few::from_slice(all));
            (values, noise)
        };
        let (centre, noise) = kept(sensor);
        for variable in 0..n {
            let variance = component.variance(variable);
            if variance <= 0.0 {
                continue;
            }
            let stride = WIDTH / variance.sqrt();
            let mut look = |sign: f64, sensor: &mut Sensor<'_>| {
                for (i, value) in at.iter_mut().enumerate() {
                    *value =
                        component.mean[i] + sign * stride * component.covariance[i * n + variable];
                }
                sensor.ask(at);
            };
            look(-1.0, sensor);
            let (before, noise_before) = kept(sensor);
            look(1.0, sensor);
            for r in 0..m {
                let k = r * m + r;
                let (low, high) = (
                    noise_before[k].min(noise[k]).min(sensor.noise[k]),
                    noise_before[k].max(noise[k]).max(sensor.noise[k]),
                );
                let span = sensor.values[r] - before[r];
                let own = (SHARP * span * span).max(f64::MIN_POSITIVE);
                // Noise far larger than what the Gaussian spreads in the reading teaches little, whatever it does.
                let matters = (span * span / (low + own)).min(1.0);
                let ratio = 1.0 + matters * ((high + own) / (low + own) - 1.0);
                let bent = (before[r] + sensor.values[r] - 2.0 * centre[r]).abs();
                let bent = bent / (noise[k] + own).sqrt();
                let how_bad = (ratio / BENT.0).max(bent / BENT.1);
                bend.noise = bend.noise.max(ratio);
                bend.reading = bend.reading.max(bent);
                if how_bad > worst {
                    worst = how_bad;
                    bend.variable = variable;
                }
            }
        }
        bend
    }

    /// Whether sigma points tell all.
    pub(super) fn is_straight(&self) -> bool {
        self.noise < STRAIGHT.0 && self.reading < STRAIGHT.1
    }

    /// Whether the Gaussian is too wide for the sensor.
    pub(super) fn is_too_much(&self) -> bool {
        self.noise > BENT.0 || self.reading > BENT.1
    }
}
