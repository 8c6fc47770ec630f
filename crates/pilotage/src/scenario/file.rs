//! The model file as it is written, format 1. The documentation of these tables is the documentation of the format:
//! it goes into the JSON schema word for word.

use std::collections::BTreeMap;

use schemars::{JsonSchema, Schema};
use serde::Deserialize;

use super::file_value::{Ends, Named, OneOrMany, Scalar, Sides, Where};
use super::{CartPole, Robot, Walls};
use crate::model::{HypothesisBelief, Then, TrackerKind, WallBelief, When};

/// Rows of numbers: `[[1.0, 0.0], [0.0, 1.0]]`.
pub(super) type Rows = Vec<Vec<f64>>;

/// Rows of numbers or expressions: `[["0.01 + 0.1*abs(x)", 0.0], [0.0, 1.0]]`.
pub(super) type ScalarRows = Vec<Vec<Scalar>>;

/// JSON schema of model files, for editors and for people.
pub fn schema() -> Schema {
    schemars::schema_for!(ModelFile)
}

/// A planning problem: what the agent assumes about its world, what it is paid for, and what is true.
///
/// With n state variables, p controls and m sensor readings, the agent assumes
/// s' = A s + B u + drift + v, v ~ N(0, motion.noise) and o = H s + n, n ~ N(0, sensor.noise), or `motion.step` and `sensor.read`
/// in place of the matrices.
/// Every noise is a covariance, never a standard deviation. Numbers are finite, except the ends of a region.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
#[schemars(title = "pilotage model file")]
pub(super) struct ModelFile {
    /// Version of this format: 1.
    #[allow(dead_code, reason = "it is looked at before all other keys")]
    pub format: u64,
    /// Short name of the problem.
    pub name: String,
    /// One or two sentences about the problem.
    #[serde(default)]
    pub about: String,
    /// Discount factor a step, in [0, 1). It may be 1 in a model with a `cost` and a stated `episode.length`.
    pub discount: f64,
    /// The state variables, their bounds and the hidden modes.
    pub state: StateTable,
    /// What the agent believes at the start: one Gaussian, or a list of weighted ones.
    pub start: OneOrMany<StartTable>,
    /// Which of several starts, counted from 1, the agent is told that an episode begins at: there is no other then. Default: it is not told.
    pub told: Option<usize>,
    /// How actions move the state.
    pub motion: MotionTable,
    /// What the agent senses.
    pub sensor: SensorTable,
    /// How state and sensor change in the course of an episode, in the order of the steps. Default: they do not.
    #[serde(default)]
    pub later: Vec<LaterTable>,
    /// Motion and sensor in a mode or on an action, where they are others. All that apply count, later ones before earlier ones.
    #[serde(default)]
    pub case: Vec<CaseTable>,
    /// The actions by name, at least one. Between actions that are equally good the first in the file is taken.
    #[schemars(with = "std::collections::BTreeMap<String, ActionTable>")]
    pub actions: Named<ActionTable>,
    /// Rewards for taking an action in a state. All that apply are added up.
    #[serde(default)]
    pub reward: Vec<RewardTable>,
    /// Changes of the hidden mode. The first that applies happens, at most one a step.
    #[serde(default)]
    pub event: Vec<EventTable>,
    /// Quadratic cost of state and control.
    pub cost: Option<CostTable>,
    /// Length and limits of an episode.
    #[serde(default)]
    pub episode: EpisodeTable,
    /// How the agent keeps its belief.
    #[serde(default)]
    pub belief: BeliefTable,
    /// A drawing of walls and marked cells. The first two state variables are its x (east) and y (north).
    pub map: Option<MapTable>,
    /// What is true, where it differs from what the agent assumes.
    #[serde(default)]
    pub world: WorldTable,
    /// A rule of thumb to compare plans with, which no planner sees: the first whose condition holds says what is done. The last has
    /// no condition. Default: there is no such rule.
    #[serde(default)]
    pub rule: Vec<RuleTable>,
}

/// One line of a rule of thumb.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RuleTable {
    /// Condition: an expression that knows the means of the state variables by name, their standard deviations `sd_NAME`, the
    /// probabilities of the modes `p_MODE`, and the step `t`, counted from 0: `"sd_x > 0.5 and x < 4"`. Default: always.
    pub when: Option<String>,
    /// The action that is then taken.
    #[serde(rename = "do")]
    pub action: String,
}

