//! Uncertainty levels (thesis 4.2.3): the covariances a filter can have, known before anything is observed.
//!
//! With constant `A`, `H` and noise that depends on the action at most through a few classes (moving, listening, standing),
//! the covariance does not depend on what is observed. The levels form a small graph: a node is a covariance, an edge the
//! step of one noise class with its gain and innovation covariance.

use nalgebra::DMatrix;

use super::kalman::{Correction, square_root};
use super::nearby::Nearby;
use super::riccati::steady_state;
use crate::error::{Error, Result};
use crate::model::{ActionId, Model};

/// Covariances this close are the same number.
const SAME: f64 = 1e-9;

/// Most numbers that all levels and their steps may be.
const MOST_NUMBERS: usize = 1 << 26;

/// Where readings may be missing, levels would be without end: what a covariance is like depends on which of all readings before were
/// missing. Such levels are one if no entry differs by more than this share of the smallest variance.
const ALIKE: f64 = 0.01;

/// Index of a stratum: everything about a belief but its mode and its mean, one of finitely many. For a linear model it is an uncertainty
/// level.
pub type StratumId = usize;
/// Index of a noise class.
pub type ClassId = usize;

/// One step of a noise class from a level.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelStep {
    /// The level it leads to.
    pub next: StratumId,
    /// Whether there was no room for the level it should lead to, and `next` is the closest there is.
    pub cut: bool,
    /// The level it leads to if the reading is missing; only the closest there is where the model's readings always come.
    pub blind: StratumId,
    /// Gain, innovation covariance and the rest of the step.
    pub correction: Correction,
}

/// All levels that can be reached, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelGraph {
    covariances: Vec<DMatrix<f64>>,
    nearby: Nearby,
    /// By level: the step of an episode at which it is held, no more than `clock`.
    times: Vec<usize>,
    /// By step of an episode: how many levels are held at it.
    held: Vec<usize>,
    /// The step from which on levels no longer tell the time.
    clock: usize,
    /// Whether an episode is over at the clock's last step.
    ends: bool,
    /// Levels at which a class has come to rest.
    settled: Vec<bool>,
    /// Of each noise class, actions that disturb state and sensor in the same way, the first.
    classes: Vec<ActionId>,
    class_of_action: Vec<ClassId>,
    /// By level, then class.
    steps: Vec<Vec<LevelStep>>,
    starts: Vec<StratumId>,
    /// Whether every chain closed before the limit of levels.
    converged: bool,
    /// Most levels there is room for.
    room: usize,
    /// Whether there were more.
    cramped: bool,
}

impl LevelGraph {
    /// Levels reached from the start covariances by the model's actions.
    ///
    /// The covariance has converged when a step changes no entry by more than the model's `level_tolerance`: the level it then
    /// reaches is the steady one and repeats itself, at the exact solution of the Riccati equation where there is one. (With
    /// tolerance 5e-7 this is the counting rule that gives Table 4.1.) Other covariances within the tolerance of a level
    /// already found are that level.
    ///
    /// Where something in the model changes with the step of an episode, levels are told apart by the step at which they are held, up
    /// to the model's clock.
    pub fn new(model: &Model, starts: &[DMatrix<f64>]) -> Self {
        Self::within(model, starts, None)
    }

    /// The same for episodes of so many steps: levels tell the time up to the last, at which they are over.
    pub(crate) fn within(model: &Model, starts: &[DMatrix<f64>], horizon: Option<usize>) -> Self {
        let mut graph = Self::with_classes(model);
        graph.clock = horizon.unwrap_or_else(|| model.clock());
        graph.ends = horizon.is_some();
        let tolerance = model.belief.level_tolerance;
        for start in starts {
            let level = graph
                .nearest(start, tolerance, 0)
                .unwrap_or_else(|| graph.add(start.clone(), 0));
            graph.starts.push(level);
        }
        let mut level = 0;
        while level < graph.covariances.len() {
            for class in 0..graph.classes.len() {
                let step = graph.explore(model, level, class);
                graph.steps[level].push(step);
            }
            level += 1;
        }
        graph.lead_on_blindly(model);
        graph
    }

