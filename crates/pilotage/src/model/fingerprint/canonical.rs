//! The canonical bytes of a model, field by field.

use nalgebra::{DMatrix, DVector};

use super::super::*;
use crate::digest::Digest;

/// Something that is the same bytes everywhere, in every version.
pub(crate) trait Canonical {
    fn write(&self, digest: &mut Digest);
}

/// The fields of a table.
pub(crate) struct Fields<'a>(pub &'a mut Digest);

impl Fields<'_> {
    pub(crate) fn field(self, name: &str, value: &(impl Canonical + ?Sized)) -> Self {
        name.write(self.0);
        value.write(self.0);
        self
    }

    /// A field that is left out where it has its default.
    pub(crate) fn unless<T: Canonical + PartialEq>(
        self,
        default: &T,
        name: &str,
        value: &T,
    ) -> Self {
        if value == default {
            return self;
        }
        self.field(name, value)
    }

    /// A field that is left out where there is none.
    pub(crate) fn given<T: Canonical>(self, name: &str, value: Option<&T>) -> Self {
        match value {
            Some(value) => self.field(name, value),
            None => self,
        }
    }

    /// A list that is left out where it is empty.
    pub(crate) fn list<T: Canonical>(self, name: &str, list: &[T]) -> Self {
        if list.is_empty() {
            return self;
        }
        self.field(name, list)
    }

    pub(crate) fn end(self) {
        "".write(self.0);
    }
}

impl Canonical for f64 {
    fn write(&self, digest: &mut Digest) {
        digest.write(&(self + 0.0).to_bits().to_le_bytes());
    }
}

impl Canonical for usize {
    fn write(&self, digest: &mut Digest) {
        digest.write(&(*self as u64).to_le_bytes());
    }
}

impl Canonical for str {
    fn write(&self, digest: &mut Digest) {
        self.len().write(digest);
        digest.write(self.as_bytes());
    }
}

impl Canonical for String {
    fn write(&self, digest: &mut Digest) {
        self.as_str().write(digest);
    }
}

impl<T: Canonical> Canonical for [T] {
    fn write(&self, digest: &mut Digest) {
        self.len().write(digest);
        self.iter().for_each(|item| item.write(digest));
    }
}

impl<T: Canonical> Canonical for Vec<T> {
    fn write(&self, digest: &mut Digest) {
        self.as_slice().write(digest);
    }
}

impl<T: Canonical> Canonical for Option<T> {
    fn write(&self, digest: &mut Digest) {
        digest.write(&[u8::from(self.is_some())]);
        self.iter().for_each(|value| value.write(digest));
    }
}

impl Canonical for DVector<f64> {
    fn write(&self, digest: &mut Digest) {
        self.as_slice().write(digest);
    }
}

impl Canonical for DMatrix<f64> {
    fn write(&self, digest: &mut Digest) {
        self.nrows().write(digest);
        self.ncols().write(digest);
        let entries = self
            .row_iter()
            .flat_map(|row| row.iter().copied().collect::<Vec<_>>());
        entries.for_each(|entry| entry.write(digest));
    }
}

impl Canonical for Interval {
    fn write(&self, digest: &mut Digest) {
        self.low.write(digest);
        self.high.write(digest);
    }
}

impl Canonical for Region {
    fn write(&self, digest: &mut Digest) {
        self.sides.len().write(digest);
        for (variable, interval) in &self.sides {
            variable.write(digest);
            interval.write(digest);
        }
    }
}

/// Kinds by name; those that a `match` does not name do not compile.
macro_rules! kinds {
    ($($kind:ident { $($name:ident => $text:literal),* })*) => {
        $(impl Canonical for $kind {
            fn write(&self, digest: &mut Digest) {
                match self { $($kind::$name => $text,)* }.write(digest);
            }
        })*
    };
}

kinds! {
    StartShape { Normal => "normal", Uniform => "uniform" }
    Then { Continue => "continue", End => "end", Restart => "restart" }
    When { Before => "before", After => "after" }
    WallBelief { Ignore => "ignore", Clip => "clip" }
    TrackerKind { Auto => "auto", Linear => "linear", Sum => "sum", Cells => "cells" }
    VariableKind { Real => "real", Integer => "integer", Angle => "angle" }
    HypothesisBelief { Collapse => "collapse", Gaussian => "gaussian", Track => "track" }
}

