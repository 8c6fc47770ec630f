//! Making a graph better, node by node, by what is believed where.
//!
//! At every node the action is chosen, and where to go on after each signal, that is worth most for the beliefs with which it is met. They
//! differ once anything is changed: so a change is kept only if the exact value of the graph says so.
//!
//! # References
//! - P. Poupart and C. Boutilier, "Bounded finite state controllers", 2003.

use nalgebra::DMatrix;

use super::graph::{Graph, Grapher, Node, reached};
use super::occupied::met;
use crate::model::ActionId;

/// Times that all nodes are looked at, at most.
const ROUNDS: usize = 60;

/// A round that gains less than this share of the value is the last one.
const LITTLE: f64 = 1e-5;

/// A change has to gain this share of the value.
const GAIN: f64 = 1e-9;

/// The graph with better nodes, of which there are as many or fewer.
pub(super) fn tuned(grapher: &Grapher<'_>, mut graph: Graph) -> Graph {
    for _ in 0..ROUNDS {
        let before = graph.value;
        let met = met(grapher, &graph);
        let often: Vec<f64> = met.iter().map(|met| met.iter().sum()).collect();
        let mut order: Vec<usize> = (0..graph.nodes.len()).collect();
        order.sort_by(|a, b| often[*b].total_cmp(&often[*a]));
        for node in order {
            let Some(better) = better(grapher, &graph, node, &met[node]) else {
                continue;
            };
            let mut nodes = graph.nodes.clone();
            nodes[node] = better;
            let next = grapher.valued(nodes, graph.values.clone());
            if next.value > graph.value + GAIN * graph.value.abs() {
                graph = next;
            }
        }
        if graph.value - before <= LITTLE * graph.value.abs() {
            break;
        }
    }
    let (nodes, values) = reached(&graph.nodes, &graph.values, 0);
    Graph {
        nodes,
        values,
        value: graph.value,
    }
}

/// What to do at a node, and where to go on, that is best for the beliefs in which it is met, if it is better than what it has.
fn better(grapher: &Grapher<'_>, graph: &Graph, node: usize, met: &[f64]) -> Option<Node> {
    let values = DMatrix::from_fn(met.len(), graph.nodes.len(), |state, node| {
        graph.values[node][state]
    });
    let own = dot(met, &graph.values[node]);
    let mut best = (own + GAIN * own.abs(), None);
    for action in 0..grapher.likely.len() {
        let (worth, node) = chosen(grapher, graph, action, met, &values);
        if worth > best.0 {
            best = (worth, Some(node));
        }
    }
    best.1
}

/// An action with the best nodes to go on at, and what that is worth.
fn chosen(
    grapher: &Grapher<'_>,
    graph: &Graph,
    action: ActionId,
    met: &[f64],
    values: &DMatrix<f64>,
) -> (f64, Node) {
    let (keeping, discount) = (&*grapher.backup.keeping, grapher.backup.discount);
    let mut moved = vec![0.0; met.len()];
    keeping.forward(action, met, &mut moved);
    let restarted = dot(met, keeping.restarts(action)) * graph.value;
    let mut worth = dot(met, keeping.rewards(action)) + discount * restarted;
    let mut next = Vec::new();
    if grapher.goes_on[action] {
        let likely = &grapher.likely[action];
        let arriving = DMatrix::from_fn(met.len(), likely.nrows(), |state, signal| {
            likely[(signal, state)] * moved[state]
        });
        for column in values.tr_mul(&arriving).column_iter() {
            let (best, most) = column.argmax();
            worth += discount * most;
            next.push(best);
        }
    }
    (worth, Node { action, next })
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
