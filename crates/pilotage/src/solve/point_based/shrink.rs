//! Making a graph smaller, and better, by what is believed along its ways.
//!
//! How often and with which beliefs each way of a graph is gone is known. On each way one may go on with the node that is worth most for
//! those beliefs, and a node whose ways lose little elsewhere can be spared. What that is worth is an estimate, as other nodes see other
//! beliefs then: so a change is kept only if the exact value of the graph says so.

use nalgebra::DMatrix;

use super::graph::{Graph, Grapher, merged, reached};
use super::occupied::met;
use crate::belief::Keeping;

/// Rounds in which nodes are spared, at most.
const ROUNDS: usize = 60;

/// In a round not more than this share of the nodes is spared at once.
const AT_ONCE: f64 = 0.5;

/// How often a round that lost too much is tried again with half of the nodes spared.
const TRIES: usize = 8;

/// A way of a graph: from a node after a signal.
struct Way {
    node: usize,
    signal: usize,
}

/// What each way is worth if it leads to each node.
struct Worth {
    ways: Vec<Way>,
    /// Ways by nodes; the last row is the start.
    worth: DMatrix<f64>,
}

/// A graph with at most so many nodes, or with a share of those that it has, whatever that costs.
pub(super) fn squeezed(grapher: &Grapher<'_>, graph: &Graph, most: usize, leaves: f64) -> Graph {
    let nodes = graph.nodes.len();
    let left = ((nodes as f64 * leaves) as usize).max(most);
    Worth::new(grapher, graph).without(grapher, graph, nodes - left.min(nodes))
}

/// A graph with fewer nodes, worth at least `floor`.
pub(super) fn shrunk(grapher: &Grapher<'_>, mut graph: Graph, floor: f64) -> Graph {
    for _ in 0..ROUNDS {
        let worth = Worth::new(grapher, &graph);
        let mut spared = (graph.nodes.len() as f64 * AT_ONCE) as usize;
        let mut smaller = None;
        for _ in 0..TRIES {
            let next = worth.without(grapher, &graph, spared);
            let fewer = next.nodes.len() < graph.nodes.len();
            if next.value >= floor && (fewer || next.value > graph.value) {
                smaller = Some(next);
                break;
            }
            spared /= 2;
        }
        let Some(next) = smaller else { break };
        let gained = next.value - graph.value > 1e-6 * graph.value.abs();
        let done = next.nodes.len() == graph.nodes.len() && !gained;
        graph = next;
        if done {
            break;
        }
    }
    graph
}

impl Worth {
    fn new(grapher: &Grapher<'_>, graph: &Graph) -> Self {
        let (ways, beliefs) = along(grapher, graph);
        let states = grapher.backup.keeping.states();
        let nodes = graph.nodes.len();
        let values = DMatrix::from_fn(states, nodes, |state, node| graph.values[node][state]);
        let beliefs = DMatrix::from_fn(states, beliefs.len(), |state, way| beliefs[way][state]);
        Self {
            ways,
            worth: beliefs.tr_mul(&values),
        }
    }

    /// The graph on which `spared` nodes of least worth are gone around.
    fn without(&self, grapher: &Grapher<'_>, graph: &Graph, spared: usize) -> Graph {
        let chosen = self.chosen(graph, spared);
        let mut nodes = graph.nodes.clone();
        for (way, node) in self.ways.iter().zip(&chosen) {
            nodes[way.node].next[way.signal] = *node;
        }
        let (nodes, values) = reached(&nodes, &graph.values, chosen[chosen.len() - 1]);
        merged(grapher.valued(nodes, values))
    }

    /// Where each way leads once the nodes that are missed least are spared, one after the other. Ways to other nodes stay as they are, so
    /// that what those are worth stays true as well as can be.
    fn chosen(&self, graph: &Graph, spared: usize) -> Vec<usize> {
        let (ways, nodes) = self.worth.shape();
        let mut kept = vec![true; nodes];
        let now = |way: &Way| graph.nodes[way.node].next[way.signal];
        let mut leads: Vec<usize> = self.ways.iter().map(now).collect();
        leads.push(0);
        let mut other: Vec<usize> = (0..ways)
            .map(|way| self.best(way, &kept, leads[way]))
            .collect();
        let missed = |way: usize, now: usize, other: usize| {
            self.worth[(way, now)] - self.worth[(way, other)]
        };
        let mut loss = vec![0.0; nodes];
        for way in 0..ways {
            loss[leads[way]] += missed(way, leads[way], other[way]);
        }
        for _ in 0..spared.min(nodes - 1) {
            let left = (0..nodes).filter(|node| kept[*node]);
            let Some(least) = left.min_by(|a, b| loss[*a].total_cmp(&loss[*b])) else {
                break;
            };
            kept[least] = false;
            for way in 0..ways {
                if leads[way] != least && other[way] != least {
                    continue;
                }
                if leads[way] != least {
                    loss[leads[way]] -= missed(way, leads[way], other[way]);
                } else {
                    leads[way] = other[way];
                }
                other[way] = self.best(way, &kept, leads[way]);
                loss[leads[way]] += missed(way, leads[way], other[way]);
            }
        }
        leads
    }

    /// The best of the nodes that are kept for a way, but for one.
    fn best(&self, way: usize, kept: &[bool], but: usize) -> usize {
        let mut best = (but, f64::NEG_INFINITY);
        for node in (0..kept.len()).filter(|node| kept[*node] && *node != but) {
            if self.worth[(way, node)] > best.1 {
                best = (node, self.worth[(way, node)]);
            }
        }
        best.0
    }
}

/// The ways of a graph, and the beliefs with which they are gone, weighed by how often, discounted; last those of the start.
fn along(grapher: &Grapher<'_>, graph: &Graph) -> (Vec<Way>, Vec<Vec<f64>>) {
    let backup = grapher.backup;
    let keeping = &*backup.keeping;
    let states = keeping.states();
    let met = met(grapher, graph);
    let mut ways = Vec::new();
    let mut beliefs = Vec::new();
    for (number, node) in graph.nodes.iter().enumerate() {
        let mut moved = vec![0.0; states];
        keeping.forward(node.action, &met[number], &mut moved);
        for signal in 0..node.next.len() {
            let likely = grapher.likely[node.action].row(signal);
            let belief = moved.iter().zip(likely.iter());
            ways.push(Way {
                node: number,
                signal,
            });
            beliefs.push(belief.map(|(mass, likely)| mass * likely).collect());
        }
    }
    let start = keeping.start();
    beliefs.push(start.probabilities().to_vec());
    (ways, beliefs)
}
