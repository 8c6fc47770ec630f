//! The finite automaton (thesis 5.4): nodes at uncertainty levels, each with an action.

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::belief::{Belief, BeliefSpace, Held, StratumId, Updater};
use crate::model::{ActionId, Fingerprint, ModeId, Model};
use crate::policy::{Coordinates, Policy, StratumFeatures, Tree};

/// Index into [`Automaton::nodes`].
pub type NodeId = usize;

/// A policy as a finite automaton. Running it is: update the filter, match a node, act.
#[derive(Debug, Clone, PartialEq)]
pub struct Automaton {
    /// Name of the problem it was made for.
    pub problem: String,
    /// [`crate::model::Model::fingerprint`] of that problem.
    pub fingerprint: Fingerprint,
    /// Name of the solver that made it.
    pub solver: String,
    /// How a belief finds its node.
    pub matching: Matching,
    /// Names of the state variables.
    pub states: Vec<String>,
    /// Names of the actions.
    pub actions: Vec<String>,
    /// Names of the modes, or memories.
    pub modes: Vec<String>,
    /// Covariance of every level, row by row.
    pub levels: Vec<Vec<f64>>,
    /// Return expected from the start, where the solver knows.
    pub planned_value: Option<f64>,
    /// Coordinates in which places are stated; `None` for the state variables themselves.
    pub coordinates: Option<Coordinates>,
    /// Scale of each state variable, or coordinate, when distances are measured; 1 leaves it.
    pub scale: Vec<f64>,
    /// The tree by which a belief finds its node, where [`Matching::Tree`] is how.
    pub tree: Option<Tree>,
    /// The nodes.
    pub nodes: Vec<Node>,
    /// What keeps the belief.
    pub updater: Updater,
}

/// How a belief finds its node, among those of its level and mode or by a tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Matching {
    /// The nearest point (5.4.2).
    Nearest,
    /// The smallest box that holds the mean; outside all, the nearest box (5.4.1).
    Segments,
    /// The node that a decision tree leads to.
    Tree,
}

/// A node of the automaton.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// First and last uncertainty level it stands for.
    pub levels: (StratumId, StratumId),
    /// Mode, or memory, it belongs to.
    pub mode: ModeId,
    /// Where it is among the means of its levels, in [`Automaton::coordinates`].
    pub place: Place,
    /// What to do.
    pub action: ActionId,
    /// Return expected from the node, where the solver knows.
    pub value: Option<f64>,
    /// Mean and covariance of what was sensed on arriving, where it was visited.
    pub observed: Option<Observed>,
    /// Nodes it is reached from, with how often, in falling order.
    pub predecessors: Vec<(NodeId, f64)>,
    /// Share of all steps spent in it, in `[0, 1]`.
    pub visits: f64,
}

/// A point or box of means.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Place {
    /// A representative belief point, length `n`.
    Point(Vec<f64>),
    /// A belief segment: its corners and the point of least value in it (Figure 5.7), each of length `n`.
    Segment {
        /// Lower corner.
        lower: Vec<f64>,
        /// Point of least value.
        minimum: Vec<f64>,
        /// Upper corner.
        upper: Vec<f64>,
    },
}

/// What is sensed on arriving at a node.
#[derive(Debug, Clone, PartialEq)]
pub struct Observed {
    /// Mean, length `m`.
    pub mean: Vec<f64>,
    /// Covariance, row by row, `m x m`.
    pub covariance: Vec<f64>,
}

impl Node {
    /// A node nothing is known of yet but its place and action.
    pub fn new(
        levels: RangeInclusive<StratumId>,
        mode: ModeId,
        place: Place,
        action: ActionId,
        value: Option<f64>,
    ) -> Self {
        Self {
            levels: levels.into_inner(),
            mode,
            place,
            action,
            value,
            observed: None,
            predecessors: Vec::new(),
            visits: 0.0,
        }
    }
}

impl Node {
    /// How many levels it is away from one; 0 where it stands for it.
    fn gap(&self, level: StratumId) -> usize {
        let (first, last) = self.levels;
        first.saturating_sub(level).max(level.saturating_sub(last))
    }
}

impl Place {
    /// Squared distance from a mean, each variable divided by its scale; 0 inside a segment.
    pub fn distance(&self, mean: &[f64], scale: &[f64]) -> f64 {
        let square = |apart: f64, scale: f64| (apart / scale) * (apart / scale);
        match self {
            Self::Point(point) => mean
                .iter()
                .zip(point)
                .zip(scale)
                .map(|((m, x), s)| square(m - x, *s))
                .sum(),
            Self::Segment { lower, upper, .. } => (0..mean.len())
                .map(|i| {
                    square(
                        (lower[i] - mean[i]).max(mean[i] - upper[i]).max(0.0),
                        scale[i],
                    )
                })
                .sum(),
        }
    }

    /// Lower corner; a point is its own.
    pub(crate) fn lower(&self) -> &[f64] {
        match self {
            Self::Point(point) => point,
            Self::Segment { lower, .. } => lower,
        }
    }

