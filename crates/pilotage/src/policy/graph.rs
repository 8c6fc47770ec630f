//! A policy that needs no belief: what was sensed says at which node to go on.

use super::NodeId;
use crate::belief::Reading;
use crate::model::{ActionId, Fingerprint, Model};

/// A policy graph, which is a finite-state controller: nodes with an action each, and where to go on after every signal of a discrete
/// sensor. It begins at the first node, and does so again whenever an episode begins again.
///
/// # References
/// - E. A. Hansen, "Solving POMDPs by searching in policy space", 1998.
#[derive(Debug, Clone, PartialEq)]
pub struct PolicyGraph {
    /// Name of the problem it was made for.
    pub problem: String,
    /// [`crate::model::Model::fingerprint`] of that problem.
    pub fingerprint: Fingerprint,
    /// Name of the solver that made it.
    pub solver: String,
    /// Names of the actions.
    pub actions: Vec<String>,
    /// Names of the signals.
    pub signals: Vec<String>,
    /// Return expected from the start over an episode, where the solver knows.
    pub planned_value: Option<f64>,
    /// The nodes, of which the first is where an episode begins.
    pub nodes: Vec<GraphNode>,
}

/// A node of a policy graph.
#[derive(Debug, Clone, PartialEq)]
pub struct GraphNode {
    /// What to do.
    pub action: ActionId,
    /// Where to go on after each signal, and last, after none. Empty where the episode never goes on after the action; whoever goes on all
    /// the same stays.
    pub next: Vec<NodeId>,
    /// Share of all steps of an episode that are spent in it, in `[0, 1]`.
    pub visits: f64,
    /// Share of all steps after which each way of `next` is gone, in `[0, 1]`.
    pub gone: Vec<f64>,
}

/// Ways of a node that lead to the same node.
#[derive(Debug, Clone, PartialEq)]
pub struct Exit {
    /// Where they lead.
    pub to: NodeId,
    /// The signals, by number; that of none is the number of signals.
    pub after: Vec<usize>,
    /// Share of all steps after which one of them is gone.
    pub gone: f64,
}

impl PolicyGraph {
    /// A graph without nodes for a model with a discrete sensor.
    pub fn new(model: &Model, solver: &str) -> Self {
        let actions = model.actions.iter();
        Self {
            problem: model.name.clone(),
            fingerprint: model.fingerprint(),
            solver: solver.to_owned(),
            actions: actions.map(|action| action.name.clone()).collect(),
            signals: model.laws.symbols.clone(),
            planned_value: None,
            nodes: Vec::new(),
        }
    }

    /// What a signal is called; that after the last is `nothing`.
    pub fn signal_name(&self, signal: usize) -> &str {
        self.signals.get(signal).map_or("nothing", String::as_str)
    }

    /// The ways of a node, those that lead to the same node together.
    pub fn exits(&self, node: NodeId) -> Vec<Exit> {
        let node = &self.nodes[node];
        let mut exits: Vec<Exit> = Vec::new();
        for (signal, &to) in node.next.iter().enumerate() {
            let gone = node.gone.get(signal).copied().unwrap_or(0.0);
            match exits.iter_mut().find(|exit| exit.to == to) {
                Some(exit) => {
                    exit.after.push(signal);
                    exit.gone += gone;
                }
                None => exits.push(Exit {
                    to,
                    after: vec![signal],
                    gone,
                }),
            }
        }
        exits
    }

    /// The graph in words, a line for each node: `0  UP    on bright go to 2; on dark or nothing go to 1`.
    pub fn in_words(&self) -> String {
        let number = (self.nodes.len().max(1) - 1).to_string().len();
        let names = self.actions.iter().map(|name| name.chars().count());
        let name = names.max().unwrap_or(0);
        let line = |(id, node): (NodeId, &GraphNode)| {
            let action = &self.actions[node.action];
            let then = self.then_in_words(id);
            format!("{id:>number$}  {action:<name$}  {then}")
        };
        let lines: Vec<String> = self.nodes.iter().enumerate().map(line).collect();
        lines.join("\n")
    }

    fn then_in_words(&self, node: NodeId) -> String {
        let exits = self.exits(node);
        let told = |exit: &Exit| {
            let names = exit.after.iter().map(|signal| self.signal_name(*signal));
            let names = names.collect::<Vec<_>>().join(" or ");
            format!("on {names} go to {}", exit.to)
        };
        match exits.as_slice() {
            [] => "the episode ends or begins again".to_owned(),
            [only] => format!("go to {}", only.to),
            exits => exits.iter().map(told).collect::<Vec<_>>().join("; "),
        }
    }
}

/// Runs a policy graph: an index and a table. A step allocates nothing.
#[derive(Debug, Clone)]
pub struct GraphRunner {
    actions: Vec<ActionId>,
    /// By node and signal, the last of which is none.
    next: Vec<NodeId>,
    /// Signals, and none.
    width: usize,
    node: NodeId,
}

impl GraphRunner {
    /// Lays out a graph. One without nodes does action 0.
    pub fn new(graph: &PolicyGraph) -> Self {
        let width = graph.signals.len() + 1;
        let row = |(id, node): (NodeId, &GraphNode)| match node.next.is_empty() {
            true => vec![id; width],
            false => node.next.clone(),
        };
        Self {
            actions: graph.nodes.iter().map(|node| node.action).collect(),
            next: graph.nodes.iter().enumerate().flat_map(row).collect(),
            width,
            node: 0,
        }
    }

    /// Back to the first node.
    pub fn reset(&mut self) {
        self.node = 0;
    }

    /// The node of now, and its action.
    pub fn decide(&self) -> (NodeId, ActionId) {
        let action = self.actions.get(self.node).copied().unwrap_or(0);
        (self.node, action)
    }

    /// Takes in what was sensed after the action. Numbers, and signals that the graph does not know, say nothing.
    pub fn observe(&mut self, reading: Reading<'_>) {
        let nothing = self.width - 1;
        let signal = match reading {
            Reading::Symbol(signal) => (signal as usize).min(nothing),
            Reading::Values(_) | Reading::Nothing => nothing,
        };
        let next = self.next.get(self.node * self.width + signal);
        self.node = next.copied().unwrap_or(self.node);
    }
}
