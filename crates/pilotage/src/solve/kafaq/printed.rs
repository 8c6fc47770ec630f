//! The rules of Figure 4.5 as they are printed, made to run, for comparison.
//!
//! At every step the best action of the current region is compared with the action that exploration has just chosen. If they agree
//! the region is extended to the current mean; if not, a new region of `sqrt(P) / 16` around the mean is made, whether the mean lay
//! outside all regions (Generate) or inside one (Split). Exploration is noise, so regions are made without end, and merging, which
//! the text promises, is not in the figure. What the figure leaves open is decided so: the smallest region that holds the mean is
//! the current one, outside all the nearest; a new region inherits the values of the one it is made from; learning ends when the
//! number of regions has not changed for [`CALM`] steps, or at [`Settings::printed_limit`].

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::settings::Settings;
use super::task::{SOLVER, Task};
use super::{Learned, Learning, Point, RegionValue};
use crate::model::{ActionId, Then};
use crate::policy::{Automaton, Matching, Node, Place};
use crate::progress::Progress;
use crate::solve::learn::{Experience, boltzmann};

/// Steps without a new region that count as convergence.
const CALM: u64 = 1_000;
/// Half-width of the first region, in standard deviations of the start belief.
const START_WIDTH: f64 = 2.5;

#[derive(Debug, Serialize, Deserialize)]
struct Region {
    place: Place,
    values: Vec<f64>,
    visits: Vec<f64>,
}

impl Region {
    fn around(mean: &[f64], half: &[f64], values: Vec<f64>) -> Self {
        Self {
            place: Place::Segment {
                lower: mean.iter().zip(half).map(|(m, h)| m - h).collect(),
                minimum: mean.to_vec(),
                upper: mean.iter().zip(half).map(|(m, h)| m + h).collect(),
            },
            visits: vec![0.0; values.len()],
            values,
        }
    }

    fn fits(&self, states: usize, actions: usize) -> bool {
        let Place::Segment {
            lower,
            minimum,
            upper,
        } = &self.place
        else {
            return false;
        };
        let sides = [lower, minimum, upper];
        sides.iter().all(|side| side.len() == states)
            && (0..states).all(|i| lower[i] <= minimum[i] && minimum[i] <= upper[i])
            && self.values.len() == actions
            && self.visits.len() == actions
            && self.visits.iter().all(|visits| *visits >= 0.0)
    }

    fn best(&self) -> ActionId {
        let better = |best, action| {
            if self.values[action] > self.values[best] {
                action
            } else {
                best
            }
        };
        (1..self.values.len()).fold(0, better)
    }

    /// ExtendRegion.
    fn extend(&mut self, mean: &[f64]) {
        if let Place::Segment { lower, upper, .. } = &mut self.place {
            for i in 0..mean.len() {
                lower[i] = lower[i].min(mean[i]);
                upper[i] = upper[i].max(mean[i]);
            }
        }
    }
}

/// All that a run has to remember between two episodes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct State {
    experience: Experience,
    regions: Vec<Region>,
    temperature: f64,
    curve: Vec<Point>,
    /// Steps without a new region.
    calm: u64,
    /// Sum since the last point of the curve.
    reward: f64,
}

impl State {
    pub(super) fn new(task: &Task<'_>) -> Self {
        Self {
            experience: Experience::default(),
            regions: vec![first_region(task)],
            temperature: task.settings.hot,
            curve: Vec::new(),
            calm: 0,
            reward: 0.0,
        }
    }

    /// Whether it is one that a task can have.
    pub(super) fn fits(&self, task: &Task<'_>) -> bool {
        let settings = &task.settings;
        let (states, actions) = (task.body().state_dim(), task.actions());
        let point = |point: &Point| {
            point.memory == 0 && point.regions.iter().all(|r| r.fits(states, actions))
        };
        self.experience.fits(states)
            && !self.regions.is_empty()
            && self
                .regions
                .iter()
                .all(|region| region.fits(states, actions))
            && (settings.cold..=settings.hot).contains(&self.temperature)
            && self.curve.iter().all(point)
    }

    fn is_over(&self, task: &Task<'_>) -> bool {
        let (step_limit, region_limit) = task.settings.printed_limit;
        self.calm >= CALM
            || self.experience.samples >= step_limit as u64
            || self.regions.len() >= region_limit
    }

