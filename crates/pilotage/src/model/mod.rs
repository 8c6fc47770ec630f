//! What the agent assumes about its world: linear motion and sensing with Gaussian noise, actions, rewards, hidden modes and the events
//! that change them.
//!
//! Begin with a [`ModelBuilder`], which looks names up and checks everything, or with a TOML file ([`crate::scenario::read`]). Either
//! gives a [`Model`]: plain data, which may be changed and checked again ([`Model::validate`]). What is *true* may differ: that is part
//! of a [`crate::scenario::Scenario`], which no planner sees.
//!
//! What a model is made of:
//!
//! - *where one is*: [`StateVariable`], a [`Map`], [`StartHypothesis`] and the modes;
//! - *what moves and is sensed*: [`Motion`], [`Sensor`] and [`Action`], and the [`Phase`]s in which they are others;
//! - *what is paid and happens*: [`Reward`], [`Event`], [`QuadraticCost`] and [`Episode`], in a [`Region`] and during [`Steps`];
//! - *how beliefs are kept*: [`BeliefSettings`].
//!
//! What a step does is said once for all who ask, by [`Model::effects`]; a [`Tally`] adds it up. A [`Fault`] is a mistake in a model, a
//! [`ModelError`] one with its place in a file, and a [`Fingerprint`] tells whether two models are the same problem.

mod barriers;
mod body;
mod builder;
mod dynamics;
mod effects;
pub(crate) mod error;
mod expression;
pub(crate) mod fingerprint;
mod law;
pub(crate) mod map;
mod region;
pub(crate) mod validate;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use barriers::{Barriers, Stop};
pub use body::Part;
pub use builder::{Clause, ModelBuilder};
pub(crate) use dynamics::wrapped;
pub use dynamics::{Doing, Dynamics};
pub(crate) use effects::EffectTable;
pub use effects::{Change, Effect, Outcome, Switch, Tally, apart};
pub(crate) use error::nearest;
pub use error::{Fault, ModelError, Path, Place, Step, suggest};
pub use expression::{Expression, ExpressionError};
pub use fingerprint::{Fingerprint, NotAFingerprint};
pub(crate) use law::MOST_TOLD;
pub use law::{Case, Coded, Formula, Laws, MotionLaw, Point, SensorLaw, VariableKind};
pub use map::Map;
pub use region::{Interval, Region};

/// Index into [`Model::actions`].
pub type ActionId = usize;
/// Index into [`Model::modes`].
pub type ModeId = usize;

/// A planning problem: the agent's linear-Gaussian model, rewards and hints about the world.
///
/// ```text
/// s' = A s + B u + v,   v ~ N(0, Q)        (Eq. 2.26)
/// o  = H s + n,         n ~ N(0, R)        (Eq. 2.27)
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Short name, also the name of the built-in problem.
    pub name: String,
    /// One or two sentences for people.
    pub about: String,
    /// Discount factor, in `[0, 1)`; 1 is allowed in a model with a [`QuadraticCost`], summed over a finite episode.
    pub discount: f64,
    /// Name and bounds of each state variable; bounds are the world's outer limits, a hint given to the agent.
    pub state: Vec<StateVariable>,
    /// Names of the hidden modes. Always at least one; a model without modes has one called `""`.
    pub modes: Vec<String>,
    /// What the agent believes at the start: one hypothesis in the ordinary case. Weights sum to 1.
    pub start: Vec<StartHypothesis>,
    /// Motion model.
    pub motion: Motion,
    /// Sensor model.
    pub sensor: Sensor,
    /// Motion and sensor from later steps of an episode on, in the order of their steps.
    pub later: Vec<Phase>,
    /// What goes beyond linear motion and sensing.
    pub laws: Laws,
    /// The actions, in file order. Ties between actions go to the first.
    pub actions: Vec<Action>,
    /// Rewards `r(s, a)`, added up over all terms that apply.
    pub rewards: Vec<Reward>,
    /// Events that change the hidden mode. The first that applies happens, at most one a step.
    pub events: Vec<Event>,
    /// Quadratic cost of state and control.
    pub cost: Option<QuadraticCost>,
    /// Length and failure limits of an episode.
    pub episode: Episode,
    /// How the agent keeps its belief.
    pub belief: BeliefSettings,
    /// Walls and marked cells of a grid map, known to the agent's planner.
    pub map: Option<Map>,
    /// Text of the model file it was read from, which goes with policies whose beliefs are kept by formulas.
    pub text: ModelText,
}

