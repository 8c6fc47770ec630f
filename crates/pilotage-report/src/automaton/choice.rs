//! What of an automaton is drawn: its most visited nodes, and the ways between them that matter.

use std::collections::{BTreeMap, BTreeSet};

use pilotage::policy::{Automaton, NodeId};

/// Most nodes a drawing holds.
pub const MOST_NODES: usize = 40;
/// Most arrows that are labelled; with more, their width has to do.
const MOST_LABELS: usize = 40;
/// Arrivals an arrow must carry to be drawn, the first of these shares that thins the drawing enough.
const SHARES: [f64; 7] = [0.01, 0.02, 0.03, 0.05, 0.1, 0.15, 0.2];

/// The part that is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// Its nodes, the start node first, then by how often they are visited.
    pub nodes: Vec<NodeId>,
    /// The node of the start belief.
    pub start: Option<NodeId>,
    /// Its arrows.
    pub arrows: Vec<Arrow>,
    /// Whether arrows are labelled with their share; where they are not, two that go to and fro are one with two heads.
    pub labelled: bool,
    /// Share of a node's arrivals below which an arrow is left out.
    pub least_share: f64,
    /// Share of all steps that is spent in nodes left out.
    pub visits_left_out: f64,
}

/// A way from one node to another, or both ways where they are drawn as one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrow {
    /// Where it leaves, as a position in [`Choice::nodes`].
    pub from: usize,
    /// Where it arrives, as a position in [`Choice::nodes`].
    pub to: usize,
    /// Share of what leaves `from` that goes this way; the larger of both ways.
    pub share: f64,
    /// Whether it stands for the way back as well.
    pub both: bool,
}

impl Choice {
    /// Chooses.
    pub fn of(automaton: &Automaton) -> Self {
        let start = automaton.matched_in_full(&automaton.updater.start());
        let visits = |id: NodeId| automaton.nodes[id].visits;
        let mut nodes: Vec<NodeId> = (0..automaton.nodes.len()).collect();
        nodes.sort_by(|&a, &b| {
            let first = (Some(b) == start).cmp(&(Some(a) == start));
            first.then(visits(b).total_cmp(&visits(a))).then(a.cmp(&b))
        });
        let left_out = nodes.split_off(nodes.len().min(MOST_NODES));
        let (least_share, mut arrows) = arrows(automaton, &nodes);
        let labelled = arrows.len() <= MOST_LABELS;
        if !labelled {
            arrows = joined(&arrows);
        }
        Self {
            nodes,
            start,
            arrows,
            labelled,
            least_share,
            visits_left_out: left_out.into_iter().map(visits).sum(),
        }
    }
}

/// Arrows to and fro made one.
fn joined(arrows: &[Arrow]) -> Vec<Arrow> {
    let mut kept: Vec<Arrow> = Vec::new();
    for arrow in arrows {
        let back = kept.iter_mut().find(|other| {
            arrow.from != arrow.to && (other.from, other.to) == (arrow.to, arrow.from)
        });
        match back {
            Some(back) => {
                back.both = true;
                back.share = back.share.max(arrow.share);
            }
            None => kept.push(*arrow),
        }
    }
    kept
}

fn arrows(automaton: &Automaton, nodes: &[NodeId]) -> (f64, Vec<Arrow>) {
    let mut leaving = vec![0.0; automaton.nodes.len()];
    for node in &automaton.nodes {
        for &(from, count) in &node.predecessors {
            if let Some(total) = leaving.get_mut(from) {
                *total += count;
            }
        }
    }
    let main_ways = main_ways(automaton, nodes);
    let above = |least: f64| -> Vec<Arrow> {
        let mut arrows = Vec::new();
        for (to, &id) in nodes.iter().enumerate() {
            let predecessors = &automaton.nodes[id].predecessors;
            let arrivals: f64 = predecessors.iter().map(|(_, count)| count).sum();
            for &(before, count) in predecessors {
                let Some(from) = nodes.iter().position(|&other| other == before) else {
                    continue;
                };
                let main = main_ways.contains(&(before, id));
                if count > 0.0 && (main || count >= least * arrivals) {
                    let share = count / leaving[before];
                    arrows.push(Arrow {
                        from,
                        to,
                        share,
                        both: false,
                    });
                }
            }
        }
        arrows
    };
    let enough = (3 * nodes.len() + 8).min(2 * nodes.len() + 20);
    let mut thinnest = (SHARES[0], above(SHARES[0]));
    for share in SHARES {
        if thinnest.1.len() <= enough {
            break;
        }
        thinnest = (share, above(share));
    }
    thinnest
}

/// The most followed way into and out of every node, of those between nodes drawn. They are kept, so that the drawing does
/// not fall apart.
fn main_ways(automaton: &Automaton, nodes: &[NodeId]) -> BTreeSet<(NodeId, NodeId)> {
    let mut best_out: BTreeMap<NodeId, (f64, NodeId)> = BTreeMap::new();
    let mut ways = BTreeSet::new();
    for &id in nodes {
        let others = automaton.nodes[id]
            .predecessors
            .iter()
            .filter(|(from, count)| *from != id && *count > 0.0 && nodes.contains(from));
        let mut best_in = (0.0, id);
        for &(from, count) in others {
            if count > best_in.0 {
                best_in = (count, from);
            }
            let out = best_out.entry(from).or_insert((0.0, id));
            if count > out.0 {
                *out = (count, id);
            }
        }
        if best_in.1 != id {
            ways.insert((best_in.1, id));
        }
    }
    ways.extend(best_out.into_iter().map(|(from, (_, to))| (from, to)));
    ways
}
