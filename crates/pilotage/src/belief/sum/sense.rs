//! What a reading does to a sum: every Gaussian becomes one with the moments of its posterior, weighted by how well it foretold the reading.
//!
//! Where reading and noise hardly change over the width of a Gaussian, sigma points give these moments. Elsewhere the posterior itself is
//! looked at: on a line by a grid that closes in on it, in a plane by a quadrature that is moved to where it is. A Gaussian that is too
//! wide for its sensor is split before.

use super::act::Gathered;
use super::component::{Component, place, root};
use super::{Sum, SumKeeping};
use crate::belief::gaussian::normal_cdf;
use crate::belief::reading::Reading;
use crate::model::{ActionId, Doing, VariableKind};

/// Variances of noise that differ by this factor over a Gaussian are not the same.
const SAME_NOISE: f64 = 1.2;

/// Variances of noise that differ by this factor over a Gaussian, which is then split.
const OTHER_NOISE: f64 = 4.0;

/// How far a reading may bend over a Gaussian, in standard deviations of its noise.
const STRAIGHT: f64 = 0.1;

/// How far before it is split.
const BENT: f64 = 1.5;

/// Standard deviations over which that is looked at.
const WIDTH: f64 = 1.5;

/// Points of a grid that closes in.
const POINTS: usize = 25;

/// Points of the first grid, which has to find the posterior of a wide Gaussian.
const FIRST: usize = 97;

/// Times that it closes in at most.
const ZOOMS: usize = 6;

/// Posteriors that are less likely than their most likely point by so many nats do not count.
const DEPTH: f64 = 12.0;

/// Noise of no variance is taken for this share of the spread of what is read.
const SHARP: f64 = 1e-12;

/// How a sensor behaves over the width of a Gaussian.
struct Bend {
    /// Largest factor between variances of noise, or between likelihoods of a signal.
    noise: f64,
    /// How far readings bend, in standard deviations of the noise.
    reading: f64,
    /// The variable along which either is largest.
    variable: usize,
}

/// What is sensed, and where.
#[derive(Clone, Copy)]
struct Heard<'a> {
    doing: Doing,
    reading: Reading<'a>,
}

impl SumKeeping {
    /// Takes in what was sensed. A reading that no Gaussian foretells leaves all as they are.
    pub(super) fn correct(
        &self,
        full: &mut Sum,
        action: ActionId,
        step: usize,
        reading: Reading<'_>,
    ) {
        let m = self.dynamics.readings();
        let (reading, seen) = match reading {
            Reading::Values(values) if self.model.laws.modes_seen => {
                let mode = values.get(m).map(|mode| *mode as usize);
                (Reading::Values(&values[..m.min(values.len())]), mode)
            }
            other => (other, None),
        };
        let heard = |component: &Component| Heard {
            doing: self.doing(component.mode, action, step),
            reading,
        };
        let mut parts = Vec::with_capacity(full.components.len());
        let room = if self.splits { 3 * self.most } else { 0 };
        let many = full.components.len();
        for component in &full.components {
            if seen.is_some_and(|mode| mode != component.mode) {
                continue;
            }
            self.split_into(
                component.clone(),
                heard(component),
                3,
                &mut parts,
                room.saturating_sub(many),
            );
        }
        let mut logs = Vec::with_capacity(parts.len());
        for part in &mut parts {
            let log = self.posterior(part, heard(part));
            logs.push(part.weight.ln() + log);
        }
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if !best.is_finite() {
            return;
        }
        for (part, log) in parts.iter_mut().zip(&logs) {
            part.weight = (log - best).exp();
            self.tidy(part);
        }
        parts.retain(|part| part.weight > 0.0);
        full.components = parts;
    }

    /// A mean where a state can be.
    fn tidy(&self, part: &mut Component) {
        if let Some(walls) = self.dynamics.walls() {
            walls.confine(&mut part.mean);
        }
        if self.dynamics.kinds().contains(&VariableKind::Angle) {
            self.dynamics.wrap(&mut part.mean);
        }
    }