    fn with_classes(model: &Model) -> Self {
        let mut classes: Vec<ActionId> = Vec::new();
        let alike = |a: ActionId, b: ActionId| {
            model.phases().all(|step| {
                model.motion_noise(a, step) == model.motion_noise(b, step)
                    && model.sensor_noise(a, step) == model.sensor_noise(b, step)
            })
        };
        let class_of_action = (0..model.actions.len())
            .map(|action| {
                let known = classes.iter().position(|&example| alike(example, action));
                known.unwrap_or_else(|| {
                    classes.push(action);
                    classes.len() - 1
                })
            })
            .collect();
        let (n, m) = (model.state_dim(), model.observation_dim());
        let step = 2 * n * n + n * m + m * m;
        let room = MOST_NUMBERS / (n * n + classes.len() * step).max(1);
        Self {
            covariances: Vec::new(),
            nearby: Nearby::default(),
            times: Vec::new(),
            held: Vec::new(),
            clock: 0,
            ends: false,
            settled: Vec::new(),
            classes,
            class_of_action,
            steps: Vec::new(),
            starts: Vec::new(),
            converged: true,
            room,
            cramped: false,
        }
    }

    fn explore(&mut self, model: &Model, level: StratumId, class: ClassId) -> LevelStep {
        let (action, time) = (self.classes[class], self.times[level]);
        let correction = Correction::new(
            &model.motion_at(time).a,
            model.motion_noise(action, time),
            &model.sensor_at(time).h,
            model.sensor_noise(action, time),
            &self.covariances[level],
        );
        let (next, cut) = self.lead(model, level, class, &correction.covariance);
        let mut blind = level;
        // Where readings always come, the closest level is found once all are known.
        if model.sensor_at(time).present < 1.0 && !self.is_over(level) {
            let time = (time + 1).min(self.clock);
            blind = self.reach(model, level, &correction.predicted, time).0;
        }
        LevelStep {
            next,
            cut,
            blind,
            correction,
        }
    }

    /// How far the entries of a covariance may be from those of a level that it belongs to, at a time.
    fn tolerance(&self, model: &Model, covariance: &DMatrix<f64>, time: usize) -> f64 {
        let stated = model.belief.level_tolerance;
        let past = |step: usize| step < time || time == self.clock;
        let mut phases = model.phases();
        if !phases.any(|step| past(step) && model.sensor_at(step).present < 1.0) {
            return stated;
        }
        let variances = covariance.diagonal();
        let uncertain = variances.iter().filter(|variance| **variance > 0.0);
        let least = uncertain.fold(f64::INFINITY, |least, variance| least.min(*variance));
        match least.is_finite() {
            true => stated.max(ALIKE * least),
            false => stated,
        }
    }

    /// The level at a time with a covariance, a new one where there is none; the closest, and true, where there is no room.
    fn reach(
        &mut self,
        model: &Model,
        from: StratumId,
        covariance: &DMatrix<f64>,
        time: usize,
    ) -> (StratumId, bool) {
        match self.nearest(covariance, self.tolerance(model, covariance, time), time) {
            Some(found) => (found, false),
            None if self.has_room(model, time) => (self.add(covariance.clone(), time), false),
            None => {
                self.converged = false;
                self.cramped |= self.held_at(time) < model.belief.level_limit;
                (self.closest(covariance, time).unwrap_or(from), true)
            }
        }
    }

    /// Where a reading is missing that the model expects, the belief goes on at the closest level there is.
    fn lead_on_blindly(&mut self, model: &Model) {
        for level in 0..self.covariances.len() {
            if model.sensor_at(self.times[level]).present < 1.0 || self.is_over(level) {
                continue;
            }
            let time = (self.times[level] + 1).min(self.clock);
            for class in 0..self.classes.len() {
                let predicted = &self.steps[level][class].correction.predicted;
                let closest = self.closest(predicted, time);
                self.steps[level][class].blind = closest.unwrap_or(level);
            }
        }
    }

