//! Nodes found by a decision tree: questions about a belief, one after the other, until a node is left.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Automaton, NodeId};
use crate::belief::{Belief, Filter, Held, Moments, StratumId};
use crate::model::ModeId;

/// Something about a belief that a tree asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Feature {
    /// The mean of a state variable.
    Mean(usize),
    /// Its standard deviation: that of the belief where it is kept in full, else that of its uncertainty level.
    Deviation(usize),
    /// Probability of a mode; 1 or 0 where one mode is believed.
    Mode(ModeId),
    /// Step of the episode, from 0.
    Step,
}

/// Where a tree goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Branch {
    /// At a node: it is found.
    Node(NodeId),
    /// With another test.
    Test(usize),
}

/// A question: whether a feature, or a weighted sum of features, is less than a number.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub struct Test {
    /// What is asked for.
    pub feature: Feature,
    /// What is added to it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plus: Vec<Term>,
    /// The number.
    pub less_than: f64,
    /// Where to go on if it is less.
    pub yes: Branch,
    /// Where to go on if it is not.
    pub no: Branch,
}

/// A part of a weighted sum of features.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
pub struct Term {
    /// The weight, finite.
    pub times: f64,
    /// What it weighs.
    pub feature: Feature,
}

/// A decision tree over beliefs. It begins with the first test; without tests, all beliefs are at node 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Tree {
    /// The tests, each before those that it leads to.
    pub tests: Vec<Test>,
}

/// Whatever can be asked for the features of a belief.
pub(crate) trait Asked {
    /// What a feature is.
    fn feature(&self, feature: Feature) -> f64;

    /// Whether the answer to a test is yes.
    fn passes(&self, test: &Test) -> bool {
        let add = |sum, term: &Term| sum + term.times * self.feature(term.feature);
        test.plus.iter().fold(self.feature(test.feature), add) < test.less_than
    }
}

/// A belief in full answers for itself.
impl Asked for Moments {
    fn feature(&self, feature: Feature) -> f64 {
        match feature {
            Feature::Mean(variable) => self.mean[variable],
            Feature::Deviation(variable) => {
                let variance = self.covariance[variable * (self.mean.len() + 1)];
                variance.max(0.0).sqrt()
            }
            Feature::Mode(mode) => self.weights[mode],
            Feature::Step => self.step as f64,
        }
    }
}

/// What a tree may ask of the beliefs of a stratum, means apart.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StratumFeatures {
    /// Standard deviations, length `n`.
    pub deviations: Vec<f64>,
    /// Probability of each mode; `None` where one is believed.
    pub weights: Option<Vec<f64>>,
    /// Step of the episode, as far as steps are told apart.
    pub step: usize,
}

/// A belief as it is read: its stratum answers for all but its mean.
impl Asked for (&StratumFeatures, &Belief) {
    fn feature(&self, feature: Feature) -> f64 {
        let (stratum, belief) = self;
        match feature {
            Feature::Mean(variable) => belief.mean[variable],
            Feature::Deviation(variable) => stratum.deviations[variable],
            Feature::Mode(mode) => match &stratum.weights {
                Some(weights) => weights[mode],
                None => f64::from(belief.mode == mode),
            },
            Feature::Step => stratum.step as f64,
        }
    }
}

impl StratumFeatures {
    /// Those of a stratum of an automaton.
    pub(crate) fn of(automaton: &Automaton, stratum: StratumId) -> Self {
        let n = automaton.states.len();
        let covariance = &automaton.levels[stratum];
        let deviation = |i: usize| covariance[i * n + i].max(0.0).sqrt();
        let codebook = automaton.updater.codebook();
        let time = |filter: &Filter| filter.times.get(stratum).copied();
        Self {
            step: match codebook {
                Some(codebook) => codebook.stratum(stratum).step,
                None => automaton.updater.filter().and_then(time).unwrap_or(0),
            },
            deviations: (0..n).map(deviation).collect(),
            weights: codebook.map(|codebook| codebook.stratum(stratum).weights.clone()),
        }
    }
}

impl Tree {
    /// The node of a belief.
    pub(crate) fn find(&self, belief: &impl Asked) -> NodeId {
        let mut branch = self.first();
        loop {
            match branch {
                Branch::Node(node) => return node,
                Branch::Test(test) => {
                    let test = &self.tests[test];
                    branch = match belief.passes(test) {
                        true => test.yes,
                        false => test.no,
                    };
                }
            }
        }
    }

    fn first(&self) -> Branch {
        match self.tests.is_empty() {
            true => Branch::Node(0),
            false => Branch::Test(0),
        }
    }
}

impl Automaton {
    /// The node of a belief as it is held: a tree asks the belief in full where there is one. `None` only without nodes.
    pub fn matched_in_full(&self, held: &Held) -> Option<NodeId> {
        match (&self.tree, held.moments()) {
            (Some(tree), Some(moments)) => (!self.nodes.is_empty()).then(|| tree.find(moments)),
            _ => self.matched(held.belief()),
        }
    }
}

impl Automaton {
    /// The tree as nested conditions, a line for each test and node; empty for an automaton without a tree.
    pub fn conditions(&self) -> String {
        let mut lines = Vec::new();
        if let Some(tree) = &self.tree {
            self.write_branch(tree, tree.first(), 0, &mut lines);
        }
        lines.join("\n")
    }

    fn write_branch(&self, tree: &Tree, branch: Branch, depth: usize, lines: &mut Vec<String>) {
        let indent = "  ".repeat(depth);
        match branch {
            Branch::Node(id) => {
                let node = &self.nodes[id];
                lines.push(format!("{indent}{}  # {id}", self.actions[node.action]));
            }
            Branch::Test(test) => {
                let test = &tree.tests[test];
                let (asked, number) = (self.asked(test), rounded(test.less_than));
                lines.push(format!("{indent}if {asked} < {number}:"));
                self.write_branch(tree, test.yes, depth + 1, lines);
                lines.push(format!("{indent}else:"));
                self.write_branch(tree, test.no, depth + 1, lines);
            }
        }
    }

    /// What a test asks for, as in `x - 2*y`.
    fn asked(&self, test: &Test) -> String {
        let mut asked = self.feature_name(test.feature);
        for Term { times, feature } in &test.plus {
            let sign = if *times < 0.0 { '-' } else { '+' };
            let name = self.feature_name(*feature);
            asked += &match rounded(times.abs()) {
                1.0 => format!(" {sign} {name}"),
                times => format!(" {sign} {times}*{name}"),
            };
        }
        asked
    }

    /// What a feature is called: the state variable, its standard deviation `sd_x`, the probability `p_m` of a mode.
    pub fn feature_name(&self, feature: Feature) -> String {
        match feature {
            Feature::Mean(variable) => self.states[variable].clone(),
            Feature::Deviation(variable) => format!("sd_{}", self.states[variable]),
            Feature::Mode(mode) => format!("p_{}", self.modes[mode]),
            Feature::Step => "t".to_owned(),
        }
    }
}

/// A number with four significant digits, as a person would write it.
fn rounded(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