    fn split_into(
        &self,
        component: Component,
        heard: Heard<'_>,
        depth: usize,
        parts: &mut Vec<Component>,
        room: usize,
    ) {
        const LIGHT: f64 = 1e-3;
        let fits = depth > 0 && component.weight > LIGHT && parts.len() + 3 <= room;
        if fits
            && let Some(bend) = self.bend(&component, heard)
            && (bend.noise > OTHER_NOISE || bend.reading > BENT)
        {
            for part in component.split(bend.variable) {
                self.split_into(part, heard, depth - 1, parts, room);
            }
            return;
        }
        parts.push(component);
    }

    /// How the sensor behaves over a Gaussian; `None` where that is a point, or no numbers are heard.
    fn bend(&self, component: &Component, heard: Heard<'_>) -> Option<Bend> {
        if !matches!(heard.reading, Reading::Values(_)) {
            return None;
        }
        let (n, m) = (component.dim(), self.dynamics.readings());
        let mut bend = Bend {
            noise: 1.0,
            reading: 0.0,
            variable: 0,
        };
        let mut values = vec![vec![0.0; m]; 3];
        let mut noises = vec![vec![0.0; m * m]; 3];
        let mut worst = 0.0;
        for variable in 0..n {
            let variance = component.variance(variable);
            if variance <= 0.0 {
                continue;
            }
            let sd = variance.sqrt();
            for (k, steps) in [-WIDTH, 0.0, WIDTH].into_iter().enumerate() {
                let at: Vec<f64> = (0..n)
                    .map(|i| {
                        component.mean[i] + steps * component.covariance[i * n + variable] / sd
                    })
                    .collect();
                self.dynamics.observation(heard.doing, &at, &mut values[k]);
                self.dynamics
                    .observation_noise(heard.doing, &at, &mut noises[k]);
            }
            for r in 0..m {
                let variances = [0, 1, 2].map(|k: usize| noises[k][r * m + r]);
                let (low, high) = variances
                    .iter()
                    .fold((f64::INFINITY, 0.0_f64), |(low, high), v| {
                        (low.min(*v), high.max(*v))
                    });
                let span = values[2][r] - values[0][r];
                let own = (SHARP * span * span).max(f64::MIN_POSITIVE);
                // Noise that is far larger than what the Gaussian spreads in the reading does not matter, whatever it does.
                let matters = (span * span / (low + own)).min(1.0);
                let noise = 1.0 + matters * ((high + own) / (low + own) - 1.0);
                let bent = (values[0][r] + values[2][r] - 2.0 * values[1][r]).abs();
                let reading = bent / (variances[1] + own).sqrt();
                let how_bad = (noise / OTHER_NOISE).max(reading / BENT);
                bend.noise = bend.noise.max(noise);
                bend.reading = bend.reading.max(reading);
                if how_bad > worst {
                    worst = how_bad;
                    bend.variable = variable;
                }
            }
        }
        Some(bend)
    }

    /// Gives a Gaussian the moments of its posterior; returns the logarithm of the reading's density.
    fn posterior(&self, part: &mut Component, heard: Heard<'_>) -> f64 {
        if part.covariance.iter().all(|entry| *entry == 0.0) {
            return self.log_likelihood(heard, &part.mean);
        }
        let silent = matches!(heard.reading, Reading::Nothing);
        let present = self.dynamics.constant_present(heard.doing);
        match (silent, present) {
            (true, Some(present)) => return (1.0 - present).ln(),
            (false, Some(present)) if self.dynamics.saturates().is_empty() => {
                if let Some(bend) = self.bend(part, heard)
                    && bend.noise < SAME_NOISE
                    && bend.reading < STRAIGHT
                {
                    return present.ln() + self.kalman(part, heard);
                }
            }
            _ => {}
        }
        match part.dim() {
            1 => self.close_in(part, heard),
            2 => self.adapt(part, heard),
            _ => self.kalman(part, heard) + present.map_or(0.0, f64::ln),
        }
    }

