//! The filter as it runs: a belief is an uncertainty level and a mean, its update two small matrix-vector products.

use nalgebra::DMatrix;

use super::levels::{LevelGraph, StratumId};
use super::memory::Memory;
use super::reading::Reading;
use super::recall::Recall;
use crate::model::{ActionId, Barriers, ModeId, Model, Switch, WallBelief};

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

/// Everything the update needs, in flat arrays; an update allocates nothing.
///
/// The mean is predicted, `m- = A m + B u`, and corrected, `m = m- + K (o - H m-)`, with the gain of the step of the level graph; where
/// the reading is missing the prediction stands.
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
    /// Per level and action: next level where the reading is missing.
    pub(crate) blind: Vec<StratumId>,
    /// Per level and action: `K`, column by column.
    pub(crate) gains: Vec<f64>,
    /// Per level: the step of the episode at which it is held, up to the model's clock.
    pub(crate) times: Vec<usize>,
    /// Steps at which later phases of the model begin.
    pub(crate) later: Vec<usize>,
    /// Per level: the phase in which it is held.
    pub(crate) phases: Vec<usize>,
    /// Per phase: `A`, row by row.
    pub(crate) motion: Vec<f64>,
    /// Per phase and action: `B u`.
    pub(crate) displacements: Vec<f64>,
    /// Per phase: `H`, row by row.
    pub(crate) sensor: Vec<f64>,
    pub(crate) actions: usize,
    /// How the mode changes.
    pub(crate) memory: Memory,
    /// The walls, where the belief knows of them.
    pub(crate) walls: Option<Barriers>,
}

impl Filter {
    /// The filter of a model that starts at the given belief, with the mode changes the model's events imply.
    pub fn new(model: &Model, levels: &LevelGraph, start: &Belief) -> Self {
        Self::with_switches(model, levels, start, model.switches())
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
        let mut blind = Vec::with_capacity(levels.len() * actions);
        let mut gains = Vec::with_capacity(levels.len() * actions * states * readings);
        for level in 0..levels.len() {
            for action in 0..actions {
                let step = levels.step(level, levels.class_of(action));
                next.push(step.next);
                blind.push(step.blind);
                gains.extend(step.correction.gain.iter());
            }
        }
        let by_row = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        let displacement = |(step, action)| model.displacement(action, step).as_slice().to_vec();
        let phase = |level| model.phase(levels.time(level));
        Self {
            states,
            readings,
            start: (start.stratum, start.mode, start.mean.clone()),
            next,
            blind,
            gains,
            times: (0..levels.len()).map(|level| levels.time(level)).collect(),
            later: model.phases().skip(1).collect(),
            phases: (0..levels.len()).map(phase).collect(),
            motion: model
                .phases()
                .flat_map(|step| by_row(&model.motion_at(step).a))
                .collect(),
            displacements: model
                .phases()
                .flat_map(|step| (0..actions).map(move |action| (step, action)))
                .flat_map(displacement)
                .collect(),
            sensor: model
                .phases()
                .flat_map(|step| by_row(&model.sensor_at(step).h))
                .collect(),
            actions,
            memory: Memory::Switches(switches),
            walls: (model.belief.walls == WallBelief::Clip).then(|| Barriers::new(model)),
        }
    }

    /// The same filter with modes that are what is remembered of clusters, from the start on.
    pub fn recalling(mut self, recall: Recall) -> Self {
        self.start.1 = recall.first(&self.start.2);
        self.memory = Memory::Recall(recall);
        self
    }

    /// The same filter with another start; its level is one of the same level graph.
    pub(crate) fn starting_at(mut self, start: &Belief) -> Self {
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

    /// Moves the belief on by one action and what was sensed after it: `m` numbers, or nothing. `scratch` has length `n`.
    pub fn update<'a>(
        &self,
        belief: &mut Belief,
        action: ActionId,
        reading: impl Into<Reading<'a>>,
        scratch: &mut [f64],
    ) {
        let time = self.times[belief.stratum];
        let before = self.memory.before(belief, action, time);
        let (n, edge) = (self.states, self.edge(belief.stratum, action));
        let phase = self.phases[belief.stratum];
        self.predict(belief, action, scratch);
        belief.mean.copy_from_slice(scratch);
        belief.stratum = match reading.into() {
            Reading::Values(observation) => {
                let size = n * self.readings;
                let gain = &self.gains[edge * size..(edge + 1) * size];
                let columns = gain.chunks_exact(n).zip(observation).enumerate();
                for (reading, (column, &observed)) in columns {
                    let innovation = observed - self.sensed(phase, scratch, reading);
                    for (value, gain) in belief.mean.iter_mut().zip(column) {
                        *value += gain * innovation;
                    }
                }
                self.next[edge]
            }
            Reading::Symbol(_) | Reading::Nothing => self.blind[edge],
        };
        for value in &mut belief.mean {
            *value = value.clamp(-LARGEST, LARGEST);
        }
        if let Some(walls) = &self.walls {
            walls.confine(&mut belief.mean);
        }
        belief.mode = self
            .memory
            .after(before, belief, (action, time), &belief.mean);
    }

    /// Writes the mean expected after an action, before anything is sensed, to `predicted` (length `n`).
    pub fn predict(&self, belief: &Belief, action: ActionId, predicted: &mut [f64]) {
        let (n, phase) = (self.states, self.phases[belief.stratum]);
        let motion = &self.motion[phase * n * n..(phase + 1) * n * n];
        let row = phase * self.actions + action;
        let displacement = &self.displacements[row * n..(row + 1) * n];
        for ((value, row), shift) in predicted
            .iter_mut()
            .zip(motion.chunks_exact(n))
            .zip(displacement)
        {
            *value = shift + dot(row, &belief.mean);
        }
        if let Some(walls) = &self.walls {
            walls.stop(&belief.mean, predicted);
        }
    }

    /// What the sensor's reading of that number is expected to be at a state, after a step from a belief.
    pub(crate) fn expected_reading(&self, from: &Belief, state: &[f64], reading: usize) -> f64 {
        self.sensed(self.phases[from.stratum], state, reading)
    }

    fn sensed(&self, phase: usize, state: &[f64], reading: usize) -> f64 {
        let (n, row) = (self.states, phase * self.readings + reading);
        dot(&self.sensor[row * n..(row + 1) * n], state)
    }

    /// Number of a step of the level graph: levels one after the other, each with its actions.
    fn edge(&self, level: StratumId, action: ActionId) -> usize {
        level * self.actions + action
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
