//! The policy file as it is written, format 2. The documentation of these tables is the documentation of the format: it goes into the
//! JSON schema word for word. What they mean together is in `docs/policy-format.md`.

use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};

use super::{Matching, Place, Test};
use crate::model::{Fingerprint, Part, TrackerKind, When};

/// Version of the file format; a file of another is refused.
pub(super) const FORMAT: u64 = 2;

/// A matrix, row by row: `[[1.0, 0.5], [0.0, 1.0]]`.
pub(super) type Rows = Vec<Vec<f64>>;

/// JSON schema of policy files, for programs that read them and for people.
pub fn schema() -> Schema {
    schemars::schema_for!(File<AnyTable>)
}

/// A policy for acting under uncertainty: a filter that keeps a belief, and a finite automaton that says what to do at it; or a policy
/// graph, which needs no belief.
///
/// With n state variables and m sensor readings. Whatever refers to something by number counts from 0, in the order of the list that it
/// refers to. A matrix is a list of its rows. No number is larger than 1e60 in magnitude.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schemars(title = "pilotage policy file")]
pub(super) struct File<P> {
    /// Version of this format: 2.
    #[schemars(range(min = 2, max = 2))]
    pub format: u64,
    /// Version of pilotage that wrote the file.
    pub pilotage: String,
    /// `fnv1a64-` and 16 hexadecimal digits: the 64-bit FNV-1a hash of the text of the value of `policy`, in UTF-8, without the white space
    /// between its tokens.
    #[schemars(regex(pattern = r"^fnv1a64-[0-9a-f]{16}$"))]
    pub checksum: String,
    /// The policy.
    pub policy: P,
}

/// A policy of either kind; the one with `signals` is a graph.
#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code, reason = "it describes what `policy` may be")]
enum AnyTable {
    Automaton(Box<PolicyTable>),
    Graph(GraphTable),
}

/// A policy graph: nodes with an action each, and where to go on after every signal of a discrete sensor. It begins at the first node.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct GraphTable {
    /// Name of the problem it was made for.
    pub problem: String,
    /// Fingerprint of that problem, which changes when anything changes that a policy depends on.
    #[schemars(with = "String", regex(pattern = r"^v[0-9]+-[0-9a-f]{16}$"))]
    pub fingerprint: Fingerprint,
    /// Name of the solver that made it.
    pub solver: String,
    /// Return that the solver expects from the start over an episode, where it knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planned_value: Option<f64>,
    /// Names of the actions.
    #[schemars(length(min = 1))]
    pub actions: Vec<String>,
    /// Names of the signals.
    #[schemars(length(min = 1))]
    pub signals: Vec<String>,
    /// The nodes, at least one. An episode begins at the first, and again whenever it begins again.
    #[schemars(length(min = 1))]
    pub nodes: Vec<GraphNodeTable>,
}

/// A node of a policy graph.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct GraphNodeTable {
    /// What to do.
    pub action: usize,
    /// The node to go on at after each signal, and last, after none. Default: the episode never goes on after the action; whoever goes on all
    /// the same stays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub next: Vec<usize>,
    /// Share of all steps of an episode that are spent in it, from 0 to 1, where the model holds.
    pub visits: f64,
    /// Share of all steps after which each way of `next` is gone, from 0 to 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gone: Vec<f64>,
}

