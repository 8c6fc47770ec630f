//! What a model may say beyond linear motion and sensing: formulas, and cases by mode and by action.

use std::fmt;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::expression::Expression;
use super::{ActionId, Interval, ModeId};

/// Where, with what and when a [`Formula`] is asked.
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    /// The state, length `n`.
    pub state: &'a [f64],
    /// Control of the action, length `p`.
    pub control: &'a [f64],
    /// Step of the episode, from 0.
    pub step: usize,
}

/// Most numbers that a formula is told: state variables, controls and the step.
pub(crate) const MOST_TOLD: usize = 32;

const FEW_TOLD: usize = 6;

impl Point<'_> {
    /// The value of an expression here, with room for what it is told.
    fn tell(&self, expression: &Expression, told: &mut [f64]) -> f64 {
        let (n, p) = (self.state.len(), self.control.len());
        told[..n].copy_from_slice(self.state);
        told[n..n + p].copy_from_slice(self.control);
        told[n + p] = self.step as f64;
        expression.value(&told[..=n + p])
    }
}

/// A number that may depend on state, control and step.
#[derive(Debug, Clone, PartialEq)]
pub enum Formula {
    /// The same everywhere.
    Number(f64),
    /// An expression of the state variables by name, the controls `u1`, `u2`, ... and the step `t`.
    Written(Expression),
    /// A function of the program that embeds the library.
    Coded(Coded),
}

/// A function with a name, which stands for it where models are compared and in their fingerprints.
#[derive(Clone)]
pub struct Coded {
    name: String,
    function: Arc<dyn Fn(&Point<'_>) -> f64 + Send + Sync>,
}

impl Formula {
    /// A function under a name: two formulas of one name are taken for the same. Whether it depends on the step is found by asking it at the
    /// starts of a model.
    pub fn coded(name: &str, function: impl Fn(&Point<'_>) -> f64 + Send + Sync + 'static) -> Self {
        Self::Coded(Coded {
            name: name.to_owned(),
            function: Arc::new(function),
        })
    }

    /// Its value at a point.
    pub fn value(&self, point: &Point<'_>) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Coded(coded) => (coded.function)(point),
            Self::Written(expression) => {
                // Most models are told little, and much room takes long to clear.
                match point.state.len() + point.control.len() < FEW_TOLD {
                    true => point.tell(expression, &mut [0.0; FEW_TOLD]),
                    false => point.tell(expression, &mut [0.0; MOST_TOLD]),
                }
            }
        }
    }

    /// The number that it is everywhere, if it is one.
    pub fn constant(&self) -> Option<f64> {
        match self {
            Self::Number(value) => Some(*value),
            Self::Written(expression) => expression.constant(),
            Self::Coded(_) => None,
        }
    }

    /// Whether it says something else from step to step at these places: whether an expression names the step, or the values of a function
    /// differ up to so many steps.
    pub(crate) fn tells_steps(&self, places: &[Point<'_>], steps: usize) -> bool {
        places.iter().any(|place| match self {
            Self::Number(_) => false,
            Self::Written(expression) => expression.uses(place.state.len() + place.control.len()),
            Self::Coded(_) => {
                let at = |step| self.value(&Point { step, ..*place });
                let first = at(0);
                (1..=steps).any(|step| at(step) != first)
            }
        })
    }

    /// What it says, for people: the number, the expression, or the name of the function.
    pub fn text(&self) -> String {
        match self {
            Self::Number(value) => value.to_string(),
            Self::Written(expression) => expression.source().to_owned(),
            Self::Coded(coded) => coded.name.clone(),
        }
    }
}

impl PartialEq for Coded {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl fmt::Debug for Coded {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Coded({})", self.name)
    }
}

/// All that a model says beyond linear motion and sensing with Gaussian noise. The default says nothing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Laws {
    /// Where motion and sensing are others. All that apply count, later ones before earlier ones.
    pub cases: Vec<Case>,
    /// Names of the signals of a discrete sensor, one of which is heard after every step; empty where numbers are read.
    pub symbols: Vec<String>,
    /// Ends at which readings saturate, one interval for each of them; empty where none does.
    pub saturates: Vec<Interval>,
    /// Whether the agent sees the mode after every step.
    pub modes_seen: bool,
}

/// Motion and sensing in some modes, on some actions.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Case {
    /// Modes it applies to, for motion those in which the action is taken, for sensing those after it; `None` for all.
    pub modes: Option<Vec<ModeId>>,
    /// Actions it applies to; `None` for all.
    pub actions: Option<Vec<ActionId>>,
    /// What is different about the motion.
    pub motion: MotionLaw,
    /// What is different about the sensor.
    pub sensor: SensorLaw,
}

/// What is different about a motion; nothing of what is not given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MotionLaw {
    /// State transition, `n x n`.
    pub a: Option<DMatrix<f64>>,
    /// Control matrix, `n x p`.
    pub b: Option<DMatrix<f64>>,
    /// What is added at every step, length `n`.
    pub drift: Option<DVector<f64>>,
    /// The next value of each state variable, noise apart, instead of `A s + B u + d`; empty, or length `n`.
    pub step: Vec<Option<Formula>>,
    /// Process noise covariance, `n x n`.
    pub noise: Option<DMatrix<Formula>>,
}

/// What is different about a sensor; nothing of what is not given.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SensorLaw {
    /// Measurement matrix, `m x n`.
    pub h: Option<DMatrix<f64>>,
    /// What is read, noise apart, instead of `H s`; empty, or length `m`.
    pub read: Vec<Formula>,
    /// Measurement noise covariance, `m x m`.
    pub noise: Option<DMatrix<Formula>>,
    /// Probability of each of [`Laws::symbols`]; empty, or as many.
    pub symbols: Vec<Formula>,
    /// Probability that there is a reading.
    pub present: Option<Formula>,
}

/// What the values of a state variable are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum VariableKind {
    /// Any number.
    #[default]
    Real,
    /// Whole numbers: what a step leads to is rounded.
    Integer,
    /// An angle in radians, kept in `[-pi, pi)`.
    Angle,
}

impl Laws {
    /// All formulas in it.
    pub(crate) fn formulas(&self) -> impl Iterator<Item = &Formula> {
        self.cases.iter().flat_map(|case| {
            let (motion, sensor) = (&case.motion, &case.sensor);
            let noises = [&motion.noise, &sensor.noise];
            let noises = noises.into_iter().flatten().flat_map(|noise| noise.iter());
            let steps = motion.step.iter().flatten();
            let heard = sensor.read.iter().chain(&sensor.symbols);
            steps.chain(heard).chain(&sensor.present).chain(noises)
        })
    }
}

impl Case {
    /// Whether it applies in a mode, on an action.
    pub fn applies(&self, mode: ModeId, action: ActionId) -> bool {
        let holds = |list: &Option<Vec<usize>>, one| list.as_ref().is_none_or(|l| l.contains(&one));
        holds(&self.modes, mode) && holds(&self.actions, action)
    }
}
