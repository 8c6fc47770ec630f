//! Where a Gaussian goes: moved by the matrices of linear motion or by points, stopped by walls, rounded where numbers are whole.

use super::component::Component;
use super::frame::{place, root};
use super::quadrature::Rule;
use super::reduce::Likeness;
use super::{NARROW, Sum, SumKeeping, points};
use crate::belief::Moments;
use crate::model::{Barriers, Doing, StartShape, VariableKind};

/// Standard deviations over which the bend of a motion is looked at.
const WIDTH: f64 = 1.5;

/// How far a motion may bend over them, in standard deviations of where it leads.
const BENT: f64 = 0.75;

/// Variances of noise that differ by this factor over them are too different.
const OTHER_NOISE: f64 = 4.0;

/// Share of the variance after a move that noise must have to matter.
const NOISY: f64 = 0.25;

/// Share of the side of a cell of a map up to which a standard deviation is narrow.
const ONE_SIDED: f64 = 0.5;

/// Lighter Gaussians are not split.
const LIGHT: f64 = 1e-3;

/// Times that a Gaussian is split for a move.
const DEPTH: usize = 2;

impl SumKeeping {
    /// Where a component comes to rest, in so many parts for which it may be split, and in more where walls cut it. The mode in which the
    /// action is taken moves it.
    pub(super) fn moved(&self, component: Component, doing: Doing, room: usize) -> Vec<Component> {
        let mut parts = vec![component];
        for _ in 0..DEPTH {
            if parts.len() + 2 > room {
                break;
            }
            let split = |part: Component| match self.swerves(&part, doing) {
                Some(variable) => part.split(variable).to_vec(),
                None => vec![part],
            };
            let count = parts.len();
            parts = parts.into_iter().flat_map(split).collect();
            if parts.len() == count {
                break;
            }
        }
        let rest = |part| self.rest(part, doing);
        parts.into_iter().flat_map(rest).collect()
    }

    /// The variable along which a component is too wide for its motion.
    fn swerves(&self, component: &Component, doing: Doing) -> Option<usize> {
        let dynamics = &self.dynamics;
        let linear = dynamics.linear_transition(doing).is_some();
        let steady = dynamics.constant_transition_noise(doing).is_some();
        if !self.splits || component.weight < LIGHT || linear && steady {
            return None;
        }
        let n = component.dim();
        let look = |at: &[f64]| {
            let (mut to, mut noise) = (vec![0.0; n], vec![0.0; n * n]);
            dynamics.transition(doing, at, &mut to);
            dynamics.transition_noise(doing, at, &mut noise);
            (to, noise)
        };
        let (centre, noise) = look(&component.mean);
        let mut spread: Vec<f64> = (0..n).map(|i| noise[i * n + i]).collect();
        let mut bends = Vec::new();
        for variable in (0..n).filter(|&i| component.variance(i) > 0.0) {
            let stride = WIDTH / component.variance(variable).sqrt();
            let at = |sign: f64| -> Vec<f64> {
                let step = |i| sign * stride * component.covariance[i * n + variable];
                (0..n).map(|i| component.mean[i] + step(i)).collect()
            };
            let (before, after) = (look(&at(-1.0)), look(&at(1.0)));
            for i in 0..n {
                let apart = |to: &[f64]| self.likeness.apart(i, centre[i], to[i]);
                let (low, high) = (apart(&before.0), apart(&after.0));
                spread[i] += ((high - low) / (2.0 * WIDTH)).powi(2);
                let noises = [&before.1, &noise, &after.1].map(|noise| noise[i * n + i]);
                let least = noises.into_iter().fold(f64::INFINITY, f64::min);
                let most = noises.into_iter().fold(0.0, f64::max);
                bends.push((variable, i, (low + high).abs(), least, most));
            }
        }
        let how_bad = |&(variable, i, bent, least, most): &(usize, usize, f64, f64, f64)| {
            let bent = bent / (BENT * spread[i].max(f64::MIN_POSITIVE).sqrt());
            let noisy = most > NOISY * spread[i] && most > OTHER_NOISE * least;
            let noise = if noisy {
                most / (OTHER_NOISE * least).max(f64::MIN_POSITIVE)
            } else {
                0.0
            };
            (variable, bent.max(noise))
        };
        let worst = bends.iter().map(how_bad);
        let worst = worst.max_by(|a, b| a.1.total_cmp(&b.1));
        worst
            .filter(|(_, bad)| *bad > 1.0)
            .map(|(variable, _)| variable)
    }