// Every field is named when a table is taken apart, so that one that is added does not compile until it is dealt with here.

impl Canonical for Model {
    fn write(&self, digest: &mut Digest) {
        let Self {
            name: _,
            about: _,
            discount,
            state,
            modes,
            start,
            motion,
            sensor,
            later,
            laws,
            actions,
            rewards,
            events,
            cost,
            episode,
            belief,
            map,
            text: _,
        } = self;
        let actions: Vec<ActionIn<'_>> = actions
            .iter()
            .map(|action| ActionIn {
                model: self,
                action,
            })
            .collect();
        Fields(digest)
            .field("discount", discount)
            .field("state", state)
            .unless(&vec![String::new()], "modes", modes)
            .field("start", start)
            .field("motion", motion)
            .field("sensor", sensor)
            .list("later", later)
            .unless(&Laws::default(), "laws", laws)
            .field("actions", &actions)
            .list("rewards", rewards)
            .list("events", events)
            .given("cost", cost.as_ref())
            .field("episode", episode)
            .field("belief", belief)
            .given("map", map.as_ref())
            .end();
    }
}

impl Canonical for StateVariable {
    fn write(&self, digest: &mut Digest) {
        let Self { name, bounds, kind } = self;
        Fields(digest)
            .field("name", name)
            .unless(&Interval::ALL, "bounds", bounds)
            .unless(&VariableKind::default(), "kind", kind)
            .end();
    }
}

impl Canonical for StartHypothesis {
    fn write(&self, digest: &mut Digest) {
        let Self {
            weight,
            mode,
            mean,
            covariance,
            shape,
        } = self;
        Fields(digest)
            .field("weight", weight)
            .unless(&0, "mode", mode)
            .field("mean", mean)
            .field("covariance", covariance)
            .unless(&StartShape::default(), "shape", shape)
            .end();
    }
}

impl Canonical for Motion {
    fn write(&self, digest: &mut Digest) {
        let Self { a, b, drift, noise } = self;
        Fields(digest)
            .field("A", a)
            .field("B", b)
            .unless(&DVector::zeros(drift.len()), "drift", drift)
            .field("noise", noise)
            .end();
    }
}

impl Canonical for Sensor {
    fn write(&self, digest: &mut Digest) {
        let Self { h, noise, present } = self;
        Fields(digest)
            .field("H", h)
            .field("noise", noise)
            .unless(&1.0, "present", present)
            .end();
    }
}

impl Canonical for bool {
    fn write(&self, digest: &mut Digest) {
        digest.write(&[u8::from(*self)]);
    }
}

impl Canonical for Formula {
    fn write(&self, digest: &mut Digest) {
        match self {
            Self::Number(value) => value.write(digest),
            Self::Written(expression) => expression.source().write(digest),
            Self::Coded(_) => self.text().write(digest),
        }
    }
}

impl Canonical for DMatrix<Formula> {
    fn write(&self, digest: &mut Digest) {
        self.nrows().write(digest);
        self.ncols().write(digest);
        self.transpose()
            .iter()
            .for_each(|entry| entry.write(digest));
    }
}

impl Canonical for Laws {
    fn write(&self, digest: &mut Digest) {
        let Self {
            cases,
            symbols,
            saturates,
            modes_seen,
        } = self;
        Fields(digest)
            .list("cases", cases)
            .list("symbols", symbols)
            .list("saturates", saturates)
            .unless(&false, "modes seen", modes_seen)
            .end();
    }
}

impl Canonical for Case {
    fn write(&self, digest: &mut Digest) {
        let Self {
            modes,
            actions,
            motion:
                MotionLaw {
                    a,
                    b,
                    drift,
                    step,
                    noise,
                },
            sensor:
                SensorLaw {
                    h,
                    read,
                    noise: sensor_noise,
                    symbols,
                    present,
                },
        } = self;
        Fields(digest)
            .given("modes", modes.as_ref())
            .given("actions", actions.as_ref())
            .given("A", a.as_ref())
            .given("B", b.as_ref())
            .given("drift", drift.as_ref())
            .list("step", step)
            .given("motion noise", noise.as_ref())
            .given("H", h.as_ref())
            .list("read", read)
            .given("sensor noise", sensor_noise.as_ref())
            .list("symbols", symbols)
            .given("present", present.as_ref())
            .end();
    }
}