    /// SegmentSteadyLevel by the printed rules: an episode.
    pub(super) fn advance(&mut self, task: &Task<'_>, observer: &dyn Progress) -> ControlFlow<()> {
        if self.is_over(task) {
            return ControlFlow::Break(());
        }
        let settings = &task.settings;
        let step_limit = settings.printed_limit.0 as u64;
        observer.progress("steps", self.experience.samples, step_limit);
        let half: Vec<f64> = task
            .deviations()
            .iter()
            .map(|d| settings.printed_width * d)
            .collect();
        let mut actor = task.actor();
        let (mut draws, mut exploration) = self.experience.next_episode(settings.seed);
        actor.reset(&mut draws);
        let mut previous: Option<(usize, ActionId, f64)> = None;
        for _ in 0..task.body().episode.length {
            if self.is_over(task) {
                break;
            }
            let regions = &mut self.regions;
            let mean = actor.belief().mean.clone();
            let current = find_current_segment(regions, &mean);
            if let Some((before, action, reward)) = previous {
                let next = regions[current].values[regions[current].best()];
                let target = reward + task.discount() * next;
                td_update(settings, &mut regions[before], action, target);
            }
            let heat = self.temperature * self.experience.reward_range();
            let values = &regions[current].values;
            let action = boltzmann(values, heat, settings.explore, &mut exploration);
            let mut acting = current;
            if action == regions[current].best() {
                regions[current].extend(&mean);
                self.calm += 1;
            } else {
                // GenerateNewRegion outside all regions, SplitRegion inside: the figure does the same in both.
                regions.push(Region::around(&mean, &half, values.clone()));
                acting = regions.len() - 1;
                self.calm = 0;
            }
            let at_steady = actor.belief().stratum == task.steady();
            let step = actor.step(action, &mut draws);
            self.experience.collect(step.reward);
            self.reward += step.reward;
            if step.then == Then::End {
                td_update(settings, &mut regions[acting], action, step.reward);
                break;
            }
            previous = at_steady.then_some((acting, action, step.reward));
            if self
                .experience
                .samples
                .is_multiple_of(settings.epoch as u64)
            {
                self.temperature = (self.temperature * settings.cooling).max(settings.cold);
                let reward = self.reward / settings.epoch as f64;
                self.curve
                    .push(point(task, regions, self.experience.samples, reward));
                self.reward = 0.0;
                observer.progress("steps", self.experience.samples, step_limit);
            }
        }
        match self.is_over(task) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    pub(super) fn learned(&self, task: &Task<'_>) -> Learned {
        Learned {
            automaton: compile(task, &self.regions),
            converged: self.calm >= CALM,
            samples: self.experience.samples,
            learning: Learning {
                memory: "no memory".to_owned(),
                adopted: 0,
                curve: self.curve.clone(),
            },
        }
    }
}

/// The initial belief range, inside the world.
fn first_region(task: &Task<'_>) -> Region {
    let (start, model) = (task.space.start(), task.body());
    let covariance = task.space.covariance(start.stratum);
    let half: Vec<f64> = (0..start.mean.len())
        .map(|i| START_WIDTH * covariance[(i, i)].sqrt())
        .collect();
    let mut region = Region::around(&start.mean, &half, vec![0.0; task.actions()]);
    if let Place::Segment { lower, upper, .. } = &mut region.place {
        for (i, variable) in model.state.iter().enumerate() {
            lower[i] = lower[i].max(variable.bounds.low);
            upper[i] = upper[i].min(variable.bounds.high);
        }
    }
    region
}

/// The smallest region around a mean, or else the nearest.
fn find_current_segment(regions: &[Region], mean: &[f64]) -> usize {
    let scale = vec![1.0; mean.len()];
    let mut best = (0, f64::INFINITY, f64::INFINITY);
    for (i, region) in regions.iter().enumerate() {
        let (distance, volume) = (region.place.distance(mean, &scale), region.place.volume());
        if distance < best.1 || (distance == best.1 && volume < best.2) {
            best = (i, distance, volume);
        }
    }
    best.0
}

fn td_update(settings: &Settings, region: &mut Region, action: ActionId, target: f64) {
    region.visits[action] += 1.0;
    let rate = (1.0 + region.visits[action])
        .powf(-settings.rate_power)
        .max(settings.rate_floor);
    region.values[action] += rate * (target - region.values[action]);
}

fn corners(region: &Region) -> (Vec<f64>, Vec<f64>) {
    match &region.place {
        Place::Segment { lower, upper, .. } => (lower.clone(), upper.clone()),
        Place::Point(point) => (point.clone(), point.clone()),
    }
}

fn point(task: &Task<'_>, regions: &[Region], samples: u64, reward: f64) -> Point {
    let value = |region: &Region| {
        let (lower, upper) = corners(region);
        RegionValue {
            memory: 0,
            stratum: task.steady(),
            lower,
            upper,
            action: region.best(),
            value: region.values[region.best()],
        }
    };
    Point {
        memory: 0,
        samples,
        reward,
        regions: regions.iter().map(value).collect(),
    }
}

fn compile(task: &Task<'_>, regions: &[Region]) -> Automaton {
    let mut automaton = Automaton::new(task.space.as_ref(), SOLVER, Matching::Segments);
    automaton.fingerprint = task.fingerprint;
    let levels = task.chain[0]..=task.steady();
    let node = |region: &Region| {
        let best = region.best();
        Node::new(
            levels.clone(),
            0,
            region.place.clone(),
            best,
            Some(region.values[best]),
        )
    };
    automaton.nodes = regions.iter().map(node).collect();
    automaton
}
