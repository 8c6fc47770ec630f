//! Which parts of an automaton are not left again.

use super::Automaton;

/// Ways out of a node that fewer of its departures take do not count.
const RARELY: f64 = 0.01;

impl Automaton {
    /// Parts of the automaton that are rarely left again: strongly connected components without a way out, by the predecessors
    /// written into its nodes; ways out that a node takes less than once in a hundred times do not count.
    pub fn closed_components(&self) -> usize {
        let n = self.nodes.len();
        let mut reaches: Vec<Vec<bool>> = (0..n)
            .map(|from| (0..n).map(|to| from == to).collect())
            .collect();
        let mut departures = vec![0.0; n];
        for &(from, count) in self.nodes.iter().flat_map(|node| &node.predecessors) {
            departures[from] += count;
        }
        for (to, node) in self.nodes.iter().enumerate() {
            for &(from, count) in &node.predecessors {
                reaches[from][to] |= count >= RARELY * departures[from];
            }
        }
        for middle in 0..n {
            let onward = reaches[middle].clone();
            for row in reaches.iter_mut().filter(|row| row[middle]) {
                row.iter_mut().zip(&onward).for_each(|(to, on)| *to |= on);
            }
        }
        let closed = |node: usize| (0..n).all(|to| !reaches[node][to] || reaches[to][node]);
        let first =
            |node: usize| !(0..node).any(|other| reaches[node][other] && reaches[other][node]);
        (0..n)
            .filter(|&node| self.nodes[node].visits > 0.0 && closed(node) && first(node))
            .count()
    }
}