/// The text that a model was read from, if it was. Models that say the same are the same, whatever their text.
#[derive(Debug, Clone, Default)]
pub struct ModelText {
    /// The text.
    pub text: Option<Arc<str>>,
    /// What of it the model is.
    pub part: Part,
}

impl PartialEq for ModelText {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// One component of the state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StateVariable {
    /// Name used by regions and drawings.
    pub name: String,
    /// Outer limits of the world along this variable; infinite where there are none.
    pub bounds: Interval,
    /// What its values are.
    #[serde(default)]
    pub kind: VariableKind,
}

/// One Gaussian component of the initial belief (Eq. 5.15).
#[derive(Debug, Clone, PartialEq)]
pub struct StartHypothesis {
    /// Prior probability; all weights sum to 1.
    pub weight: f64,
    /// Hidden mode under this hypothesis.
    pub mode: ModeId,
    /// Mean, length `n`.
    pub mean: DVector<f64>,
    /// Covariance, `n x n`, positive semi-definite.
    pub covariance: DMatrix<f64>,
    /// How the truth is drawn. The agent's filter only keeps the two moments.
    pub shape: StartShape,
}

/// Shape of the distribution a true start is drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum StartShape {
    /// N(mean, covariance).
    #[default]
    Normal,
    /// Uniform in the box with that mean and covariance, which is diagonal: a side of width `w` has variance `w^2 / 12`.
    Uniform,
}

/// Linear motion `s' = A s + B u + d + v` (Eq. 2.26, with a drift `d`).
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// State transition, `n x n`.
    pub a: DMatrix<f64>,
    /// Control matrix, `n x p`.
    pub b: DMatrix<f64>,
    /// What is added at every step, length `n`.
    pub drift: DVector<f64>,
    /// Process noise covariance `Q`, `n x n`, for actions that do not state their own.
    pub noise: DMatrix<f64>,
}

/// Linear sensor `o = H s + n` (Eq. 2.27).
#[derive(Debug, Clone, PartialEq)]
pub struct Sensor {
    /// Measurement matrix, `m x n`.
    pub h: DMatrix<f64>,
    /// Measurement noise covariance `R`, `m x m`, for actions that do not state their own.
    pub noise: DMatrix<f64>,
    /// Probability that there is a reading after a step, in `[0, 1]`, whatever the state. The agent knows when one is missing.
    pub present: f64,
}

/// How the state moves and is sensed from a step of the episode on.
#[derive(Debug, Clone, PartialEq)]
pub struct Phase {
    /// The first step, at least 1 and more than that of the phase before.
    pub from: usize,
    /// Motion by the actions of these steps.
    pub motion: Motion,
    /// Sensor after the actions of these steps.
    pub sensor: Sensor,
}

/// One action the agent can take.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// Name, unique in the model.
    pub name: String,
    /// Control `u`, length `p`.
    pub control: DVector<f64>,
    /// Process noise of this action, where it differs from [`Motion::noise`].
    pub motion_noise: Option<DMatrix<f64>>,
    /// Measurement noise after this action, where it differs from [`Sensor::noise`].
    pub sensor_noise: Option<DMatrix<f64>>,
    /// What happens to the episode once the action's reward is collected.
    pub then: Then,
}

/// What an action or an event does to the episode.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Then {
    /// The episode goes on.
    #[default]
    Continue,
    /// The episode ends; nothing is earned afterwards.
    End,
    /// World and belief start afresh from the initial belief; discounting goes on.
    Restart,
}

/// When a step asks where the state is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum When {
    /// When the action is taken, before the state moves: `r(s, a)`.
    #[default]
    Before,
    /// Where the action has led, after the state has moved: `r(s, a, s')`.
    After,
}

/// Some steps of an episode, counted from 0: the first of them, and the first after them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Steps {
    /// The first step.
    pub from: usize,
    /// The first step that is no longer one of them; `usize::MAX` where there is no end.
    pub until: usize,
}

impl Steps {
    /// All steps.
    pub const ALL: Self = Self {
        from: 0,
        until: usize::MAX,
    };

