//! The filter as it runs: a belief is an uncertainty level and a mean, its update two small matrix-vector products.

use super::levels::{LevelGraph, StratumId};
use super::recall::Recall;
use crate::model::{ActionId, Barriers, ModeId, Model, Region, WallBelief, When};

/// Largest magnitude of a mean, and of any number of a policy.
///
/// A step multiplies at most four numbers and adds up fewer than `(n + 1)^2 (m + 1)` such products for `n` state variables and `m` readings,
/// so that nothing in it is larger than `(n + 1)^2 (m + 1) LARGEST^4`, which is finite for every `n` and `m` that fit a memory.
pub const LARGEST: f64 = 1e60;

/// Whether a mean is one that an agent can act on: every component less than [`LARGEST`] in magnitude. One that is not has grown without
/// end, and was cut.
pub(crate) fn is_kept(mean: &[f64]) -> bool {
    mean.iter().all(|m| m.abs() < LARGEST)
}

/// What the agent knows: an uncertainty level, the mean at that level, and the hidden mode it takes to be the case.
#[derive(Debug, Clone, PartialEq)]
pub struct Belief {
    /// Everything else: for a linear model, the uncertainty level.
    pub stratum: StratumId,
    /// Hidden mode (or memory).
    pub mode: ModeId,
    /// Mean, length `n`.
    pub mean: Vec<f64>,
}

/// A change of mode that the agent infers from its own action and belief.
#[derive(Debug, Clone, PartialEq)]
pub struct Switch {
    /// Actions it happens on; `None` for all.
    pub actions: Option<Vec<ActionId>>,
    /// Mode it happens in; `None` for any.
    pub mode: Option<ModeId>,
    /// Where the mean must be.
    pub region: Region,
    /// Whether it must be there when the action is taken, or once what it brought has been sensed. Changes before come first.
    pub when: When,
    /// Mode afterwards.
    pub becomes: ModeId,
}

impl Switch {
    fn happens(&self, when: When, belief: &Belief, action: ActionId) -> bool {
        self.when == when
            && self.mode.is_none_or(|mode| mode == belief.mode)
            && self
                .actions
                .as_ref()
                .is_none_or(|actions| actions.contains(&action))
            && self.region.contains(&belief.mean)
    }
}

/// Everything the update needs, in flat arrays; an update allocates nothing.
///
/// The mean is predicted, `m- = A m + B u`, and corrected, `m = m- + K (o - H m-)`, with the gain of the step of the level graph.
/// Where the belief knows of walls, the prediction stops at them and the corrected mean is kept where a state can be.
///
/// A mean never leaves [`LARGEST`]; as long as no reading does either, and none of the filter's numbers, it stays finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    pub(crate) states: usize,
    pub(crate) readings: usize,
    /// Start level, mode and mean.
    pub(crate) start: (StratumId, ModeId, Vec<f64>),
    /// Per level and action: next level.
    pub(crate) next: Vec<StratumId>,
    /// Per level and action: `K`, column by column.
    pub(crate) gains: Vec<f64>,
    /// `A`, row by row.
    pub(crate) motion: Vec<f64>,
    /// Per action: `B u`.
    pub(crate) displacements: Vec<f64>,
    /// `H`, row by row.
    pub(crate) sensor: Vec<f64>,
    pub(crate) actions: usize,
    pub(crate) switches: Vec<Switch>,
    /// The walls, where the belief knows of them.
    pub(crate) walls: Option<Barriers>,
    /// Where it decides on modes, instead of the switches.
    pub(crate) recall: Option<Recall>,
}

impl Filter {
    /// The filter of a model that starts at the given belief, with the mode changes the model's events imply.
    pub fn new(model: &Model, levels: &LevelGraph, start: &Belief) -> Self {
        let switches = model
            .events
            .iter()
            .filter_map(|event| {
                let becomes = event.becomes?;
                Some(Switch {
                    actions: event.actions.clone(),
                    mode: event.mode,
                    region: event.region.clone(),
                    when: event.when,
                    becomes,
                })
            })
            .collect();
        Self::with_switches(model, levels, start, switches)
    }