    /// The update of sigma points (S. Julier and J. Uhlmann, 1997), exact for a linear sensor; noise is averaged over them.
    fn kalman(&self, part: &mut Component, heard: Heard<'_>) -> f64 {
        let Reading::Values(observed) = heard.reading else {
            return self.averaged(part, heard);
        };
        let (n, m) = (part.dim(), self.dynamics.readings());
        let root_ = root(&part.covariance, n);
        let far = (n as f64).sqrt();
        let share = 0.5 / n as f64;
        let mut at = vec![0.0; n];
        let mut z = vec![0.0; n];
        let mut here = vec![0.0; m];
        let mut noise = vec![0.0; m * m];
        let (mut values, mut offsets) = (Vec::with_capacity(2 * n), Vec::with_capacity(2 * n));
        let mut innovation = vec![0.0; m * m];
        let mut expected = vec![0.0; m];
        for i in 0..n {
            for sign in [far, -far] {
                z.iter_mut().for_each(|z| *z = 0.0);
                z[i] = sign;
                place(&part.mean, &root_, &z, &mut at);
                self.dynamics.observation(heard.doing, &at, &mut here);
                self.dynamics
                    .observation_noise(heard.doing, &at, &mut noise);
                for (sum, value) in expected.iter_mut().zip(&here) {
                    *sum += share * value;
                }
                for (sum, entry) in innovation.iter_mut().zip(&noise) {
                    *sum += share * entry;
                }
                values.push(here.clone());
                offsets.push(
                    at.iter()
                        .zip(&part.mean)
                        .map(|(x, m)| x - m)
                        .collect::<Vec<f64>>(),
                );
            }
        }
        let mut cross = vec![0.0; n * m];
        for (value, offset) in values.iter().zip(&offsets) {
            for r in 0..m {
                let apart = share * (value[r] - expected[r]);
                for q in 0..m {
                    innovation[r * m + q] += apart * (value[q] - expected[q]);
                }
                for i in 0..n {
                    cross[i * m + r] += apart * offset[i];
                }
            }
        }
        let scale = (0..m).fold(0.0, |most: f64, r| most.max(innovation[r * m + r]));
        for r in 0..m {
            innovation[r * m + r] += (SHARP * scale).max(f64::MIN_POSITIVE);
        }
        let spread = root(&innovation, m);
        let apart: Vec<f64> = observed.iter().zip(&expected).map(|(o, e)| o - e).collect();
        let (whitened, log) = whiten(&spread, &apart);
        for i in 0..n {
            let (gain, _) = whiten(&spread, &cross[i * m..(i + 1) * m]);
            part.mean[i] += gain.iter().zip(&whitened).map(|(g, w)| g * w).sum::<f64>();
            for j in 0..n {
                let (other, _) = whiten(&spread, &cross[j * m..(j + 1) * m]);
                let less: f64 = gain.iter().zip(&other).map(|(a, b)| a * b).sum();
                part.covariance[i * n + j] -= less;
            }
        }
        symmetric(&mut part.covariance, n);
        log
    }

    /// Whether something is heard at all, in more than two dimensions: the average over the points of a rule, moments as they are.
    fn averaged(&self, part: &mut Component, heard: Heard<'_>) -> f64 {
        let n = part.dim();
        let root = root(&part.covariance, n);
        let mut at = vec![0.0; n];
        let mut gathered = Gathered::new(n);
        let mut evidence = 0.0;
        for (z, weight) in self.fine.iter() {
            place(&part.mean, &root, z, &mut at);
            let likely = weight * self.log_likelihood(heard, &at).exp();
            evidence += likely;
            gathered.add(likely, &at, None);
        }
        if evidence > 0.0 {
            *part = gathered.component(part.weight, part.mode);
        }
        evidence.ln()
    }