/// An automaton, and what keeps its belief.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct PolicyTable {
    /// Name of the problem it was made for.
    pub problem: String,
    /// Fingerprint of that problem, which changes when anything changes that a policy depends on.
    #[schemars(with = "String", regex(pattern = r"^v[0-9]+-[0-9a-f]{16}$"))]
    pub fingerprint: Fingerprint,
    /// Name of the solver that made it.
    pub solver: String,
    /// Return that the solver expects from the start, where it knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planned_value: Option<f64>,
    /// Names of the state variables, n of them.
    #[schemars(length(min = 1))]
    pub states: Vec<String>,
    /// Names of the actions.
    #[schemars(length(min = 1))]
    pub actions: Vec<String>,
    /// Names of the modes: hidden modes of the world, or what is remembered. Where there is only one its name may be empty.
    #[schemars(length(min = 1))]
    pub modes: Vec<String>,
    /// The belief before anything was observed, where a filter keeps it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<StartTable>,
    /// How the belief follows actions and readings, where uncertainty levels follow the model. Either this, with `start`, or `belief`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<FilterTable>,
    /// A belief that is kept in full, by the laws of the model itself, and read as one of these strata and a mean.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub belief: Option<BeliefTable>,
    /// How the mode follows them. Default: it stays as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub memory: Option<MemoryTable>,
    /// How a belief finds its node among the candidates.
    pub matching: Matching,
    /// Coordinates of the mean in which the places of nodes are stated, at most 8. Default: the state variables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(length(min = 1, max = 8))]
    pub coordinates: Option<Vec<CoordinateTable>>,
    /// What distances are divided by, more than 0: a number for each coordinate.
    pub scale: Vec<f64>,
    /// Tests by which a belief finds its node, with `matching = "tree"`: it begins with the first, and each comes before those it leads
    /// to. A feature is `mean` or `deviation` of a state variable or the probability of a `mode`, by number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tree: Option<Vec<Test>>,
    /// The nodes, at least one.
    #[schemars(length(min = 1))]
    pub nodes: Vec<NodeTable>,
}

/// A belief that is kept in full.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct BeliefTable {
    /// What keeps it: `sum` for weighted Gaussians, `cells` for probabilities of cells.
    pub tracker: TrackerKind,
    /// The model file by whose laws it is kept, word for word.
    pub model: String,
    /// What of that model keeps it: the `whole`, or only the `body` that a learner knows. Default: the whole.
    #[serde(default, skip_serializing_if = "is_whole")]
    pub of: Part,
    /// Standard deviations below which a belief counts as certain, n numbers above 0.
    pub certain: Vec<f64>,
    /// The strata, at least one. A belief is read as the nearest, by the logarithms of standard deviations, the correlations, twice the
    /// square roots of the probabilities of modes and, where the model changes with the step of the episode, half the step.
    #[schemars(length(min = 1))]
    pub strata: Vec<StratumTable>,
}

/// A stratum: everything about a belief but its mean.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct StratumTable {
    /// Covariance, n x n.
    pub covariance: Vec<Vec<f64>>,
    /// Probability of each mode; they sum to 1.
    pub modes: Vec<f64>,
    /// Step of the episode, where the model changes with it. Default: 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub step: usize,
}

/// A belief: how uncertain, in which mode, where.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct StartTable {
    /// Uncertainty level.
    pub level: usize,
    /// Mode.
    pub mode: usize,
    /// Mean, n numbers.
    pub mean: Vec<f64>,
}

/// A Kalman filter whose covariances were computed beforehand.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct FilterTable {
    /// How the state moves on its own, n x n.
    #[serde(rename = "A")]
    pub a: Rows,
    /// By action: how far it moves the state, n numbers.
    #[serde(rename = "Bu")]
    pub bu: Rows,
    /// What is sensed of the state, m x n.
    #[serde(rename = "H")]
    pub h: Rows,
    /// What takes the place of these three from later steps of an episode on, in the order of the steps. Default: nothing does.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub later: Vec<PhaseTable>,
    /// By action: its noise class. Actions of a class disturb state and sensor alike.
    pub classes: Vec<usize>,
    /// The uncertainty levels.
    #[schemars(length(min = 1))]
    pub levels: Vec<LevelTable>,
    /// The walls that the belief knows of. Default: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub walls: Option<WallsTable>,
}

/// Motion and sensor from a step of the episode on.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct PhaseTable {
    /// The first step, at least 1 and more than that of the phase before.
    #[schemars(range(min = 1))]
    pub from: usize,
    /// How the state moves on its own, n x n.
    #[serde(rename = "A")]
    pub a: Rows,
    /// By action: how far it moves the state, n numbers.
    #[serde(rename = "Bu")]
    pub bu: Rows,
    /// What is sensed of the state, m x n.
    #[serde(rename = "H")]
    pub h: Rows,
}