impl Canonical for Phase {
    fn write(&self, digest: &mut Digest) {
        let Self {
            from,
            motion,
            sensor,
        } = self;
        Fields(digest)
            .field("from", from)
            .field("motion", motion)
            .field("sensor", sensor)
            .end();
    }
}

/// An action, with the model whose noise it has where it does not state its own.
struct ActionIn<'a> {
    model: &'a Model,
    action: &'a Action,
}

impl Canonical for ActionIn<'_> {
    fn write(&self, digest: &mut Digest) {
        let Action {
            name,
            control,
            motion_noise,
            sensor_noise,
            then,
        } = self.action;
        let (motion, sensor) = (&self.model.motion.noise, &self.model.sensor.noise);
        // What is the default now need not be that of a later phase.
        let changes = !self.model.later.is_empty();
        let own = |noise: &'_ &DMatrix<f64>, default: &DMatrix<f64>| changes || *noise != default;
        Fields(digest)
            .field("name", name)
            .field("control", control)
            .given(
                "motion noise",
                motion_noise.as_ref().filter(|noise| own(noise, motion)),
            )
            .given(
                "sensor noise",
                sensor_noise.as_ref().filter(|noise| own(noise, sensor)),
            )
            .unless(&Then::default(), "then", then)
            .end();
    }
}

impl Canonical for Steps {
    fn write(&self, digest: &mut Digest) {
        let Self { from, until } = self;
        let end = (*until != usize::MAX).then_some(*until);
        Fields(digest)
            .unless(&0, "from", from)
            .given("until", end.as_ref())
            .end();
    }
}

impl Canonical for Reward {
    fn write(&self, digest: &mut Digest) {
        let Self {
            actions,
            mode,
            region,
            when,
            steps,
            value,
            formula,
        } = self;
        Fields(digest)
            .given("actions", actions.as_ref())
            .given("mode", mode.as_ref())
            .unless(&Region::everywhere(), "region", region)
            .unless(&When::default(), "when", when)
            .unless(&Steps::ALL, "steps", steps)
            .field("value", value)
            .given("formula", formula.as_ref())
            .end();
    }
}

impl Canonical for Event {
    fn write(&self, digest: &mut Digest) {
        let Self {
            actions,
            mode,
            region,
            when,
            steps,
            probability,
            becomes,
            reward,
            then,
        } = self;
        Fields(digest)
            .given("actions", actions.as_ref())
            .given("mode", mode.as_ref())
            .unless(&Region::everywhere(), "region", region)
            .unless(&When::default(), "when", when)
            .unless(&Steps::ALL, "steps", steps)
            .unless(&1.0, "probability", probability)
            .given("becomes", becomes.as_ref())
            .unless(&0.0, "reward", reward)
            .unless(&Then::default(), "then", then)
            .end();
    }
}

impl Canonical for QuadraticCost {
    fn write(&self, digest: &mut Digest) {
        let Self {
            state,
            control,
            terminal,
        } = self;
        Fields(digest)
            .field("state", state)
            .field("control", control)
            .field("terminal", terminal)
            .end();
    }
}

impl Canonical for Episode {
    fn write(&self, digest: &mut Digest) {
        let Self {
            length,
            alive,
            failure_reward,
        } = self;
        Fields(digest)
            .field("length", length)
            .unless(&Region::everywhere(), "alive", alive)
            .unless(&0.0, "failure reward", failure_reward)
            .end();
    }
}

impl Canonical for BeliefSettings {
    fn write(&self, digest: &mut Digest) {
        let Self {
            level_tolerance,
            level_limit,
            walls,
            hypotheses,
            tracker,
            components,
            cells,
        } = self;
        Fields(digest)
            .field("level tolerance", level_tolerance)
            .field("level limit", level_limit)
            .unless(&WallBelief::default(), "walls", walls)
            .unless(&HypothesisBelief::default(), "hypotheses", hypotheses)
            .unless(&TrackerKind::default(), "tracker", tracker)
            .given("components", components.as_ref())
            .given("cells", cells.as_ref())
            .end();
    }
}

/// Everything else about a map follows from its drawing and the size of a cell.
impl Canonical for Map {
    fn write(&self, digest: &mut Digest) {
        Fields(digest)
            .field("cell", &self.cell)
            .field("rows", &self.rows)
            .end();
    }
}
