//! What an action does to a sum: what is paid, which modes change, what moves where.

use nalgebra::DMatrix;

use super::component::Component;
use super::frame::Frame;
use super::reduce::normalise;
use super::{Sum, SumKeeping};
use crate::belief::full::Acted;
use crate::belief::gaussian::normal_density;
use crate::model::{ActionId, Doing, Effect, EffectTable, Interval, Then, When};

/// A part of a component in the course of a step.
struct Part {
    component: Component,
    /// Whether an event has happened to it.
    happened: bool,
}

/// Points at which what is paid along a line is asked: it need not be smooth.
const PAID: usize = 64;

/// Standard deviations that they reach.
const REACH: f64 = 6.0;

/// Parts of a component that are left of a step: walls and events in the plane cut it into a hundred, most of them slivers.
const PARTS: usize = 8;

/// So many times as many Gaussians may a sum have between an action and a reading, which tells the parts that events have cut apart.
const CUT: usize = 4;

impl SumKeeping {
    /// Takes an action, to these effects; what the episode goes on with is left in the sum.
    pub(super) fn take(
        &self,
        full: &mut Sum,
        action: ActionId,
        step: usize,
        effects: &EffectTable,
    ) -> Acted {
        let count = full.components.len();
        let mut acted = Acted::default();
        let mut moved = Vec::with_capacity(full.components.len());
        let room = 3 * self.most.max(full.components.len());
        for component in std::mem::take(&mut full.components) {
            let before = moved.len();
            let doing = self.doing(component.mode, action, step);
            let effects = effects.at(step, component.mode, action);
            acted.reward += component.weight * self.running_cost(&component, action);
            let whole = Part {
                component,
                happened: false,
            };
            let own = self.model.actions[action].then;
            for part in self.happen(whole, effects, When::Before, own, doing, &mut acted) {
                let happened = part.happened;
                let room = room.saturating_sub(moved.len());
                let mut stopped = self.moved(part.component, doing, room);
                self.likeness.reduce_from(&mut stopped, 0, PARTS);
                for component in stopped {
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
            self.likeness.reduce_from(&mut moved, before, PARTS);
        }
        normalise(&mut moved);
        full.components = moved;
        if full.components.len() > count {
            self.likeness.reduce(&mut full.components, CUT * self.most);
        }
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
        let component = &part.component;
        let Some(formula) = &effect.formula else {
            return component.weight * effect.reward * component.probability(&effect.region);
        };
        let mut value =
            |state: &[f64]| effect.reward + formula.value(&self.dynamics.point(doing, state));
        if component.dim() == 1 && component.covariance[0] > 0.0 {
            return component.weight * on_a_line(component, effect.region.side(0), &mut value);
        }
        match component.clone().cut(&effect.region).0 {
            Some(inside) => inside.weight * self.expected(&inside, &mut value),
            None => 0.0,
        }
    }

    /// Expectation of a function that is not too rough.
    fn expected(&self, component: &Component, of: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
        let frame = Frame::new(component);
        if frame.rank == 0 {
            return of(&component.mean);
        }
        let mut at = component.mean.clone();
        let rule = match (frame.rank, component.dim()) {
            (2, 2) => &self.fine,
            (rank, _) => &self.posterior[rank - 1],
        };
        let each = rule.iter().map(|(z, weight)| {
            frame.place(z, &mut at);
            weight * of(&at)
        });
        each.sum()
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
}

/// Integral of a function under a Gaussian on the line, over an interval.
fn on_a_line(component: &Component, side: Interval, of: &mut dyn FnMut(&[f64]) -> f64) -> f64 {
    let (mean, sd) = (component.mean[0], component.covariance[0].sqrt());
    let low = ((side.low - mean) / sd).max(-REACH);
    let high = ((side.high - mean) / sd).min(REACH);
    if low >= high {
        return 0.0;
    }
    let width = (high - low) / PAID as f64;
    let each = (0..PAID).map(|k| {
        let z = low + width * (k as f64 + 0.5);
        width * normal_density(z) * of(&[mean + sd * z])
    });
    each.sum()
}
