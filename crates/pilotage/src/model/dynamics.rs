//! A model as it is at a point: where a step leads from one state, and what is sensed in it. World, trackers and planners that keep
//! beliefs of any kind ask nothing else, so that linear motion and formulas are one thing to them.

use nalgebra::DMatrix;

use super::law::{Case, Formula, Point, VariableKind};
use super::{ActionId, Barriers, Interval, ModeId, Model, WallBelief};

/// In which mode an action is taken, and at which step of the episode. Of what is sensed after it, the mode is that afterwards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Doing {
    /// The mode.
    pub mode: ModeId,
    /// The action.
    pub action: ActionId,
    /// Step of the episode at which it is taken, from 0.
    pub step: usize,
}

/// Motion and sensing of a model, point by point. States have length `n`, readings `m`; matrices are written row by row.
#[derive(Debug, Clone)]
pub struct Dynamics {
    states: usize,
    readings: usize,
    symbols: usize,
    modes: usize,
    actions: usize,
    /// Steps at which later phases begin.
    later: Vec<usize>,
    /// By phase, mode and action.
    rules: Vec<Rule>,
    controls: Vec<Vec<f64>>,
    kinds: Vec<VariableKind>,
    saturates: Vec<Interval>,
    walls: Option<Barriers>,
}

/// Motion and sensing in a phase, in a mode, on an action.
#[derive(Debug, Clone)]
struct Rule {
    /// `A`, row by row.
    a: Vec<f64>,
    /// `B u + d`.
    shift: Vec<f64>,
    step: Vec<Option<Formula>>,
    motion_noise: Noise,
    /// `H`, row by row.
    h: Vec<f64>,
    read: Vec<Formula>,
    sensor_noise: Noise,
    symbols: Vec<Formula>,
    present: Formula,
}

/// A covariance, row by row.
#[derive(Debug, Clone)]
enum Noise {
    Constant(Vec<f64>),
    Varying {
        formulas: Vec<Formula>,
        /// The first entry of which the formula is that of each entry: what is written more than once is evaluated once.
        first: Vec<usize>,
    },
}

impl Noise {
    fn new(own: Option<&DMatrix<Formula>>, else_: &DMatrix<f64>) -> Self {
        let Some(own) = own else {
            return Self::Constant(else_.transpose().as_slice().to_vec());
        };
        let entries = own.transpose().as_slice().to_vec();
        let numbers: Option<Vec<f64>> = entries.iter().map(Formula::constant).collect();
        if let Some(numbers) = numbers {
            return Self::Constant(numbers);
        }
        let same = |(i, entry)| entries.iter().position(|other| other == entry).unwrap_or(i);
        let first = entries.iter().enumerate().map(same).collect();
        Self::Varying {
            formulas: entries,
            first,
        }
    }

    fn write(&self, point: &Point<'_>, to: &mut [f64]) {
        match self {
            Self::Constant(numbers) => to.copy_from_slice(numbers),
            Self::Varying { formulas, first } => {
                for (i, (formula, &first)) in formulas.iter().zip(first).enumerate() {
                    to[i] = match first < i {
                        true => to[first],
                        false => formula.value(point),
                    };
                }
            }
        }
    }
}

impl Rule {
    fn new(model: &Model, step: usize, mode: ModeId, action: ActionId) -> Self {
        let (motion, sensor) = (model.motion_at(step), model.sensor_at(step));
        let cases: Vec<&Case> = model.laws.cases.iter().rev().collect();
        let cases = || cases.iter().filter(|case| case.applies(mode, action));
        let by_row = |matrix: &DMatrix<f64>| matrix.transpose().as_slice().to_vec();
        let n = model.state_dim();
        let own = cases().find_map(|case| case.motion.b.as_ref());
        let drift = cases().find_map(|case| case.motion.drift.as_ref());
        let moved = own.unwrap_or(&motion.b) * &model.actions[action].control
            + drift.unwrap_or(&motion.drift);
        let a = cases().find_map(|case| case.motion.a.as_ref());
        let h = cases().find_map(|case| case.sensor.h.as_ref());
        // A matrix stated for a case stands in the way of the formulas of those before it.
        let stepping = |i: usize| {
            let said = cases().find_map(|case| match case.motion.step.get(i).cloned().flatten() {
                Some(formula) => Some(Some(formula)),
                None => (case.motion.a.is_some() || case.motion.b.is_some()).then_some(None),
            });
            said.flatten()
        };
        let read = cases().find_map(|case| match case.sensor.read.is_empty() {
            false => Some(case.sensor.read.clone()),
            true => case.sensor.h.is_some().then(Vec::new),
        });
        let noise = cases().find_map(|case| case.motion.noise.as_ref());
        let heard = cases().find_map(|case| case.sensor.noise.as_ref());
        let symbols = cases().find(|case| !case.sensor.symbols.is_empty());
        let present = cases().find_map(|case| case.sensor.present.as_ref());
        Self {
            a: by_row(a.unwrap_or(&motion.a)),
            shift: moved.as_slice().to_vec(),
            step: (0..n).map(stepping).collect(),
            motion_noise: Noise::new(noise, model.motion_noise(action, step)),
            h: by_row(h.unwrap_or(&sensor.h)),
            read: read.unwrap_or_default(),
            sensor_noise: Noise::new(heard, model.sensor_noise(action, step)),
            symbols: symbols.map_or_else(Vec::new, |case| case.sensor.symbols.clone()),
            present: present.map_or(Formula::Number(sensor.present), Clone::clone),
        }
    }
}

