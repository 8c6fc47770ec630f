//! Where a graph is in the course of an episode, with which beliefs, and which ways it goes.

use super::graph::{Graph, Grapher, merged, reached};
use crate::belief::Keeping;

/// Occupancies are followed until so little of them is left, or so many steps.
const LEFT: f64 = 1e-6;
const STEPS: usize = 5_000;

/// A way with less than this share of all steps is never gone.
const NEVER: f64 = 1e-12;

/// How often nodes are met and ways are gone in an episode, as shares of all its steps.
pub(super) struct Shares {
    /// By node.
    pub(super) visits: Vec<f64>,
    /// By node and signal.
    pub(super) gone: Vec<Vec<f64>>,
}

/// How often each node is met, discounted, by mode and cell.
pub(super) fn met(grapher: &Grapher<'_>, graph: &Graph) -> Vec<Vec<f64>> {
    let mut now = start(grapher, graph);
    let mut met = now.clone();
    for _ in 0..STEPS {
        now = step(grapher, graph, &now, &mut |_, _, _| {});
        let discount = grapher.backup.discount;
        now.iter_mut().flatten().for_each(|mass| *mass *= discount);
        for (sum, more) in met.iter_mut().flatten().zip(now.iter().flatten()) {
            *sum += more;
        }
        if now.iter().flatten().sum::<f64>() < LEFT {
            break;
        }
    }
    met
}

/// The shares of an episode of at most `length` steps.
pub(super) fn shares(grapher: &Grapher<'_>, graph: &Graph, length: usize) -> Shares {
    let mut now = start(grapher, graph);
    let mut visits = vec![0.0; graph.nodes.len()];
    let ways = graph.nodes.iter().map(|node| vec![0.0; node.next.len()]);
    let mut gone: Vec<Vec<f64>> = ways.collect();
    for _ in 0..length {
        for (sum, masses) in visits.iter_mut().zip(&now) {
            *sum += masses.iter().sum::<f64>();
        }
        now = step(grapher, graph, &now, &mut |node, signal, mass| {
            gone[node][signal] += mass;
        });
        if now.iter().flatten().sum::<f64>() < LEFT {
            break;
        }
    }
    let steps: f64 = visits.iter().sum();
    // Rounding may lead a hair beyond what a share can be.
    let share = |mass: &mut f64| *mass = (*mass / steps).clamp(0.0, 1.0);
    visits.iter_mut().for_each(share);
    gone.iter_mut().flatten().for_each(share);
    Shares { visits, gone }
}

/// Ways that are never gone lead where the way of their node leads that is gone most, so that no node is kept for them, and who is told
/// something that could not be goes on as usual.
pub(super) fn settled(grapher: &Grapher<'_>, graph: Graph, length: usize) -> Graph {
    let gone = shares(grapher, &graph, length).gone;
    let mut nodes = graph.nodes;
    for (node, gone) in nodes.iter_mut().zip(&gone) {
        let most = (0..gone.len()).max_by(|a, b| gone[*a].total_cmp(&gone[*b]));
        let Some(usual) = most.map(|signal| node.next[signal]) else {
            continue;
        };
        for (next, _) in node
            .next
            .iter_mut()
            .zip(gone)
            .filter(|(_, gone)| **gone <= NEVER)
        {
            *next = usual;
        }
    }
    let (nodes, values) = reached(&nodes, &graph.values, 0);
    merged(grapher.valued(nodes, values))
}

/// Everything is at the first node.
fn start(grapher: &Grapher<'_>, graph: &Graph) -> Vec<Vec<f64>> {
    let keeping = &*grapher.backup.keeping;
    let mut now = vec![vec![0.0; keeping.states()]; graph.nodes.len()];
    now[0] = keeping.start().probabilities().to_vec();
    now
}

/// Where masses by node, mode and cell are after a step, as far as the episode goes on; `way` hears how much goes each way.
fn step(
    grapher: &Grapher<'_>,
    graph: &Graph,
    now: &[Vec<f64>],
    way: &mut dyn FnMut(usize, usize, f64),
) -> Vec<Vec<f64>> {
    let keeping = &*grapher.backup.keeping;
    let states = keeping.states();
    let mut next = vec![vec![0.0; states]; graph.nodes.len()];
    let mut moved = vec![0.0; states];
    let mut restarted = 0.0;
    for (number, (node, masses)) in graph.nodes.iter().zip(now).enumerate() {
        if masses.iter().all(|mass| *mass == 0.0) {
            continue;
        }
        moved.fill(0.0);
        keeping.forward(node.action, masses, &mut moved);
        let again = keeping.restarts(node.action).iter().zip(masses);
        restarted += again.map(|(share, mass)| share * mass).sum::<f64>();
        for (signal, target) in node.next.iter().enumerate() {
            let likely = grapher.likely[node.action].row(signal);
            let arriving = moved.iter().zip(likely.iter());
            let mut sum = 0.0;
            for (to, (mass, likely)) in next[*target].iter_mut().zip(arriving) {
                *to += mass * likely;
                sum += mass * likely;
            }
            way(number, signal, sum);
        }
    }
    let start = keeping.start();
    for (to, mass) in next[0].iter_mut().zip(start.probabilities()) {
        *to += restarted * mass;
    }
    next
}