    /// Upper corner; a point is its own.
    pub(crate) fn upper(&self) -> &[f64] {
        match self {
            Self::Point(point) => point,
            Self::Segment { upper, .. } => upper,
        }
    }

    /// Volume of a segment; 0 for a point.
    pub(crate) fn volume(&self) -> f64 {
        match self {
            Self::Point(_) => 0.0,
            Self::Segment { lower, upper, .. } => lower
                .iter()
                .zip(upper)
                .map(|(low, high)| high - low)
                .product(),
        }
    }

    /// The point that stands for the place: itself, or the middle of a segment.
    pub fn centre(&self) -> Vec<f64> {
        match self {
            Self::Point(point) => point.clone(),
            Self::Segment { lower, upper, .. } => lower
                .iter()
                .zip(upper)
                .map(|(low, high)| 0.5 * (low + high))
                .collect(),
        }
    }
}

impl Automaton {
    /// An automaton without nodes for a problem.
    pub fn new(space: &dyn BeliefSpace, solver: &str, matching: Matching) -> Self {
        let model = space.model();
        Self {
            problem: model.name.clone(),
            fingerprint: model.fingerprint(),
            solver: solver.to_owned(),
            matching,
            states: model
                .state
                .iter()
                .map(|variable| variable.name.clone())
                .collect(),
            actions: model
                .actions
                .iter()
                .map(|action| action.name.clone())
                .collect(),
            modes: model.modes.clone(),
            levels: (0..space.strata())
                .map(|level| space.covariance(level).transpose().as_slice().to_vec())
                .collect(),
            planned_value: None,
            coordinates: None,
            scale: vec![1.0; model.state_dim()],
            tree: None,
            nodes: Vec::new(),
            updater: space.updater(),
        }
    }

    /// The beliefs of the model that it was made for, as it reads them.
    pub fn space(&self, model: &Model) -> Box<dyn BeliefSpace> {
        self.updater.space(model)
    }

    /// The node of a belief by what it is read as; `None` only without nodes.
    pub fn matched(&self, belief: &Belief) -> Option<NodeId> {
        if let Some(tree) = &self.tree {
            let features = StratumFeatures::of(self, belief.stratum);
            return (!self.nodes.is_empty()).then(|| tree.find(&(&features, belief)));
        }
        let candidates = self.candidates(belief.stratum, belief.mode);
        match &self.coordinates {
            None => self.closest(candidates, &belief.mean),
            Some(coordinates) => self.closest(candidates, &coordinates.of(&belief.mean)),
        }
    }

    /// Names of what places are stated in: the coordinates, or else the state variables.
    pub fn place_names(&self) -> &[String] {
        let coordinates = self.coordinates.as_ref();
        coordinates.map_or(&self.states, |coordinates| &coordinates.names)
    }

    /// Nodes among which a belief of this level and mode finds its own. A level or mode without nodes borrows those of the
    /// nearest level in the same mode, then of any mode.
    pub(crate) fn candidates(
        &self,
        level: StratumId,
        mode: ModeId,
    ) -> impl Iterator<Item = NodeId> {
        let gap = move |node: &Node| (node.mode != mode, node.gap(level));
        let smallest = self.nodes.iter().map(gap).min();
        (0..self.nodes.len()).filter(move |&id| Some(gap(&self.nodes[id])) == smallest)
    }

    /// The nodes of a mode; all of them where it has none.
    pub(super) fn of_mode(&self, mode: ModeId) -> Vec<NodeId> {
        let own = |id: &NodeId| self.nodes[*id].mode == mode;
        let nodes = 0..self.nodes.len();
        match nodes.clone().filter(own).collect::<Vec<_>>() {
            none if none.is_empty() => nodes.collect(),
            own => own,
        }
    }

    /// Those of the nodes of a mode that are nearest to a level. With [`Automaton::of_mode`] they are the [`Automaton::candidates`], found
    /// without looking at the nodes of all other modes again at every level.
    pub(super) fn nearest_to_level(
        &self,
        level: StratumId,
        own: &[NodeId],
    ) -> impl Iterator<Item = NodeId> {
        let gap = move |id: &&NodeId| self.nodes[**id].gap(level);
        let smallest = own.iter().map(|id| gap(&id)).min();
        own.iter()
            .filter(move |id| Some(gap(id)) == smallest)
            .copied()
    }

    pub(super) fn closest(
        &self,
        candidates: impl Iterator<Item = NodeId>,
        mean: &[f64],
    ) -> Option<NodeId> {
        candidates
            .map(|id| {
                let place = &self.nodes[id].place;
                (id, place.distance(mean, &self.scale), place.volume())
            })
            .min_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)))
            .map(|(id, _, _)| id)
    }
}

impl Policy for Automaton {
    fn action(&self, belief: &Belief) -> ActionId {
        self.matched(belief).map_or(0, |id| self.nodes[id].action)
    }

    fn action_in_full(&self, held: &Held) -> ActionId {
        let matched = self.matched_in_full(held);
        matched.map_or(0, |id| self.nodes[id].action)
    }

    fn value(&self, belief: &Belief) -> Option<f64> {
        self.nodes[self.matched(belief)?].value
    }
}