/// The state variables.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct StateTable {
    /// Their names, n of them, each different.
    pub names: Vec<String>,
    /// Lower and upper end of the world along each variable, n pairs; a hint given to the agent, and the walls of
    /// the world if `world.walls` says so. Default: the extent of the map, or no bounds.
    pub bounds: Option<Vec<Ends>>,
    /// Names of the hidden modes. Default: one mode without a name.
    #[serde(default)]
    pub modes: Vec<String>,
    /// Whether the agent sees the mode after every step. Default: no sensor shows it.
    #[serde(default)]
    pub modes_seen: bool,
    /// The variables whose values are whole numbers: what a step leads to is rounded.
    #[serde(default)]
    pub integer: Vec<String>,
    /// The variables that are angles in radians: they are kept in [-pi, pi).
    #[serde(default)]
    pub angle: Vec<String>,
}

/// One Gaussian of a start.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct StartTable {
    /// Its probability, more than 0; all sum to 1. Default: all are equally likely.
    pub weight: Option<f64>,
    /// Its hidden mode. Default: the first mode.
    pub mode: Option<String>,
    /// Mean of the state, n numbers inside the bounds. Needed unless `uniform` is given.
    pub mean: Option<Vec<f64>>,
    /// Covariance of the state, n x n. Needed unless `uniform` is given.
    pub covariance: Option<Rows>,
    /// Instead of mean and covariance: the truth is drawn uniformly from this box, which has finite ends for every state
    /// variable; the agent believes the Gaussian with its mean and covariance.
    pub uniform: Option<Sides>,
}

/// Linear motion s' = A s + B u + v.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct MotionTable {
    /// How the state moves on its own, n x n. Needed unless `step` says it of all variables, or `linearise` is given.
    #[serde(rename = "A")]
    pub a: Option<Rows>,
    /// How controls move the state, n x p. Default: the identity; with `step`, the n x p of zeros that the actions' `u` fits.
    #[serde(rename = "B")]
    pub b: Option<Rows>,
    /// What is added at every step, n numbers. Default: zeros.
    pub drift: Option<Vec<f64>>,
    /// The next value of state variables by name, noise apart, instead of A s + B u + drift: `step = { x = "x + u1" }`.
    #[serde(default)]
    pub step: BTreeMap<String, Scalar>,
    /// Covariance of v, n x n, of numbers or expressions. Needed unless `linearise` is given; with `step`, zeros by default.
    pub noise: Option<ScalarRows>,
    /// Takes A and B from a plant: its linearisation about the upright pole, held for `world.cart-pole.step` seconds, and
    /// a noise of B q B' + 1e-9 I, where q is its `force_noise`.
    pub linearise: Option<Plant>,
}

/// Plants that can be linearised.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Plant {
    /// The cart and pole of `world.cart-pole`: position m, velocity m/s, angle from upright rad, rad/s; one control, the
    /// force in N.
    CartPole,
}

/// Linear sensor o = H s + n.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct SensorTable {
    /// What is sensed of the state, m x n. Default: all of it, the identity.
    #[serde(rename = "H")]
    pub h: Option<Rows>,
    /// What is read, noise apart, instead of H s, by name of the reading: `read = { range = "hypot(x, y)" }`.
    #[schemars(with = "Option<BTreeMap<String, Scalar>>")]
    pub read: Option<Named<Scalar>>,
    /// A discrete sensor instead of readings: probability of each of its signals by name, of which one may be `"rest"`, what is left
    /// to 1: `symbols = { bright = "exp(-x^2)", dark = "rest" }`.
    #[schemars(with = "Option<BTreeMap<String, Scalar>>")]
    pub symbols: Option<Named<Scalar>>,
    /// Covariance of n, m x m, of numbers or expressions. Needed unless `symbols` is given.
    pub noise: Option<ScalarRows>,
    /// Probability that there is a reading after a step, in [0, 1], a number or an expression. The agent knows when one is missing.
    /// Default: 1.
    pub present: Option<Scalar>,
    /// Ends at which readings saturate, m pairs: what lies beyond is read as the end. Default: none.
    pub saturates: Option<Vec<Ends>>,
}

/// Motion and sensor in some modes, on some actions. What is not given stays as it is.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct CaseTable {
    /// The mode or list of modes it applies to, for motion that in which the action is taken, for the sensor that after it. Default: all.
    pub mode: Option<OneOrMany<String>>,
    /// The action or list of actions it applies to. Default: all.
    pub action: Option<OneOrMany<String>>,
    /// What is different about the motion.
    #[serde(default)]
    pub motion: CaseMotionTable,
    /// What is different about the sensor.
    #[serde(default)]
    pub sensor: CaseSensorTable,
}