/// An uncertainty level.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct LevelTable {
    /// Covariance of the belief, n x n. Running the policy does not need it.
    pub covariance: Rows,
    /// The step of an episode at which it is held, counted from 0, up to the last step at which anything changes with the step. Default: 0.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub time: usize,
    /// By noise class: what a step does.
    #[schemars(length(min = 1))]
    pub steps: Vec<StepTable>,
}

/// What a step does at a level.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct StepTable {
    /// The level afterwards.
    pub next: usize,
    /// The level afterwards where the reading is missing.
    pub blind: usize,
    /// Gain K, n x m.
    pub gain: Rows,
}

/// Walls at which the mean stops.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct WallsTable {
    /// By state variable: lower and upper end of the world; `null` where there is none.
    pub bounds: Vec<Ends>,
    /// Walls inside the plane of the first two state variables, whose bounds then do not count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<MapTable>,
}

/// A map drawn as text, its bottom left corner at (0, 0).
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct MapTable {
    /// Side of a cell, more than 0.
    pub cell: f64,
    /// The drawing, top row first.
    pub rows: Vec<String>,
}

/// How the mode changes.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, rename_all = "lowercase")]
pub(super) enum MemoryTable {
    /// By the first of these that applies.
    Switches(Vec<SwitchTable>),
    /// By table.
    Recall(RecallTable),
}

/// A change of mode.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct SwitchTable {
    /// Actions it happens on. Default: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub actions: Option<Vec<usize>>,
    /// Mode it happens in. Default: any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<usize>,
    /// Where the mean must be: within all of these sides. Default: anywhere.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub region: Vec<SideTable>,
    /// Whether the mean must be there before the step, or after it. Changes before come first.
    #[schemars(with = "Moment")]
    pub when: When,
    /// Steps of an episode in which it happens: the first, and the first after them. Default: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<(usize, Option<usize>)>,
    /// Mode afterwards.
    pub becomes: usize,
}

fn is_whole(part: &Part) -> bool {
    *part == Part::Whole
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// When a mean is looked at.
#[derive(JsonSchema)]
#[serde(rename_all = "lowercase")]
#[allow(dead_code, reason = "it describes `When` in the words of this format")]
enum Moment {
    /// When the action is taken.
    Before,
    /// Once what it brought has been sensed.
    After,
}

/// A side of a region.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct SideTable {
    /// State variable.
    pub state: usize,
    /// It is at least the first and less than the second; `null` where there is no such end.
    pub within: Ends,
}

/// A table of modes.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct RecallTable {
    /// By state variable: lower and upper end of the world, by which distances are measured. Where a belief is kept in full, then by trait of
    /// its stratum.
    pub bounds: Vec<[f64; 2]>,
    /// By cluster: its centre, n numbers, and one more for each trait. A belief is in the cluster whose centre is nearest.
    #[schemars(length(min = 1))]
    pub centres: Vec<Vec<f64>>,
    /// By cluster: the mode of an episode that starts in it. The start above has it already.
    pub first: Vec<usize>,
    /// By mode, then action, then cluster of the new mean: the mode afterwards.
    pub next: Vec<Vec<Vec<usize>>>,
}

/// A coordinate of the mean.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct CoordinateTable {
    /// What it is called.
    pub name: String,
    /// The vector w, n numbers; the coordinate of a mean m is w . m.
    pub vector: Vec<f64>,
}

/// A node of the automaton.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct NodeTable {
    /// First and last uncertainty level it stands for.
    pub levels: [usize; 2],
    /// Mode it belongs to.
    pub mode: usize,
    /// Where it is among the means of its levels.
    pub place: Place,
    /// What to do.
    pub action: usize,
    /// Return expected from the node, where the solver knows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Share of all steps that were spent in it while the policy was tried, from 0 to 1.
    pub visits: f64,
    /// Pairs of a node that it was reached from and how often, not negative, in falling order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub predecessors: Vec<(usize, f64)>,
    /// What was sensed on arriving, where it was visited.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observed: Option<ObservedTable>,
}

/// What is sensed on arriving at a node.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub(super) struct ObservedTable {
    /// Mean, m numbers.
    pub mean: Vec<f64>,
    /// Covariance, m x m.
    pub covariance: Rows,
}

/// Lower and upper end, `null` where there is none.
pub(super) type Ends = [Option<f64>; 2];
