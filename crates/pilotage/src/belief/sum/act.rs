//! What an action does to a sum: what is paid, which modes change, what moves where.

use nalgebra::DMatrix;

use super::component::Component;
use super::frame::{place, root};
use super::reduce::normalise;
use super::{Sum, SumKeeping};
use crate::belief::full::Acted;
use crate::model::{ActionId, Doing, Effect, ModeId, Then, VariableKind, When};

/// A part of a component in the course of a step.
struct Part {
    component: Component,
    /// Whether an event has happened to it.
    happened: bool,
}

/// Points of the rule for what is paid along a line, which need not be smooth.
const PAID: usize = 65;

/// Standard deviations that they reach.
const REACH: f64 = 5.0;

impl SumKeeping {
    /// Takes an action; what the episode goes on with is left in the sum.
    pub(super) fn take(&self, full: &mut Sum, action: ActionId, step: usize) -> Acted {
        let mut acted = Acted::default();
        let mut moved = Vec::with_capacity(full.components.len());
        for component in std::mem::take(&mut full.components) {
            let doing = self.doing(component.mode, action, step);
            let effects = self.effects.at(step, component.mode, action);
            acted.reward += component.weight * self.running_cost(&component, action);
            let whole = Part {
                component,
                happened: false,
            };
            let own = self.model.actions[action].then;
            for part in self.happen(whole, effects, When::Before, own, doing, &mut acted) {
                let happened = part.happened;
                for component in self.moved(part.component, doing) {
                    let Some(component) = self.alive(component, &mut acted) else {
                        continue;
                    };
                    let part = Part {
                        component,
                        happened,
                    };
                    let goes_on = Then::Continue;
                    let parts = self.happen(part, effects, When::After, goes_on, doing, &mut acted);
                    moved.extend(parts.into_iter().map(|part| part.component));
                }
            }
        }
        normalise(&mut moved);
        full.components = moved;
        acted
    }

    fn running_cost(&self, component: &Component, action: ActionId) -> f64 {
        if self.model.cost.is_none() {
            return 0.0;
        }
        let n = component.dim();
        let covariance = DMatrix::from_row_slice(n, n, &component.covariance);
        self.model
            .running_cost(&component.mean, Some(&covariance), action)
    }

    /// Lets the effects of a time happen; returns the parts with which the episode goes on.
    fn happen(
        &self,
        part: Part,
        effects: &[Effect],
        when: When,
        own: Then,
        doing: Doing,
        acted: &mut Acted,
    ) -> Vec<Part> {
        let mut left = vec![part];
        let mut done = Vec::new();
        for effect in effects.iter().filter(|effect| effect.when == when) {
            let Some(change) = effect.change else {
                let whole = left.iter().chain(&done);
                acted.reward += whole
                    .map(|part| self.paid(part, effect, doing))
                    .sum::<f64>();
                continue;
            };
            for part in std::mem::take(&mut left) {
                if part.happened {
                    left.push(part);
                    continue;
                }
                let (inside, outside) = part.component.cut(&effect.region);
                let rest = |component| Part {
                    component,
                    happened: false,
                };
                left.extend(outside.into_iter().map(rest));
                let Some(mut inside) = inside else { continue };
                if effect.chance < 1.0 {
                    let mut spared = inside.clone();
                    spared.weight *= 1.0 - effect.chance;
                    inside.weight *= effect.chance;
                    left.push(rest(spared));
                }
                acted.reward += inside.weight * effect.reward;
                inside.mode = change.mode;
                let then = match own {
                    Then::Continue => change.then,
                    ends => ends,
                };
                match then {
                    Then::Continue => done.push(Part {
                        component: inside,
                        happened: true,
                    }),
                    Then::End => acted.ended += inside.weight,
                    Then::Restart => acted.restarted += inside.weight,
                }
            }
        }
        let weight: f64 = left.iter().map(|part| part.component.weight).sum();
        match own {
            Then::Continue => {
                left.extend(done);
                left
            }
            Then::End => {
                acted.ended += weight;
                Vec::new()
            }
            Then::Restart => {
                acted.restarted += weight;
                Vec::new()
            }
        }
    }