    /// Whether a step is one of them.
    pub fn contains(&self, step: usize) -> bool {
        self.from <= step && step < self.until
    }
}

impl Default for Steps {
    fn default() -> Self {
        Self::ALL
    }
}

/// A reward term: paid when the action is taken in the mode, and the state is in the region.
#[derive(Debug, Clone, PartialEq)]
pub struct Reward {
    /// Actions it applies to; `None` for all.
    pub actions: Option<Vec<ActionId>>,
    /// Mode it applies to, that in which the action is taken; `None` for all.
    pub mode: Option<ModeId>,
    /// Where the state must be.
    pub region: Region,
    /// Whether it must be there before or after the step. A step that ends or restarts the episode has no after.
    pub when: When,
    /// Steps of the episode in which it is paid.
    pub steps: Steps,
    /// Amount, in units of reward.
    pub value: f64,
    /// What is paid besides, where it depends on the state: that before or after the step, as [`Reward::when`] says.
    pub formula: Option<Formula>,
}

/// A change of the hidden mode, with its reward.
#[derive(Debug, Clone, PartialEq)]
pub struct Event {
    /// Actions that trigger it; `None` for all.
    pub actions: Option<Vec<ActionId>>,
    /// Mode it needs; `None` for any.
    pub mode: Option<ModeId>,
    /// Where the state must be.
    pub region: Region,
    /// Whether it must be there before or after the step. Events before come first.
    pub when: When,
    /// Steps of the episode in which it can happen.
    pub steps: Steps,
    /// Probability that it happens there, in `[0, 1]`. One that does not leaves the turn to the next.
    pub probability: f64,
    /// Mode afterwards; `None` leaves it.
    pub becomes: Option<ModeId>,
    /// Paid when it happens.
    pub reward: f64,
    /// What it does to the episode.
    pub then: Then,
}

/// `cost = s' state s + u' control u` a step, `s' terminal s` at the end of the episode. A cost is a negative reward, paid beside
/// all others when the action is taken.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticCost {
    /// State weights, `n x n`.
    pub state: DMatrix<f64>,
    /// Control weights, `p x p`.
    pub control: DMatrix<f64>,
    /// Final state weights, `n x n`.
    pub terminal: DMatrix<f64>,
}

/// When an episode is over.
#[derive(Debug, Clone, PartialEq)]
pub struct Episode {
    /// Steps after which it stops, at least 1.
    pub length: usize,
    /// Leaving this region is a failure; the episode ends.
    pub alive: Region,
    /// Paid once on failure.
    pub failure_reward: f64,
}

/// How the agent keeps its belief.
#[derive(Debug, Clone, PartialEq)]
pub struct BeliefSettings {
    /// Covariances whose entries differ by less than this are one uncertainty level (the thesis' epsilon).
    pub level_tolerance: f64,
    /// Most levels that are computed; a model that never converges within it is cut there, its last level steady.
    pub level_limit: usize,
    /// Whether the filter uses what walls tell it.
    pub walls: WallBelief,
    /// How several start hypotheses are kept.
    pub hypotheses: HypothesisBelief,
    /// What keeps the belief.
    pub tracker: TrackerKind,
    /// Most Gaussians of a sum, at least 1; `None` for what the number of variables asks for.
    pub components: Option<usize>,
    /// Cells along a variable, at least 2; `None` for what the number of variables asks for.
    pub cells: Option<usize>,
}

impl Default for Episode {
    fn default() -> Self {
        Self {
            length: 100,
            alive: Region::everywhere(),
            failure_reward: 0.0,
        }
    }
}

impl Default for BeliefSettings {
    fn default() -> Self {
        Self {
            level_tolerance: 5e-7,
            level_limit: 400,
            walls: WallBelief::Ignore,
            hypotheses: HypothesisBelief::Collapse,
            tracker: TrackerKind::Auto,
            components: None,
            cells: None,
        }
    }
}

/// What keeps a belief.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TrackerKind {
    /// What the model asks for: `linear` for a linear model, `cells` for a discrete sensor and for one or two whole numbers, `sum` elsewhere.
    #[default]
    Auto,
    /// The Kalman filter on uncertainty levels, at one believed mode.
    Linear,
    /// A sum of weighted Gaussians, each in a mode.
    Sum,
    /// Probabilities of cells, for one and two state variables with bounds.
    Cells,
}