impl Dynamics {
    /// Motion and sensing of a model, with its walls where its belief knows of them.
    pub fn new(model: &Model) -> Self {
        let rules = model.phases().flat_map(|step| {
            (0..model.modes.len()).flat_map(move |mode| {
                (0..model.actions.len()).map(move |action| Rule::new(model, step, mode, action))
            })
        });
        Self {
            states: model.state_dim(),
            readings: model.sensor_dim(),
            symbols: model.laws.symbols.len(),
            modes: model.modes.len(),
            actions: model.actions.len(),
            later: model.phases().skip(1).collect(),
            rules: rules.collect(),
            controls: model
                .actions
                .iter()
                .map(|action| action.control.as_slice().to_vec())
                .collect(),
            kinds: model.state.iter().map(|variable| variable.kind).collect(),
            saturates: model.laws.saturates.clone(),
            walls: (model.belief.walls == WallBelief::Clip).then(|| Barriers::new(model)),
        }
    }

    /// Number of state variables, `n`.
    pub fn states(&self) -> usize {
        self.states
    }

    /// Number of readings, `m`; 0 for a discrete sensor.
    pub fn readings(&self) -> usize {
        self.readings
    }

    /// Number of signals of a discrete sensor; 0 for one that is read in numbers.
    pub fn symbols(&self) -> usize {
        self.symbols
    }

    /// Number of modes.
    pub fn modes(&self) -> usize {
        self.modes
    }

    /// Number of actions.
    pub fn actions(&self) -> usize {
        self.actions
    }

    /// Every action in every mode, at the first step of an episode.
    pub(crate) fn doings(&self) -> impl Iterator<Item = Doing> + use<> {
        let actions = self.actions;
        let of = move |mode| {
            (0..actions).map(move |action| Doing {
                mode,
                action,
                step: 0,
            })
        };
        (0..self.modes).flat_map(of)
    }

    fn rule(&self, doing: Doing) -> &Rule {
        let phase = self.later.partition_point(|from| *from <= doing.step);
        &self.rules[(phase * self.modes + doing.mode) * self.actions + doing.action]
    }

    /// The point at which formulas are asked for an action in a state.
    pub fn point<'a>(&'a self, doing: Doing, state: &'a [f64]) -> Point<'a> {
        Point {
            state,
            control: &self.controls[doing.action],
            step: doing.step,
        }
    }

    /// Writes to `to` where an action leads from a state, noise, walls and rounding apart.
    pub fn transition(&self, doing: Doing, state: &[f64], to: &mut [f64]) {
        let rule = self.rule(doing);
        let point = self.point(doing, state);
        let rows = rule.a.chunks_exact(self.states).zip(&rule.shift);
        for ((value, (row, shift)), step) in to.iter_mut().zip(rows).zip(&rule.step) {
            *value = match step {
                Some(formula) => formula.value(&point),
                None => dot(row, state) + shift,
            };
        }
    }

    /// `A`, row by row, and `B u + d`, where no formula moves the state.
    pub fn linear_transition(&self, doing: Doing) -> Option<(&[f64], &[f64])> {
        let rule = self.rule(doing);
        let linear = rule.step.iter().all(Option::is_none);
        linear.then_some((&rule.a, &rule.shift))
    }

    /// Writes the covariance of the noise that is added to it, `n x n`.
    pub fn transition_noise(&self, doing: Doing, state: &[f64], covariance: &mut [f64]) {
        let rule = self.rule(doing);
        rule.motion_noise
            .write(&self.point(doing, state), covariance);
    }