    /// What a reward is expected to pay for a part.
    fn paid(&self, part: &Part, effect: &Effect, doing: Doing) -> f64 {
        let inside = match effect.region.sides.is_empty() {
            true => Some(part.component.clone()),
            false => part.component.clone().cut(&effect.region).0,
        };
        let Some(inside) = inside else { return 0.0 };
        let formula = effect.formula.as_ref();
        let formula = formula.map_or(0.0, |formula| {
            self.expected(&inside, &mut |state| {
                formula.value(&self.dynamics.point(doing, state))
            })
        });
        inside.weight * (effect.reward + formula)
    }

    /// Expectation of a function that need not be smooth.
    fn expected(&self, component: &Component, of: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
        let n = component.dim();
        if component.covariance.iter().all(|entry| *entry == 0.0) {
            return of(&component.mean);
        }
        let root = root(&component.covariance, n);
        let mut at = vec![0.0; n];
        if n == 1 {
            let (mut sum, mut total) = (0.0, 0.0);
            for k in 0..PAID {
                let z = REACH * (2.0 * k as f64 / (PAID - 1) as f64 - 1.0);
                let weight = (-0.5 * z * z).exp();
                place(&component.mean, &root, &[z], &mut at);
                sum += weight * of(&at);
                total += weight;
            }
            return sum / total;
        }
        let mut sum = 0.0;
        for (z, weight) in self.fine.iter() {
            place(&component.mean, &root, z, &mut at);
            sum += weight * of(&at);
        }
        sum
    }

    /// What of it is still within the limits of the episode.
    fn alive(&self, component: Component, acted: &mut Acted) -> Option<Component> {
        let limits = &self.model.episode.alive;
        if limits.sides.is_empty() {
            return Some(component);
        }
        let weight = component.weight;
        let (inside, _) = component.cut(limits);
        let failed = weight - inside.as_ref().map_or(0.0, |inside| inside.weight);
        acted.ended += failed;
        acted.reward += failed * self.model.episode.failure_reward;
        inside
    }

    /// Where it comes to rest. The mode in which the action is taken moves it.
    fn moved(&self, component: Component, doing: Doing) -> Vec<Component> {
        if component.covariance.iter().all(|entry| *entry == 0.0) {
            return self.moved_point(component, doing);
        }
        let moved = match self.dynamics.linear_transition(doing) {
            Some((a, shift)) => self.moved_linearly(&component, a, shift, doing),
            None => self.moved_by_points(&component, doing),
        };
        self.rest(moved, &component.mean)
    }

    /// What is known exactly stays a Gaussian of the noise.
    fn moved_point(&self, component: Component, doing: Doing) -> Vec<Component> {
        let n = component.dim();
        let mut moved = component.clone();
        self.dynamics
            .transition(doing, &component.mean, &mut moved.mean);
        self.dynamics
            .transition_noise(doing, &component.mean, &mut moved.covariance);
        debug_assert_eq!(moved.covariance.len(), n * n);
        self.rest(moved, &component.mean)
    }

    /// Lets what has moved come to rest: walls, whole numbers, angles.
    fn rest(&self, mut moved: Component, from: &[f64]) -> Vec<Component> {
        let kinds = self.dynamics.kinds();
        let n = moved.dim();
        if let Some(bounds) = &self.bounds {
            let mut parts = moved.stopped(bounds);
            for part in &mut parts {
                self.dynamics.round_within(&mut part.mean);
            }
            return parts;
        }
        if self.dynamics.walls().is_some() {
            return vec![self.stopped_by_map(moved, from)];
        }
        if kinds.contains(&VariableKind::Integer) {
            return self.rounded(moved);
        }
        if kinds.contains(&VariableKind::Angle) {
            self.dynamics.round(&mut moved.mean);
        }
        debug_assert_eq!(moved.mean.len(), n);
        vec![moved]
    }

    /// Whole numbers: a narrow Gaussian is the nearest, a wide one keeps its shape.
    fn rounded(&self, mut moved: Component) -> Vec<Component> {
        let n = moved.dim();
        let narrow = (0..n).all(|i| moved.variance(i) < 1e-6);
        if narrow || n > 1 {
            if narrow {
                self.dynamics.round(&mut moved.mean);
            }
            return vec![moved];
        }
        let whole = super::points(&moved, crate::model::StartShape::Normal);
        whole
    }