    /// The level that a step of a class leads to, with the covariance it leaves, and whether there was no room for it.
    fn lead(
        &mut self,
        model: &Model,
        level: StratumId,
        class: ClassId,
        covariance: &DMatrix<f64>,
    ) -> (StratumId, bool) {
        if self.is_over(level) {
            return (level, false);
        }
        let time = (self.times[level] + 1).min(self.clock);
        match self.reach(model, level, covariance, time) {
            (found, false) if found == level && !self.settled[level] => {
                (self.settle(model, class, covariance), false)
            }
            reached => reached,
        }
    }

    /// The steady level of a class whose covariance no longer changes by more than the tolerance.
    fn settle(&mut self, model: &Model, class: ClassId, covariance: &DMatrix<f64>) -> StratumId {
        let steady = self
            .steady_state(model, class)
            .unwrap_or_else(|_| covariance.clone());
        let steady = self
            .nearest(&steady, SAME, self.clock)
            .unwrap_or_else(|| self.add(steady, self.clock));
        self.settled[steady] = true;
        steady
    }

    fn add(&mut self, covariance: DMatrix<f64>, time: usize) -> StratumId {
        self.nearby
            .insert(&covariance, time, self.covariances.len());
        if self.held.len() <= time {
            self.held.resize(time + 1, 0);
        }
        self.held[time] += 1;
        self.covariances.push(covariance);
        self.times.push(time);
        self.settled.push(false);
        self.steps.push(Vec::with_capacity(self.classes.len()));
        self.covariances.len() - 1
    }

    /// Number of levels that are held at a time.
    fn held_at(&self, time: usize) -> usize {
        self.held.get(time).copied().unwrap_or(0)
    }

    /// Whether one more level can be held at a time.
    fn has_room(&self, model: &Model, time: usize) -> bool {
        self.held_at(time) < model.belief.level_limit && self.len() < self.room
    }

    /// The level closest to a covariance among those held at a time.
    fn closest(&self, covariance: &DMatrix<f64>, time: usize) -> Option<StratumId> {
        self.nearest(covariance, f64::INFINITY, time)
    }

    fn nearest(&self, covariance: &DMatrix<f64>, tolerance: f64, time: usize) -> Option<StratumId> {
        self.nearby
            .nearest(&self.covariances, covariance, tolerance, time)
    }

    /// Number of levels.
    pub fn len(&self) -> usize {
        self.covariances.len()
    }

    /// Never true: every model has a start.
    pub fn is_empty(&self) -> bool {
        self.covariances.is_empty()
    }

    /// Covariance of a level, `n x n`.
    pub fn covariance(&self, level: StratumId) -> &DMatrix<f64> {
        &self.covariances[level]
    }

    /// The step of an episode at which a level is held; where nothing changes with the step any more, the first of those steps.
    pub fn time(&self, level: StratumId) -> usize {
        self.times[level]
    }

    /// Whether an episode is over at a level.
    pub(crate) fn is_over(&self, level: StratumId) -> bool {
        self.ends && self.times[level] == self.clock
    }

    /// Covariance of the next mean around its prediction after a step of a class: `K S K'`. Where levels were cut, what the step
    /// would leave of the uncertainty is not what the level it leads to has, and the mean moves by the difference that is true of these
    /// two, `P- - P`, so that looking is not worth more than it tells.
    pub(crate) fn mean_covariance(&self, level: StratumId, class: ClassId) -> DMatrix<f64> {
        let step = &self.steps[level][class];
        if !step.cut {
            return step.correction.mean_covariance();
        }
        let root = square_root(&(&step.correction.predicted - &self.covariances[step.next]));
        &root * root.transpose()
    }

    /// Where a class's covariance comes to rest if its action is taken for ever, once the model's clock has run out.
    fn steady_state(&self, model: &Model, class: ClassId) -> Result<DMatrix<f64>> {
        let (action, time) = (self.classes[class], self.clock);
        steady_state(
            &model.motion_at(time).a,
            model.motion_noise(action, time),
            &model.sensor_at(time).h,
            model.sensor_noise(action, time),
        )
    }

    /// The first action of each noise class: actions of one disturb state and sensor in the same way.
    pub fn classes(&self) -> &[ActionId] {
        &self.classes
    }

    /// Noise class of an action.
    pub fn class_of(&self, action: ActionId) -> ClassId {
        self.class_of_action[action]
    }