/// What the filter makes of walls.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum WallBelief {
    /// The plain Kalman filter of the thesis: walls are not known to it.
    #[default]
    Ignore,
    /// The predicted mean stops at walls as the state does, the corrected mean is kept where a state can be, and probability
    /// beyond the bounds sits at the bounds (clipped Gaussian).
    Clip,
}

/// How a belief made of several hypotheses is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum HypothesisBelief {
    /// One Gaussian with the mixture's mean and covariance. Lossless when the hypotheses are points that do not
    /// move, as in the tiger problem: their weights are then a function of level and mean.
    #[default]
    Collapse,
    /// As `Collapse`, but the belief is read as the Gaussian itself and not as the hypotheses (the thesis' reading).
    Gaussian,
    /// Every hypothesis keeps its own filter and weight (Eq. 5.16).
    Track,
}

impl Model {
    /// Number of state variables, `n`.
    pub fn state_dim(&self) -> usize {
        self.state.len()
    }

    /// Number of sensor readings, `m`; 0 for a discrete sensor.
    pub fn sensor_dim(&self) -> usize {
        self.sensor.h.nrows()
    }

    /// How many numbers are read after a step: those of the sensor, and that of the mode where it is seen.
    pub fn observation_dim(&self) -> usize {
        self.sensor_dim() + usize::from(self.laws.modes_seen)
    }

    /// Number of the phase that a step of an episode belongs to: 0 is that of [`Model::motion`] and [`Model::sensor`], then those of
    /// [`Model::later`].
    pub fn phase(&self, step: usize) -> usize {
        self.later.partition_point(|phase| phase.from <= step)
    }

    /// How the actions of a step move the state.
    pub fn motion_at(&self, step: usize) -> &Motion {
        match self.phase(step) {
            0 => &self.motion,
            phase => &self.later[phase - 1].motion,
        }
    }

    /// What is sensed after the actions of a step.
    pub fn sensor_at(&self, step: usize) -> &Sensor {
        match self.phase(step) {
            0 => &self.sensor,
            phase => &self.later[phase - 1].sensor,
        }
    }

    /// Process noise covariance of an action at a step.
    pub fn motion_noise(&self, action: ActionId, step: usize) -> &DMatrix<f64> {
        let own = self.actions[action].motion_noise.as_ref();
        own.unwrap_or(&self.motion_at(step).noise)
    }

    /// Measurement noise covariance after an action at a step.
    pub fn sensor_noise(&self, action: ActionId, step: usize) -> &DMatrix<f64> {
        let own = self.actions[action].sensor_noise.as_ref();
        own.unwrap_or(&self.sensor_at(step).noise)
    }

    /// Displacement `B u + d` of an action at a step.
    pub fn displacement(&self, action: ActionId, step: usize) -> DVector<f64> {
        let motion = self.motion_at(step);
        &motion.b * &self.actions[action].control + &motion.drift
    }

    /// Whether its states are so few whole numbers that each can have a cell.
    fn counts_only(&self) -> bool {
        let mut state = self.state.iter();
        let counts = state.all(|variable| variable.kind == VariableKind::Integer);
        counts && self.state_dim() <= 2
    }

    /// Whether motion and sensing are linear, with Gaussian noise that no place and no mode changes, events are certain where they
    /// happen, and rewards are numbers: whether uncertainty levels follow it.
    pub fn is_linear(&self) -> bool {
        self.beyond_linear().is_empty()
    }