/// What is different about the motion.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct CaseMotionTable {
    /// How the state moves on its own, n x n.
    #[serde(rename = "A")]
    pub a: Option<Rows>,
    /// How controls move the state, n x p.
    #[serde(rename = "B")]
    pub b: Option<Rows>,
    /// What is added at every step, n numbers.
    pub drift: Option<Vec<f64>>,
    /// The next value of state variables by name, noise apart.
    #[serde(default)]
    pub step: BTreeMap<String, Scalar>,
    /// Covariance of v, n x n, of numbers or expressions.
    pub noise: Option<ScalarRows>,
}

/// What is different about the sensor.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct CaseSensorTable {
    /// What is sensed of the state, m x n, with as many readings as otherwise.
    #[serde(rename = "H")]
    pub h: Option<Rows>,
    /// What is read, noise apart, by name of the reading, as many as otherwise.
    #[schemars(with = "Option<BTreeMap<String, Scalar>>")]
    pub read: Option<Named<Scalar>>,
    /// Probability of each signal by name, the same names as otherwise.
    #[schemars(with = "Option<BTreeMap<String, Scalar>>")]
    pub symbols: Option<Named<Scalar>>,
    /// Covariance of n, m x m, of numbers or expressions.
    pub noise: Option<ScalarRows>,
    /// Probability that there is a reading, a number or an expression.
    pub present: Option<Scalar>,
}

/// Motion and sensor from a step of the episode on. What is not given stays as it was before.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LaterTable {
    /// The first step, counted from 0; at least 1.
    pub from: u64,
    /// What changes about the motion.
    #[serde(default)]
    pub motion: LaterMotionTable,
    /// What changes about the sensor.
    #[serde(default)]
    pub sensor: LaterSensorTable,
}

/// What changes about the motion.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LaterMotionTable {
    /// How the state moves on its own, n x n.
    #[serde(rename = "A")]
    pub a: Option<Rows>,
    /// How controls move the state, n x p.
    #[serde(rename = "B")]
    pub b: Option<Rows>,
    /// Covariance of v, n x n.
    pub noise: Option<Rows>,
}

/// What changes about the sensor.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct LaterSensorTable {
    /// What is sensed of the state, m x n, with as many readings as before.
    #[serde(rename = "H")]
    pub h: Option<Rows>,
    /// Covariance of n, m x m.
    pub noise: Option<Rows>,
    /// Probability that there is a reading after a step, in [0, 1].
    pub present: Option<f64>,
}

/// An action.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ActionTable {
    /// Control, p numbers. Default: zeros.
    pub u: Option<Vec<f64>>,
    /// Motion noise of this action, n x n. Default: `motion.noise`.
    pub noise: Option<Rows>,
    /// Sensor noise after this action, m x m. Default: `sensor.noise`.
    pub sensor_noise: Option<Rows>,
    /// What it does to the episode once it has been paid for. Default: the episode goes on.
    #[serde(default)]
    pub then: Then,
}

/// A reward, paid when the action is taken in the mode and the state is in the region.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct RewardTable {
    /// The action or list of actions it is paid for. Default: all.
    pub action: Option<OneOrMany<String>>,
    /// The mode it is paid in. Default: all.
    pub mode: Option<String>,
    /// Where it is paid. Default: everywhere.
    #[serde(rename = "in")]
    pub place: Option<Where>,
    /// Whether the state must be there before or after the move. Default: before.
    #[serde(default)]
    pub when: When,
    /// The steps of an episode in which it is paid. Default: all.
    #[serde(default)]
    pub steps: StepsTable,
    /// Amount: a number, or an expression of the state (that before or after the move, as `when` says), the control and the step.
    pub value: Scalar,
}

/// A change of the hidden mode, when the action is taken in the mode and the state is in the region.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct EventTable {
    /// The action or list of actions that trigger it. Default: all.
    pub action: Option<OneOrMany<String>>,
    /// The mode it needs. Default: any.
    pub mode: Option<String>,
    /// Where it can happen. Default: everywhere.
    #[serde(rename = "in")]
    pub place: Option<Where>,
    /// Whether the state must be there before or after the move; events before come first. Default: before.
    #[serde(default)]
    pub when: When,
    /// The steps of an episode in which it can happen. Default: all.
    #[serde(default)]
    pub steps: StepsTable,
    /// Probability that it happens there, in [0, 1]. Default: 1.
    pub probability: Option<f64>,
    /// The mode afterwards. Default: as before.
    pub becomes: Option<String>,
    /// Paid when it happens. Default: 0.
    #[serde(default)]
    pub reward: f64,
    /// What it does to the episode. Default: the episode goes on.
    #[serde(default)]
    pub then: Then,
}