    /// What one step of a class does at a level.
    pub fn step(&self, level: StratumId, class: ClassId) -> &LevelStep {
        &self.steps[level][class]
    }

    /// Levels of the start covariances, in the order given.
    pub fn starts(&self) -> &[StratumId] {
        &self.starts
    }

    /// Whether every chain of levels closed before the limit of levels.
    pub fn converged(&self) -> bool {
        self.converged
    }

    /// Checks that every covariance is one: finite, and positive semi-definite but for rounding.
    ///
    /// # Errors
    /// [`Error::Level`] for the first level or step that has none, with the entry and what to change; [`Error::TooManyLevels`] where there
    /// is no room for all of them.
    pub fn check(&self, model: &Model) -> Result<()> {
        if self.cramped {
            return Err(Error::TooManyLevels {
                levels: self.room,
                mebibytes: (MOST_NUMBERS * size_of::<f64>()) >> 20,
            });
        }
        for level in 0..self.len() {
            self.check_level(model, level)?;
            for (class, step) in self.steps[level].iter().enumerate() {
                let correction = &step.correction;
                for (what, matrix) in [
                    ("predicted covariance", &correction.predicted),
                    ("innovation covariance", &correction.innovation),
                    ("gain", &correction.gain),
                    ("covariance after it", &correction.covariance),
                ] {
                    if let Some((row, column)) = not_finite(matrix) {
                        let action = (0..self.class_of_action.len())
                            .find(|&action| self.class_of_action[action] == class)
                            .map_or("", |action| &model.actions[action].name);
                        return Err(Error::Level {
                            level,
                            what: format!("the {what} of the step by {action}"),
                            entry: format!("entry [{row}][{column}]"),
                            value: matrix[(row, column)],
                        });
                    }
                }
            }
        }
        Ok(())
    }

    fn check_level(&self, model: &Model, level: StratumId) -> Result<()> {
        /// Share of the largest entry that rounding may make negative.
        const ROUNDING: f64 = 1e-9;
        let covariance = &self.covariances[level];
        let name = |i: usize| &model.state[i].name;
        let fail = |entry: String, value: f64| {
            Err(Error::Level {
                level,
                what: "the covariance".to_owned(),
                entry,
                value,
            })
        };
        if let Some((row, column)) = not_finite(covariance) {
            let entry = format!("the entry of {} and {}", name(row), name(column));
            return fail(entry, covariance[(row, column)]);
        }
        let scale = covariance.amax();
        if scale == 0.0 {
            return Ok(());
        }
        let least = (covariance / scale).symmetric_eigenvalues().min();
        if least < -ROUNDING {
            return fail("the smallest eigenvalue".to_owned(), least * scale);
        }
        Ok(())
    }

    /// Checks that no uncertainty grows for ever. Levels that were cut at the limit while they still shrank will do.
    ///
    /// # Errors
    /// [`Error::NoSteadyState`], with the direction that grows.
    pub(crate) fn check_bounded(&self, model: &Model) -> Result<()> {
        if self.converged {
            return Ok(());
        }
        for id in 0..self.classes.len() {
            let grows = (0..self.len()).any(|level| {
                let LevelStep {
                    next, correction, ..
                } = &self.steps[level][id];
                *next == level && correction.covariance.trace() > self.covariances[level].trace()
            });
            match self.steady_state(model, id) {
                Err(error @ Error::NoSteadyState { .. }) if grows => return Err(error),
                _ => {}
            }
        }
        Ok(())
    }

    /// The level that repeats itself under a class, followed from a start; `None` where levels run in a circle or were cut.
    pub fn steady(&self, start: StratumId, class: ClassId) -> Option<StratumId> {
        let mut level = start;
        for _ in 0..=self.len() {
            let next = self.steps[level][class].next;
            if next == level {
                return self.converged.then_some(level);
            }
            level = next;
        }
        None
    }
}

/// Row and column of the first entry that is not finite.
fn not_finite(matrix: &DMatrix<f64>) -> Option<(usize, usize)> {
    let entries = (0..matrix.nrows()).flat_map(|i| (0..matrix.ncols()).map(move |j| (i, j)));
    entries
        .into_iter()
        .find(|&entry| !matrix[entry].is_finite())
}
