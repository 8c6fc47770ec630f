//! An upper bound on what any policy can earn where the model holds: any rule, of whatever memory, that only acts and senses.
//!
//! "Earned 4.07, at most 4.18" says how much a better plan could still bring. The bounds here are those of an agent that is told more
//! than it can sense, which can only help it (information relaxation, Brown, Smith and Sun 2010), each as tight as the model allows:
//!
//! | the model | what the agent is told | module |
//! |---|---|---|
//! | one of two states that does not move | nothing | `points` |
//! | linear, no walls, the mode known: the filter is exact | nothing | `beliefs` |
//! | walls, hidden modes, failure limits, starts of any kind | state and mode, one step late | `late` |
//! | more than two variables, or such that mix | everything, and it may choose where it is | `ceiling` |
//!
//! Revealing the innovations of an exact filter turns the penalised return of every path into the value at the start and discounted
//! Bellman residuals, so that a value without positive residuals is itself a bound, and without variance. Such a value is what all of
//! these compute: value iteration backwards from the end of the episode, in which every approximation is rounded up. Nothing is
//! sampled, and no value of a planner's is trusted: what the planner interpolates or cuts off does not enter.
//!
//! # What holds
//! The bound counts [`crate::model::Episode::length`] steps, rewards and events before and after the move, at most one event a step,
//! endings, restarts and failures, as [`crate::world::ProblemWorld`] does. It holds for a world that moves, senses and starts as the
//! model says, and stops the state at its bounds if and only if the belief knows of walls ([`crate::model::WallBelief::Clip`]). In a
//! world that differs, a policy may earn more. Numbers are rounded up by a billionth for what floating point may lose.
//!
//! # References
//! D. B. Brown, J. E. Smith, P. Sun, "Information relaxations and duality in stochastic dynamic programs", Operations Research 58(4),
//! 2010. M. Hauskrecht, "Value-function approximations for partially observable Markov decision processes", JAIR 13, 2000.

mod beliefs;
mod ceiling;
mod cells;
mod frame;
mod late;
mod law;
mod levels;
mod measure;
mod points;
mod step;

use serde::Serialize;

use crate::error::{Error, Result};
use crate::model::Model;
use crate::progress::Progress;
use ceiling::Ceiling;
use frame::Frame;

/// How much work to make of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Settings {
    /// Points of a grid along each variable, at least 2; `None` for a number that takes seconds. A coarser grid gives a looser bound.
    pub points: Option<usize>,
}

/// The most that any policy can earn, in discounted reward of an episode.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Bound {
    /// The bound.
    pub mean: f64,
    /// Its standard error: 0, since nothing is sampled.
    pub stderr: f64,
    /// How it was found.
    pub method: Method,
}

/// How a bound was found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub enum Method {
    /// The value of two weights, rounded up.
    Points,
    /// The value of Gaussian beliefs, rounded up.
    Beliefs,
    /// The value of an agent that is told the state one step late.
    ToldLate {
        /// Why beliefs of the model are not exact.
        reason: String,
    },
    /// The most that any state pays, at every step.
    Ceiling {
        /// Why the model is too much for the others.
        reason: String,
    },
}

impl Method {
    /// What kind of bound it is, in a sentence.
    pub fn describe(&self) -> String {
        match self {
            Self::Points => {
                "No policy earns more: the value of knowing with which probability each of two states is true, rounded up.".to_owned()
            }
            Self::Beliefs => {
                "No policy earns more: the value of exact Gaussian beliefs, rounded up.".to_owned()
            }
            Self::ToldLate { reason } => format!(
                "No policy earns more: the value for an agent that is told state and mode one step late, rounded up, since a Gaussian belief is not exact ({reason})."
            ),
            Self::Ceiling { reason } => format!(
                "No policy earns more, but hardly any as much: the most that any state pays, at every step, since {reason}."
            ),
        }
    }
}

impl Bound {
    /// By how much the bound lies above what a policy earns, as a share of the bound; `None` where it is not above 0.
    pub fn gap(&self, earned: f64) -> Option<f64> {
        (self.mean > 0.0).then(|| (self.mean - earned) / self.mean)
    }
}

/// An upper bound on the discounted return of any policy where the model holds.
///
/// # Errors
/// [`Error::Setting`] for settings out of range; [`Error::Unsupported`] for a model with a quadratic cost, whose best value is known
/// in closed form ([`crate::solve::lqg`]), and for rewards too large to be added.
pub fn bound(model: &Model, settings: &Settings, observer: &dyn Progress) -> Result<Bound> {
    check(model, settings)?;
    let refuse = |reason: &str| {
        Err(Error::Unsupported {
            solver: "the upper bound",
            model: model.name.clone(),
            reason: reason.to_owned(),
        })
    };
    if !model.is_linear() {
        return refuse(&format!(
            "it has {}, and bounds are known for linear models alone; leave out --bound",
            model.beyond_linear().join(", ")
        ));
    }
    if model.cost.is_some() {
        return refuse(
            "it has a quadratic cost, which is not bounded; the value that lqg plans is the best there is",
        );
    }
    if model.clock() > 0 {
        return refuse(
            "what it pays or changes depends on the step of the episode; leave out `steps`",
        );
    }
    let (least, method) = least(model, settings, observer);
    let ceiling = Ceiling::new(model).within(model.episode.length);
    let (bound, method) = match (least <= ceiling, method) {
        (true, method) => (least, method),
        (false, method) => {
            let reason = match method {
                Method::Ceiling { reason } => reason,
                _ => "its noise is too small for the grid".to_owned(),
            };
            (ceiling, Method::Ceiling { reason })
        }
    };
    if !bound.is_finite() {
        return refuse("its numbers are too large to be added up; state them in other units");
    }
    Ok(Bound {
        mean: bound + 1e-9 * bound.abs().max(1e-3 * ceiling.abs()),
        stderr: 0.0,
        method,
    })
}

fn check(model: &Model, settings: &Settings) -> Result<()> {
    let (most, range) = match model.state_dim() {
        1 => (20_000, "from 2 to 20000 for one variable"),
        _ => (800, "from 2 to 800 for two variables"),
    };
    match settings.points {
        Some(points) if !(2..=most).contains(&points) => Err(Error::Setting {
            setting: "points",
            value: points.to_string(),
            range,
        }),
        _ => Ok(()),
    }
}

/// The least bound that is known for the model.
fn least(model: &Model, settings: &Settings, observer: &dyn Progress) -> (f64, Method) {
    if let Ok(bound) = points::bound(model) {
        return (bound, Method::Points);
    }
    let frame = match Frame::new(model) {
        Ok(frame) => frame,
        Err(reason) => return (f64::INFINITY, Method::Ceiling { reason }),
    };
    let (beliefs, inexact) = match beliefs::bound(&frame, settings.points, observer) {
        Ok(found) if found.fine => return (found.value, Method::Beliefs),
        Ok(found) => (found.value, "its noise is small for the grid".to_owned()),
        Err(reason) => (f64::INFINITY, reason),
    };
    match late::bound(&frame, settings.points, observer) {
        Ok(bound) if bound < beliefs => (bound, Method::ToldLate { reason: inexact }),
        Err(reason) if beliefs == f64::INFINITY => (beliefs, Method::Ceiling { reason }),
        _ => (beliefs, Method::Beliefs),
    }
}