    /// The same where it does not depend on the state.
    pub fn constant_transition_noise(&self, doing: Doing) -> Option<&[f64]> {
        match &self.rule(doing).motion_noise {
            Noise::Constant(numbers) => Some(numbers),
            Noise::Varying { .. } => None,
        }
    }

    /// Moves a point that a step, noise included, has led to from a state to where it comes to rest: whole numbers are rounded, angles
    /// wrapped, and walls that the belief knows of stop the way.
    pub fn settle(&self, from: &[f64], to: &mut [f64]) {
        self.round(to);
        if let Some(walls) = &self.walls {
            walls.stop(from, to);
            // A wall may end between whole numbers.
            self.round_within(to);
        }
    }

    /// Rounds whole numbers and wraps angles.
    pub(crate) fn round(&self, state: &mut [f64]) {
        for (value, kind) in state.iter_mut().zip(&self.kinds) {
            match kind {
                VariableKind::Real => {}
                VariableKind::Integer => *value = value.round(),
                VariableKind::Angle => *value = wrapped(*value),
            }
        }
    }

    /// Wraps angles.
    pub(crate) fn wrap(&self, state: &mut [f64]) {
        for (value, kind) in state.iter_mut().zip(&self.kinds) {
            if *kind == VariableKind::Angle {
                *value = wrapped(*value);
            }
        }
    }

    pub(crate) fn round_within(&self, state: &mut [f64]) {
        for (i, kind) in self.kinds.iter().enumerate() {
            if *kind == VariableKind::Integer {
                state[i] = state[i].round();
            }
        }
    }

    /// What the values of each state variable are.
    pub fn kinds(&self) -> &[VariableKind] {
        &self.kinds
    }

    /// The walls that the belief knows of.
    pub(crate) fn walls(&self) -> Option<&Barriers> {
        self.walls.as_ref()
    }

    /// Writes what is read in a state, noise and saturation apart.
    pub fn observation(&self, doing: Doing, state: &[f64], reading: &mut [f64]) {
        let rule = self.rule(doing);
        if !rule.read.is_empty() {
            let point = self.point(doing, state);
            for (value, formula) in reading.iter_mut().zip(&rule.read) {
                *value = formula.value(&point);
            }
            return;
        }
        for (value, row) in reading.iter_mut().zip(rule.h.chunks_exact(self.states)) {
            *value = dot(row, state);
        }
    }

    /// `H`, row by row, where numbers are read and no formula says which.
    pub fn linear_observation(&self, doing: Doing) -> Option<&[f64]> {
        let rule = self.rule(doing);
        let linear = self.symbols == 0 && rule.read.is_empty();
        linear.then_some(&rule.h)
    }

    /// Writes the covariance of the noise that is added to it, `m x m`.
    pub fn observation_noise(&self, doing: Doing, state: &[f64], covariance: &mut [f64]) {
        let rule = self.rule(doing);
        rule.sensor_noise
            .write(&self.point(doing, state), covariance);
    }

    /// The same where it does not depend on the state.
    pub fn constant_observation_noise(&self, doing: Doing) -> Option<&[f64]> {
        match &self.rule(doing).sensor_noise {
            Noise::Constant(numbers) => Some(numbers),
            Noise::Varying { .. } => None,
        }
    }

    /// Ends at which readings saturate; empty where none does.
    pub fn saturates(&self) -> &[Interval] {
        &self.saturates
    }

    /// Writes how likely each signal of a discrete sensor is in a state.
    pub fn symbol_probabilities(&self, doing: Doing, state: &[f64], probabilities: &mut [f64]) {
        let point = self.point(doing, state);
        for (value, formula) in probabilities.iter_mut().zip(&self.rule(doing).symbols) {
            *value = formula.value(&point);
        }
    }

    /// Probability that there is a reading in a state.
    pub fn present(&self, doing: Doing, state: &[f64]) -> f64 {
        self.rule(doing).present.value(&self.point(doing, state))
    }

    /// The same where it does not depend on the state.
    pub fn constant_present(&self, doing: Doing) -> Option<f64> {
        self.rule(doing).present.constant()
    }
}

/// An angle in `[-pi, pi)`.
pub(crate) fn wrapped(angle: f64) -> f64 {
    use std::f64::consts::{PI, TAU};
    if (-PI..PI).contains(&angle) {
        return angle;
    }
    (angle + PI).rem_euclid(TAU) - PI
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
