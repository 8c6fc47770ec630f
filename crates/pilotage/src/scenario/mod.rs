//! A model and the world it is tried in: what the agent assumes, and what is true where that differs.
//!
//! A [`Scenario`] is [found](find) by the name of a built-in model ([`names`]) or the path of a TOML file, read from text ([`read`]),
//! or made of a [`Model`] and a [`Truth`]; [`Scenario::assumed`] is the one in which a model holds. Planners and compilers are handed
//! the model alone, so that nothing of the truth can reach them; worlds are made of the whole.
//!
//! A file may also hold a [rule of thumb](HandRule) that plans are compared with.
//!
//! [`schema`] describes the files. What a [`Truth`] may say: another start, other noise and controls ([`TrueMotion`]), [`Walls`], or a
//! [`Simulator`] with laws of its own.

mod builtin;
mod cart_pole;
mod file;
mod file_value;
mod fingerprint;
mod laws;
mod locate;
mod read;
mod resolve;
mod robot;
mod rule;
mod validate;

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::model::{ActionId, ModeId, Model, StartHypothesis, WallBelief, applies};

use builtin::TOLD;
pub use builtin::{builtin, find, find_builtin, gallery_names, names};
pub use file::schema;
pub use read::{load, read};
pub use robot::Robot;
pub use rule::{HandRule, RuleClause};

/// What an agent assumes about its world, and what is true.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// What the agent assumes: all that planners, compilers and policies know.
    pub model: Model,
    /// What is true where it differs.
    pub truth: Truth,
    /// What somebody who knows the problem would do, to compare plans with; no planner sees it.
    pub rule: Option<HandRule>,
}

impl Scenario {
    /// The scenario in which a model holds: it starts where the agent believes, moves and senses as assumed, and there are walls if
    /// and only if the belief knows of them. What a plan promises is promised for this world.
    pub fn assumed(model: &Model) -> Self {
        Self {
            truth: Truth {
                walls: match model.belief.walls {
                    WallBelief::Ignore => Walls::None,
                    WallBelief::Clip => Walls::Clamp,
                },
                ..Truth::default()
            },
            model: model.clone(),
            rule: None,
        }
    }

    /// Whether the world is the one that the model assumes.
    pub fn is_as_assumed(&self) -> bool {
        self.truth == Self::assumed(&self.model).truth
    }

    /// The true start.
    pub fn start(&self) -> &[StartHypothesis] {
        self.truth.start.as_ref().unwrap_or(&self.model.start)
    }
}

/// What is true, where it differs from what the agent assumes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Truth {
    /// Which simulator stands for the world.
    pub simulator: Simulator,
    /// What happens at [`crate::model::StateVariable::bounds`].
    pub walls: Walls,
    /// True start, where it differs from the believed one.
    pub start: Option<Vec<StartHypothesis>>,
    /// True motion of [`Simulator::Linear`], where it differs from the assumed one.
    pub motion: TrueMotion,
}

/// How the true linear motion `s' = A s + B u + v` differs from the assumed one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrueMotion {
    /// True process noise covariance of every action, `n x n`.
    pub noise: Option<DMatrix<f64>>,
    /// True controls of some actions and modes. The first that applies counts; otherwise the action's own.
    pub controls: Vec<TrueControl>,
}

/// What an action truly does in a mode.
#[derive(Debug, Clone, PartialEq)]
pub struct TrueControl {
    /// Actions it applies to; `None` for all.
    pub actions: Option<Vec<ActionId>>,
    /// Mode it applies to; `None` for all.
    pub mode: Option<ModeId>,
    /// Control `u`, length `p`.
    pub control: DVector<f64>,
}

/// The simulators.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Simulator {
    /// The model's own linear motion and sensor.
    #[default]
    Linear,
    /// The nonlinear cart and pole of Eq. 3.6 and 3.9.
    CartPole(CartPole),
    /// A two-wheeled robot in a walled arena.
    Robot(Robot),
}

/// Parameters of the cart and pole, Table 3.1. State: position m, velocity m/s, angle from upright rad, rad/s.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub struct CartPole {
    /// Mass of the cart, kg.
    pub cart_mass: f64,
    /// Mass of the pole, kg.
    pub pole_mass: f64,
    /// Friction of the cart, N s/m.
    pub friction: f64,
    /// Distance from hinge to the pole's centre of mass, m.
    pub length: f64,
    /// Moment of inertia of the pole about its centre of mass, kg m^2.
    pub inertia: f64,
    /// Gravity, m/s^2.
    pub gravity: f64,
    /// Duration of a step, s.
    pub step: f64,
    /// Variance of the noise on the force, N^2.
    pub force_noise: f64,
}

/// What happens to the true state at the bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Walls {
    /// There are no walls: the bounds are only a hint.
    #[default]
    None,
    /// The state stops at the bounds and, going straight, at the walls and blocked cells of the map.
    Clamp,
}

impl TrueControl {
    /// Whether this is what the action does in this mode.
    pub(crate) fn applies(&self, mode: ModeId, action: ActionId) -> bool {
        applies(&self.actions, self.mode, mode, action)
    }
}