    /// As [`Filter::new`], with mode changes of the caller's.
    pub fn with_switches(
        model: &Model,
        levels: &LevelGraph,
        start: &Belief,
        switches: Vec<Switch>,
    ) -> Self {
        let (states, readings, actions) = (
            model.state_dim(),
            model.observation_dim(),
            model.actions.len(),
        );
        let mut next = Vec::with_capacity(levels.len() * actions);
        let mut gains = Vec::with_capacity(levels.len() * actions * states * readings);
        for level in 0..levels.len() {
            for action in 0..actions {
                let step = levels.step(level, levels.class_of(action));
                next.push(step.next);
                gains.extend(step.correction.gain.iter());
            }
        }
        let displacement = |action| model.displacement(action).as_slice().to_vec();
        Self {
            states,
            readings,
            start: (start.stratum, start.mode, start.mean.clone()),
            next,
            gains,
            motion: model.motion.a.transpose().as_slice().to_vec(),
            displacements: (0..actions).flat_map(displacement).collect(),
            sensor: model.sensor.h.transpose().as_slice().to_vec(),
            actions,
            switches,
            walls: (model.belief.walls == WallBelief::Clip).then(|| Barriers::new(model)),
            recall: None,
        }
    }

    /// The same filter with modes that are what is remembered of clusters, from the start on.
    pub fn recalling(mut self, recall: Recall) -> Self {
        self.start.1 = recall.first(&self.start.2);
        self.recall = Some(recall);
        self.switches.clear();
        self
    }

    /// The same filter with another start; its level is one of the same level graph.
    pub fn starting_at(mut self, start: &Belief) -> Self {
        self.start = (start.stratum, start.mode, start.mean.clone());
        self
    }

    /// The belief before anything was observed.
    pub fn initial(&self) -> Belief {
        Belief {
            stratum: self.start.0,
            mode: self.start.1,
            mean: self.start.2.clone(),
        }
    }

    /// Puts a belief back to the start without allocating.
    pub fn reset(&self, belief: &mut Belief) {
        belief.stratum = self.start.0;
        belief.mode = self.start.1;
        belief.mean.copy_from_slice(&self.start.2);
    }

    /// Number of state variables.
    pub fn states(&self) -> usize {
        self.states
    }

    /// Number of sensor readings.
    pub fn readings(&self) -> usize {
        self.readings
    }

    /// Moves the belief on by one action and the observation (length `m`) that followed. `scratch` has length `n`.
    pub fn update(
        &self,
        belief: &mut Belief,
        action: ActionId,
        observation: &[f64],
        scratch: &mut [f64],
    ) {
        let before = self.switch(When::Before, belief, action);
        let (n, edge) = (self.states, self.edge(belief.stratum, action));
        self.predict(belief, action, scratch);
        belief.mean.copy_from_slice(scratch);
        let size = n * self.readings;
        let gain = &self.gains[edge * size..(edge + 1) * size];
        for (reading, (column, &observed)) in gain.chunks_exact(n).zip(observation).enumerate() {
            let innovation = observed - self.sensed(scratch, reading);
            for (value, gain) in belief.mean.iter_mut().zip(column) {
                *value += gain * innovation;
            }
        }
        for value in &mut belief.mean {
            *value = value.clamp(-LARGEST, LARGEST);
        }
        if let Some(walls) = &self.walls {
            walls.confine(&mut belief.mean);
        }
        belief.stratum = self.next[edge];
        if let Some(recall) = &self.recall {
            belief.mode = recall.next(belief.mode, action, &belief.mean);
            return;
        }
        let becomes = before.or_else(|| self.switch(When::After, belief, action));
        belief.mode = becomes.unwrap_or(belief.mode);
    }

    /// The mode afterwards of the first change that happens.
    fn switch(&self, when: When, belief: &Belief, action: ActionId) -> Option<ModeId> {
        let mut switches = self.switches.iter();
        let switch = switches.find(|switch| switch.happens(when, belief, action));
        switch.map(|switch| switch.becomes)
    }

    /// Writes the mean expected after an action, before anything is sensed, to `predicted` (length `n`).
    pub fn predict(&self, belief: &Belief, action: ActionId, predicted: &mut [f64]) {
        let n = self.states;
        let displacement = &self.displacements[action * n..(action + 1) * n];
        for ((value, row), shift) in predicted
            .iter_mut()
            .zip(self.motion.chunks_exact(n))
            .zip(displacement)
        {
            *value = shift + dot(row, &belief.mean);
        }
        if let Some(walls) = &self.walls {
            walls.stop(&belief.mean, predicted);
        }
    }

    /// What the sensor's reading of that number is expected to be at a state.
    pub fn sensed(&self, state: &[f64], reading: usize) -> f64 {
        let n = self.states;
        dot(&self.sensor[reading * n..(reading + 1) * n], state)
    }

    /// Number of a step of the level graph: levels one after the other, each with its actions.
    fn edge(&self, level: StratumId, action: ActionId) -> usize {
        level * self.actions + action
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