    /// Moves a component and lets it come to rest: at walls, on whole numbers, at angles that are wrapped.
    fn rest(&self, component: Component, doing: Doing) -> Vec<Component> {
        if self.bounds.is_none() && self.dynamics.walls().is_some() {
            return self.on_the_map(component, doing);
        }
        let mut moved = self.carried(component, doing);
        if self.dynamics.kinds().contains(&VariableKind::Angle) {
            self.dynamics.wrap(&mut moved.mean);
        }
        let parts = self.stopped(moved);
        match self.dynamics.kinds().contains(&VariableKind::Integer) {
            true => parts
                .into_iter()
                .flat_map(|part| self.rounded(part))
                .collect(),
            false => parts,
        }
    }

    /// What of it the bounds let through and what they stop, where they are known.
    pub(super) fn stopped(&self, component: Component) -> Vec<Component> {
        let mut parts = vec![component];
        for (variable, side) in self.bounds.iter().flatten().enumerate() {
            let stop = |part: Component| part.stopped(variable, *side);
            parts = parts.into_iter().flat_map(stop).collect();
            if self.whole {
                self.likeness.join(&mut parts);
            }
        }
        parts
    }

    /// Whole numbers: along a line every one that is likely, elsewhere the nearest to a narrow Gaussian; a wide one keeps its shape.
    fn rounded(&self, mut part: Component) -> Vec<Component> {
        let narrow = (0..part.dim()).all(|i| part.variance(i) < NARROW);
        match (narrow, part.dim()) {
            (true, _) => {
                self.dynamics.round_within(&mut part.mean);
                vec![part]
            }
            (false, 1) => points(&part, StartShape::Normal),
            _ => vec![part],
        }
    }

    /// Moved, noise added, whatever is in the way.
    fn carried(&self, component: Component, doing: Doing) -> Component {
        match self.dynamics.linear_transition(doing) {
            Some((a, shift)) => self.carried_linearly(component, a, shift, doing),
            None => self.carried_by_points(&component, doing),
        }
    }

    fn carried_linearly(
        &self,
        component: Component,
        a: &[f64],
        shift: &[f64],
        doing: Doing,
    ) -> Component {
        let n = component.dim();
        let mut moved = component.clone();
        self.noise(&component, doing, &mut moved.covariance);
        for i in 0..n {
            let row = &a[i * n..(i + 1) * n];
            moved.mean[i] = shift[i] + dot(row, &component.mean);
            for j in 0..n {
                let other = &a[j * n..(j + 1) * n];
                let rows = component.covariance.chunks_exact(n);
                let through = rows.zip(row).map(|(spread, a)| a * dot(spread, other));
                moved.covariance[i * n + j] += through.sum::<f64>();
            }
        }
        moved
    }

    /// Writes the covariance of the noise that is expected for a component.
    fn noise(&self, component: &Component, doing: Doing, to: &mut [f64]) {
        if let Some(constant) = self.dynamics.constant_transition_noise(doing) {
            return to.copy_from_slice(constant);
        }
        let n = component.dim();
        let root = root(&component.covariance, n);
        let (mut at, mut here) = (vec![0.0; n], vec![0.0; n * n]);
        to.fill(0.0);
        for (z, weight) in self.rule.iter() {
            place(&component.mean, &root, z, &mut at);
            self.dynamics.transition_noise(doing, &at, &mut here);
            for (sum, entry) in to.iter_mut().zip(&here) {
                *sum += weight * entry;
            }
        }
    }

    /// Mean and covariance of where the points of a rule are led, noise added.
    fn carried_by_points(&self, component: &Component, doing: Doing) -> Component {
        let n = component.dim();
        let root = root(&component.covariance, n);
        let (mut at, mut to, mut noise) = (vec![0.0; n], vec![0.0; n], vec![0.0; n * n]);
        let mut gathered = Gathered::new(&self.likeness, n);
        for (z, weight) in self.rule.iter() {
            place(&component.mean, &root, z, &mut at);
            self.dynamics.transition(doing, &at, &mut to);
            self.dynamics.transition_noise(doing, &at, &mut noise);
            gathered.add(weight, &to, Some(&noise));
        }
        gathered.of(component)
    }

    /// Moves a point of what is believed, of which mean and covariance are given, to where a state can be: what is narrow beside the cells of
    /// a map is on one side of each wall only, that of its mean.
    pub(super) fn confine(&self, mean: &[f64], covariance: &[f64], point: &mut [f64]) {
        let Some(walls) = self.dynamics.walls() else {
            return;
        };
        match is_one_sided(walls, covariance, mean.len()) {
            true => walls.stop(mean, point),
            false => walls.confine(point),
        }
    }