/// Some steps of an episode, counted from 0.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct StepsTable {
    /// The first of them. Default: 0.
    #[serde(default)]
    pub from: u64,
    /// The first step after them. Default: there is none.
    pub until: Option<u64>,
}

/// Quadratic cost: s' state s + u' control u a step, s' terminal s at the end of the episode.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct CostTable {
    /// Weights of the state, n x n.
    pub state: Rows,
    /// Weights of the control, p x p.
    pub control: Rows,
    /// Weights of the final state, n x n. Default: `state`.
    pub terminal: Option<Rows>,
}

/// When an episode is over.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct EpisodeTable {
    /// Steps after which it stops, at least 1. Default: 100.
    pub length: Option<u64>,
    /// Leaving this region is a failure and ends the episode.
    pub alive: Option<Sides>,
    /// Paid once on failure. Default: 0.
    pub failure_reward: Option<f64>,
}

/// How the agent keeps its belief.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct BeliefTable {
    /// Covariances whose entries differ by less than this are one uncertainty level; where readings may be missing, by less than a
    /// hundredth of the smallest variance. Default: 5e-7.
    pub level_tolerance: Option<f64>,
    /// Most levels that are computed, at least 1. Default: 400.
    pub level_limit: Option<u64>,
    /// Whether the filter uses what walls tell it.
    #[serde(default)]
    pub walls: WallBelief,
    /// How several start hypotheses are kept, by the linear tracker.
    #[serde(default)]
    pub hypotheses: HypothesisBelief,
    /// What keeps the belief. Default: what the model asks for.
    #[serde(default)]
    pub tracker: TrackerKind,
    /// Most Gaussians of a sum. Default: 16.
    pub components: Option<u64>,
    /// Cells along a variable. Default: 40 to 200 for one state variable and 16 to 40 for two, as noise and the places where something is paid ask for.
    pub cells: Option<u64>,
}

/// A map drawn as text, in one of two forms.
///
/// One character a cell: `#` blocked, `.` free, a letter, digit or `*` a free cell with that mark. Or with thin walls:
/// `+` at every corner, `-` and `|` for walls, blanks where there is none; the inside of a cell is blank, or holds one
/// mark, or `#`. The corner of the bottom left cell is (0, 0).
///
/// `in = "*"` is then every cell with that mark, and `in = "#"` wherever no state can be: the blocked cells and all beyond the
/// edges of the map.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct MapTable {
    /// Side of a cell, more than 0, in units of state.
    pub cell: f64,
    /// The drawing, top row first.
    pub rows: String,
}

/// The true world.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct WorldTable {
    /// Which simulator it is. Default: the agent's own linear motion and sensor.
    #[serde(default)]
    pub kind: Kind,
    /// What happens at `state.bounds` and at the walls of the map. Default: nothing, they are only a hint.
    #[serde(default)]
    pub walls: Walls,
    /// The true start. Default: what the agent believes.
    pub start: Option<OneOrMany<StartTable>>,
    /// The true motion of `kind = "linear"`, where it differs from what the agent assumes.
    pub motion: Option<WorldMotionTable>,
    /// Parameters of the cart and pole, needed by `kind = "cart-pole"` and by `motion.linearise`.
    #[serde(rename = "cart-pole")]
    pub cart_pole: Option<CartPole>,
    /// Parameters of the robot, needed by `kind = "robot"`.
    pub robot: Option<Robot>,
}

/// The true linear motion.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct WorldMotionTable {
    /// True covariance of v, n x n, for every action. Default: what the agent assumes.
    pub noise: Option<Rows>,
    /// True controls of actions, by mode. The first that applies counts; otherwise what the agent assumes.
    #[serde(default)]
    pub control: Vec<ControlTable>,
}

/// What an action truly does in a mode.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "a table")]
pub(super) struct ControlTable {
    /// The action or list of actions it applies to. Default: all.
    pub action: Option<OneOrMany<String>>,
    /// The mode it applies to. Default: all.
    pub mode: Option<String>,
    /// Control, p numbers.
    pub u: Vec<f64>,
}

/// The simulators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Kind {
    /// The agent's own linear motion and sensor.
    #[default]
    Linear,
    /// The nonlinear cart and pole, with the parameters of `world.cart-pole`.
    CartPole,
    /// A two-wheeled robot with range finders in an arena with walls at `state.bounds`, with the parameters of `world.robot`.
    Robot,
}