    /// What in it is not linear, in words.
    pub(crate) fn beyond_linear(&self) -> Vec<&'static str> {
        let laws = &self.laws;
        let cases = || laws.cases.iter();
        let parts = [
            (
                cases().any(|case| !case.motion.step.is_empty()),
                "motion by formula",
            ),
            (
                cases().any(|case| !case.sensor.read.is_empty()),
                "a sensor by formula",
            ),
            (
                cases().any(|case| case.motion.noise.is_some() || case.sensor.noise.is_some()),
                "noise that depends on the state or the case",
            ),
            (
                cases().any(|case| case.sensor.present.is_some()),
                "readings that are missing by place",
            ),
            (
                cases().any(|case| {
                    let motion = &case.motion;
                    let moved = motion.a.is_some() || motion.b.is_some() || motion.drift.is_some();
                    moved || case.sensor.h.is_some()
                }),
                "matrices by mode or action",
            ),
            (!laws.symbols.is_empty(), "a discrete sensor"),
            (!laws.saturates.is_empty(), "readings that saturate"),
            (laws.modes_seen, "modes that are seen"),
            (
                self.state
                    .iter()
                    .any(|variable| variable.kind != VariableKind::Real),
                "variables that are whole numbers or angles",
            ),
            (
                self.events.iter().any(|event| event.probability < 1.0),
                "events by chance",
            ),
            (
                self.rewards.iter().any(|reward| reward.formula.is_some()),
                "rewards by formula",
            ),
        ];
        let said = parts.into_iter().filter(|(says, _)| *says);
        said.map(|(_, part)| part).collect()
    }

    /// What keeps its belief: what [`BeliefSettings::tracker`] says or, by itself, the Kalman filter for a linear model, cells for a discrete
    /// sensor unless something changes with the step, and a sum of Gaussians elsewhere. What the filter loses of a linear model, [`Model::beyond_levels`] says.
    pub fn tracker(&self) -> TrackerKind {
        match self.belief.tracker {
            TrackerKind::Auto if self.is_linear() => TrackerKind::Linear,
            TrackerKind::Auto if self.clock() > 0 => TrackerKind::Sum,
            TrackerKind::Auto if !self.laws.symbols.is_empty() || self.counts_only() => {
                TrackerKind::Cells
            }
            TrackerKind::Auto => TrackerKind::Sum,
            chosen => chosen,
        }
    }

    /// What in it a Gaussian on uncertainty levels loses or does not follow, in words.
    pub fn beyond_levels(&self) -> Vec<&'static str> {
        let mut parts = self.beyond_linear();
        if self.modes.len() > 1 && !self.laws.modes_seen {
            parts.push("hidden modes");
        }
        if self.belief.walls == WallBelief::Clip {
            parts.push("walls");
        }
        let tracked = self.belief.hypotheses == HypothesisBelief::Track;
        if self.start.len() > 1 && !tracked && self.moves() {
            parts.push("several starts");
        }
        parts
    }

    /// Whether any action moves the state, or noise does.
    fn moves(&self) -> bool {
        let n = self.state_dim();
        self.phases().any(|step| {
            self.motion_at(step).a != DMatrix::identity(n, n)
                || (0..self.actions.len()).any(|action| {
                    self.motion_noise(action, step).amax() > 0.0
                        || self.displacement(action, step).amax() > 0.0
                })
        })
    }

    /// Steps at which phases begin.
    pub(crate) fn phases(&self) -> impl Iterator<Item = usize> {
        std::iter::once(0).chain(self.later.iter().map(|phase| phase.from))
    }

    /// Whether a reading may be missing at some step.
    pub(crate) fn misses_readings(&self) -> bool {
        self.phases().any(|step| self.sensor_at(step).present < 1.0)
    }

    /// Where something good is paid: the regions of all rewards and events above 0.
    pub(crate) fn goals(&self) -> Vec<Region> {
        let rewards = self
            .rewards
            .iter()
            .map(|reward| (reward.value, &reward.region));
        let events = self
            .events
            .iter()
            .map(|event| (event.reward, &event.region));
        rewards
            .chain(events)
            .filter(|(value, _)| *value > 0.0)
            .map(|(_, region)| region.clone())
            .collect()
    }

    /// The action of that name.
    pub fn action_named(&self, name: &str) -> Option<ActionId> {
        self.actions.iter().position(|action| action.name == name)
    }
}

impl Reward {
    /// Whether the term is paid for this action in this mode (somewhere, at some step).
    pub fn applies(&self, mode: ModeId, action: ActionId) -> bool {
        applies(&self.actions, self.mode, mode, action)
    }
}

impl Event {
    /// Whether the event can happen on this action in this mode (somewhere, at some step).
    pub fn applies(&self, mode: ModeId, action: ActionId) -> bool {
        applies(&self.actions, self.mode, mode, action)
    }
}

pub(crate) fn applies(
    actions: &Option<Vec<ActionId>>,
    needed: Option<ModeId>,
    mode: ModeId,
    action: ActionId,
) -> bool {
    actions
        .as_ref()
        .is_none_or(|actions| actions.contains(&action))
        && needed.is_none_or(|needed| needed == mode)
}