    /// Moves the mean of a narrow belief to the side of the walls on which most of it is: what little may be beyond one would otherwise
    /// draw the mean through it.
    pub(super) fn keep_side(&self, full: &Sum, moments: &mut Moments) {
        let Some(walls) = self.dynamics.walls() else {
            return;
        };
        let heavier = |a: &&Component, b: &&Component| a.weight.total_cmp(&b.weight);
        let Some(heaviest) = full.components.iter().max_by(heavier) else {
            return;
        };
        if is_one_sided(walls, &moments.covariance, moments.mean.len()) {
            walls.stop(&heaviest.mean, &mut moments.mean);
        }
    }

    /// Where the walls of a map stop the way, point by point: what gets through and what does not.
    fn on_the_map(&self, component: Component, doing: Doing) -> Vec<Component> {
        let n = component.dim();
        let one = Rule::point(n);
        let spread = root(&component.covariance, n);
        let states = if spread.iter().any(|entry| *entry > 0.0) {
            &self.fine
        } else {
            &one
        };
        let (mut at, mut to, mut led) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut noise = vec![0.0; n * n];
        let mut free = Gathered::new(&self.likeness, n);
        let mut stopped = Gathered::new(&self.likeness, n);
        for (z, weight) in states.iter() {
            place(&component.mean, &spread, z, &mut at);
            self.confine(&component.mean, &component.covariance, &mut at);
            self.dynamics.transition(doing, &at, &mut led);
            self.dynamics.transition_noise(doing, &at, &mut noise);
            let quiet = noise.iter().all(|entry| *entry == 0.0);
            let noise_root = root(&noise, n);
            let noises = match (quiet, states.weights.len()) {
                (true, _) => &one,
                // All of the spread is noise.
                (_, 1) => &self.fine,
                _ => &self.gusts,
            };
            for (z, share) in noises.iter() {
                place(&led, &noise_root, z, &mut to);
                let aim = to.clone();
                self.dynamics.settle(&at, &mut to);
                // Rounding and wrapping stop nothing.
                let mut rounded = aim;
                self.dynamics.round(&mut rounded);
                let through = rounded == to;
                let gathered = if through { &mut free } else { &mut stopped };
                gathered.add(weight * share, &to, None);
            }
        }
        if stopped.total == 0.0 {
            let mut moved = self.carried(component, doing);
            self.dynamics.wrap(&mut moved.mean);
            return vec![moved];
        }
        let parts = [free, stopped].into_iter();
        let parts = parts.filter(|part| part.total > 0.0);
        parts
            .map(|part| {
                let weight = component.weight * part.total;
                Component {
                    weight,
                    ..part.of(&component)
                }
            })
            .collect()
    }
}

/// Whether what has this covariance, `n x n`, is narrow beside the cells of a map.
fn is_one_sided(walls: &Barriers, covariance: &[f64], n: usize) -> bool {
    let cell = walls.map.as_ref().map_or(0.0, |map| map.cell);
    (0..n.min(2)).all(|i| covariance[i * n + i] <= (ONE_SIDED * cell).powi(2))
}

/// Weighted points, of which mean and covariance are asked.
struct Gathered<'a> {
    likeness: &'a Likeness,
    total: f64,
    first: Vec<f64>,
    sums: Vec<f64>,
    products: Vec<f64>,
}

impl<'a> Gathered<'a> {
    fn new(likeness: &'a Likeness, n: usize) -> Self {
        Self {
            likeness,
            total: 0.0,
            first: Vec::new(),
            sums: vec![0.0; n],
            products: vec![0.0; n * n],
        }
    }

    /// Adds a point, with a covariance of its own if it has one. Sums are taken around the first, which keeps their digits, and angles
    /// together.
    fn add(&mut self, weight: f64, at: &[f64], spread: Option<&[f64]>) {
        if self.first.is_empty() {
            self.first = at.to_vec();
        }
        let n = at.len();
        self.total += weight;
        for i in 0..n {
            let x = self.likeness.apart(i, self.first[i], at[i]);
            self.sums[i] += weight * x;
            for j in 0..n {
                let y = self.likeness.apart(j, self.first[j], at[j]);
                let own = spread.map_or(0.0, |spread| spread[i * n + j]);
                self.products[i * n + j] += weight * (x * y + own);
            }
        }
    }

    /// A component with their moments, and weight and mode of another.
    fn of(self, like: &Component) -> Component {
        let n = self.sums.len();
        let mean: Vec<f64> = self.sums.iter().map(|sum| sum / self.total).collect();
        let products = self.products.iter().enumerate();
        let covariance = products.map(|(k, product)| {
            let (i, j) = (k / n, k % n);
            let entry = product / self.total - mean[i] * mean[j];
            if i == j { entry.max(0.0) } else { entry }
        });
        Component {
            weight: like.weight,
            mode: like.mode,
            covariance: covariance.collect(),
            mean: mean
                .iter()
                .zip(&self.first)
                .map(|(mean, first)| mean + first)
                .collect(),
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
