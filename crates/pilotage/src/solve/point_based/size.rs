//! A graph of the size that it may have, as good as can be found.

use super::graph::{Graph, Grapher};
use super::shrink::{shrunk, squeezed};
use super::tune::tuned;
use crate::progress::Progress;
use crate::solve::Size;

/// Shares of the nodes that are left at a time where a graph is made smaller at any cost: each way ends elsewhere, and the best counts.
const LEAVES: [f64; 4] = [0.6, 0.8, 0.9, 0.95];

/// Times that a graph is made smaller and better in turns, at most.
const TURNS: usize = 5;

/// A graph with fewer nodes as long as that costs no more than it may lose, and with no more than it may have, whatever that costs.
pub(super) fn sized(
    grapher: &Grapher<'_>,
    whole: Graph,
    size: Size,
    observer: &dyn Progress,
) -> Graph {
    let told = |graph: &Graph| {
        let nodes = graph.nodes.len();
        observer.status(&format!("{nodes} nodes, value {:.4}", graph.value));
    };
    told(&whole);
    let floor = whole.value - size.loss() * whole.value.abs();
    let mut graph = shrunk(grapher, whole, floor);
    for _ in 0..TURNS {
        told(&graph);
        let smaller = shrunk(grapher, tuned(grapher, graph.clone()), floor);
        let done = smaller.nodes.len() == graph.nodes.len();
        graph = smaller;
        if done {
            break;
        }
    }
    match size.nodes {
        Some(most) if most < graph.nodes.len() => {
            let ends = LEAVES.map(|leaves| {
                let end = down_to(grapher, graph.clone(), most, leaves);
                told(&end);
                end
            });
            let better = |best: Graph, next: Graph| match next.value > best.value {
                true => next,
                false => best,
            };
            ends.into_iter().reduce(better).unwrap_or(graph)
        }
        _ => graph,
    }
}

/// Smaller and better in turns, until there are no more than so many nodes.
fn down_to(grapher: &Grapher<'_>, mut graph: Graph, most: usize, leaves: f64) -> Graph {
    while graph.nodes.len() > most {
        graph = tuned(grapher, squeezed(grapher, &graph, most, leaves));
    }
    graph
}