    fn moved_linearly(
        &self,
        component: &Component,
        a: &[f64],
        shift: &[f64],
        doing: Doing,
    ) -> Component {
        let n = component.dim();
        let mut moved = component.clone();
        let mut noise = vec![0.0; n * n];
        for i in 0..n {
            let row = &a[i * n..(i + 1) * n];
            moved.mean[i] = shift[i]
                + row
                    .iter()
                    .zip(&component.mean)
                    .map(|(a, m)| a * m)
                    .sum::<f64>();
        }
        match self.dynamics.constant_transition_noise(doing) {
            Some(constant) => noise.copy_from_slice(constant),
            None => {
                let mut at = vec![0.0; n];
                let mut here = vec![0.0; n * n];
                let root = root(&component.covariance, n);
                for (z, weight) in self.rule.iter() {
                    place(&component.mean, &root, z, &mut at);
                    self.dynamics.transition_noise(doing, &at, &mut here);
                    for (sum, entry) in noise.iter_mut().zip(&here) {
                        *sum += weight * entry;
                    }
                }
            }
        }
        for i in 0..n {
            for j in 0..n {
                let mut sum = noise[i * n + j];
                for k in 0..n {
                    for l in 0..n {
                        sum += a[i * n + k] * component.covariance[k * n + l] * a[j * n + l];
                    }
                }
                moved.covariance[i * n + j] = sum;
            }
        }
        moved
    }

    /// Mean and covariance of where the points of a rule are led, noise added. Angles are averaged around the first.
    fn moved_by_points(&self, component: &Component, doing: Doing) -> Component {
        let n = component.dim();
        let root = root(&component.covariance, n);
        let mut at = vec![0.0; n];
        let mut to = vec![0.0; n];
        let mut noise = vec![0.0; n * n];
        let mut gathered = Gathered::new(n);
        for (z, weight) in self.rule.iter() {
            place(&component.mean, &root, z, &mut at);
            self.dynamics.transition(doing, &at, &mut to);
            self.dynamics.transition_noise(doing, &at, &mut noise);
            gathered.add(weight, &to, Some(&noise));
        }
        gathered.component(component.weight, component.mode)
    }

    /// Where a map stops the way of a Gaussian, point by point.
    fn stopped_by_map(&self, moved: Component, from: &[f64]) -> Component {
        let n = moved.dim();
        let root = root(&moved.covariance, n);
        let mut at = vec![0.0; n];
        let mut gathered = Gathered::new(n);
        for (z, weight) in self.fine.iter() {
            place(&moved.mean, &root, z, &mut at);
            self.dynamics.settle(from, &mut at);
            gathered.add(weight, &at, None);
        }
        gathered.component(moved.weight, moved.mode)
    }
}

/// Weighted points, of which mean and covariance are asked.
pub(super) struct Gathered {
    n: usize,
    total: f64,
    first: Vec<f64>,
    sums: Vec<f64>,
    products: Vec<f64>,
}

impl Gathered {
    pub(super) fn new(n: usize) -> Self {
        Self {
            n,
            total: 0.0,
            first: Vec::new(),
            sums: vec![0.0; n],
            products: vec![0.0; n * n],
        }
    }

    /// Adds a point, with a covariance of its own if it has one. Sums are taken around the first, which keeps their digits.
    pub(super) fn add(&mut self, weight: f64, at: &[f64], spread: Option<&[f64]>) {
        if self.first.is_empty() {
            self.first = at.to_vec();
        }
        let n = self.n;
        self.total += weight;
        for i in 0..n {
            let x = at[i] - self.first[i];
            self.sums[i] += weight * x;
            for j in 0..n {
                let own = spread.map_or(0.0, |spread| spread[i * n + j]);
                self.products[i * n + j] += weight * (x * (at[j] - self.first[j]) + own);
            }
        }
    }

    pub(super) fn component(self, weight: f64, mode: ModeId) -> Component {
        let n = self.n;
        let mean: Vec<f64> = self.sums.iter().map(|sum| sum / self.total).collect();
        let mut covariance: Vec<f64> = self
            .products
            .iter()
            .enumerate()
            .map(|(k, product)| product / self.total - mean[k / n] * mean[k % n])
            .collect();
        for i in 0..n {
            covariance[i * n + i] = covariance[i * n + i].max(0.0);
        }
        Component {
            weight,
            mode,
            mean: mean
                .iter()
                .zip(&self.first)
                .map(|(mean, first)| mean + first)
                .collect(),
            covariance,
        }
    }
}