    /// On a line: a grid over the Gaussian closes in on where the posterior is, and is summed up there.
    fn close_in(&self, part: &mut Component, heard: Heard<'_>) -> f64 {
        const FAR: f64 = 4.8;
        let (mean, sd) = (part.mean[0], part.variance(0).sqrt());
        let (mut low, mut high) = (-FAR, FAR);
        let mut logs = Vec::with_capacity(FIRST);
        // A Gaussian over which the sensor changes little needs no search.
        let mut points = if self.splits { POINTS } else { FIRST };
        let step = |low: f64, high: f64, points: usize| (high - low) / (points - 1) as f64;
        for zoom in 0..ZOOMS {
            let width = step(low, high, points);
            logs.clear();
            logs.extend((0..points).map(|k| {
                let z = low + width * k as f64;
                self.log_likelihood(heard, &[mean + sd * z]) - 0.5 * z * z
            }));
            let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if !best.is_finite() {
                return f64::NEG_INFINITY;
            }
            let counts = |log: &f64| *log > best - DEPTH;
            let first = logs.iter().position(counts).unwrap_or(0);
            let last = logs.iter().rposition(counts).unwrap_or(points - 1);
            let (from, to) = (first.saturating_sub(1), (last + 1).min(points - 1));
            if to - from > points / 2 || zoom + 1 == ZOOMS {
                break;
            }
            (low, high) = (low + width * from as f64, low + width * to as f64);
            points = POINTS;
        }
        let width = step(low, high, points);
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut total, mut first, mut second) = (0.0, 0.0, 0.0);
        for (k, log) in logs.iter().enumerate() {
            let z = low + width * k as f64;
            let weight = (log - best).exp();
            total += weight;
            first += weight * z;
            second += weight * z * z;
        }
        let centre = first / total;
        let variance = (second / total - centre * centre).max(0.0);
        part.mean[0] = mean + sd * centre;
        part.covariance[0] = sd * sd * variance;
        best + (total * width).ln() - 0.5 * std::f64::consts::TAU.ln()
    }

    /// In a plane: points of a rule are put to where the posterior was last seen, until they find it where they are (importance weights,
    /// an adaptive Gauss-Hermite quadrature).
    fn adapt(&self, part: &mut Component, heard: Heard<'_>) -> f64 {
        const ROUNDS: usize = 4;
        const WIDER: f64 = 1.3;
        const SETTLED: f64 = 0.02;
        let n = part.dim();
        let prior = part.clone();
        let prior_root = root(&prior.covariance, n);
        if (0..n).any(|i| prior_root[i * n + i] <= 0.0) {
            // Along a line in the plane the points of the prior will do.
            return self.averaged(part, heard);
        }
        let mut found = prior.clone();
        if self.kalman(&mut found, heard).is_nan() {
            found = prior.clone();
        }
        let mut log_evidence = f64::NEG_INFINITY;
        let mut at = vec![0.0; n];
        for _ in 0..ROUNDS {
            let wide: Vec<f64> = found.covariance.iter().map(|entry| WIDER * entry).collect();
            let proposal = root(&wide, n);
            if (0..n).any(|i| proposal[i * n + i] <= 0.0) {
                break;
            }
            let mut logs = Vec::with_capacity(self.fine.nodes.len());
            let mut places = Vec::with_capacity(self.fine.nodes.len());
            for (z, weight) in self.fine.iter() {
                place(&found.mean, &proposal, z, &mut at);
                let apart: Vec<f64> = at.iter().zip(&prior.mean).map(|(x, m)| x - m).collect();
                let (_, prior_log) = whiten(&prior_root, &apart);
                let apart: Vec<f64> = at.iter().zip(&found.mean).map(|(x, m)| x - m).collect();
                let (_, own_log) = whiten(&proposal, &apart);
                let log = self.log_likelihood(heard, &at) + prior_log - own_log + weight.ln();
                logs.push(log);
                places.push(at.clone());
            }
            let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if !best.is_finite() {
                break;
            }
            let mut gathered = Gathered::new(n);
            let mut total = 0.0;
            for (log, place) in logs.iter().zip(&places) {
                let weight = (log - best).exp();
                total += weight;
                gathered.add(weight, place, None);
            }
            let next = gathered.component(prior.weight, prior.mode);
            log_evidence = best + total.ln();
            let moved = (0..n).map(|i| {
                let sd = next.variance(i).max(1e-300).sqrt();
                ((next.mean[i] - found.mean[i]) / sd).abs()
            });
            let settled = moved.fold(0.0, f64::max) < SETTLED;
            found = next;
            if settled {
                break;
            }
        }
        if log_evidence.is_finite() {
            *part = found;
        }
        log_evidence
    }

    /// Logarithm of how likely what was sensed is in a state.
    fn log_likelihood(&self, heard: Heard<'_>, state: &[f64]) -> f64 {
        let present = self.dynamics.present(heard.doing, state);
        match heard.reading {
            Reading::Nothing => (1.0 - present).ln(),
            Reading::Symbol(symbol) => {
                let mut likely = vec![0.0; self.dynamics.symbols()];
                self.dynamics
                    .symbol_probabilities(heard.doing, state, &mut likely);
                let likely = likely.get(symbol as usize).copied().unwrap_or(0.0);
                (present * likely).ln()
            }
            Reading::Values(observed) => {
                present.ln() + self.log_density(heard.doing, state, observed)
            }
        }
    }

    fn log_density(&self, doing: Doing, state: &[f64], observed: &[f64]) -> f64 {
        let m = self.dynamics.readings();
        if m == 1 && self.dynamics.saturates().is_empty() {
            let (mut value, mut variance) = ([0.0], [0.0]);
            self.dynamics.observation(doing, state, &mut value);
            self.dynamics.observation_noise(doing, state, &mut variance);
            return log_normal(observed[0] - value[0], variance[0]);
        }
        let (mut values, mut noise) = (vec![0.0; m], vec![0.0; m * m]);
        self.dynamics.observation(doing, state, &mut values);
        self.dynamics.observation_noise(doing, state, &mut noise);
        let saturates = self.dynamics.saturates();
        if !saturates.is_empty() {
            let each = (0..m).map(|r| {
                let (apart, variance) = (observed[r] - values[r], noise[r * m + r]);
                let sd = variance.max(f64::MIN_POSITIVE).sqrt();
                match observed[r] {
                    low if low <= saturates[r].low => normal_cdf(apart / sd).ln(),
                    high if high >= saturates[r].high => normal_cdf(-apart / sd).ln(),
                    _ => log_normal(apart, variance),
                }
            });
            return each.sum();
        }
        for r in 0..m {
            noise[r * m + r] = noise[r * m + r].max(1e-24);
        }
        let apart: Vec<f64> = observed.iter().zip(&values).map(|(o, v)| o - v).collect();
        whiten(&root(&noise, m), &apart).1
    }
}

/// `L^-1 x` for the root `L` of a covariance, and the logarithm of the density of `x` under N(0, L L').
fn whiten(root: &[f64], x: &[f64]) -> (Vec<f64>, f64) {
    let n = x.len();
    let mut white = vec![0.0; n];
    let mut log = 0.0;
    for i in 0..n {
        let before: f64 = (0..i).map(|k| root[i * n + k] * white[k]).sum();
        let pivot = root[i * n + i];
        if pivot > 0.0 {
            white[i] = (x[i] - before) / pivot;
            log -= pivot.ln() + 0.5 * (std::f64::consts::TAU.ln() + white[i] * white[i]);
        }
    }
    (white, log)
}

fn log_normal(apart: f64, variance: f64) -> f64 {
    let variance = variance.max(1e-24);
    -0.5 * (apart * apart / variance + variance.ln() + std::f64::consts::TAU.ln())
}

fn symmetric(covariance: &mut [f64], n: usize) {
    for i in 0..n {
        covariance[i * n + i] = covariance[i * n + i].max(0.0);
        for j in 0..i {
            let mean = 0.5 * (covariance[i * n + j] + covariance[j * n + i]);
            covariance[i * n + j] = mean;
            covariance[j * n + i] = mean;
        }
    }
}
