//! An automaton laid out flat, to be run: a step allocates nothing.

use crate::belief::{Belief, Filter};
use crate::model::ActionId;
use crate::policy::{Automaton, Coordinates, MOST_COORDINATES, Matching, NodeId, Place, Policy};

/// Runs an automaton: keeps its belief, matches its nodes.
#[derive(Debug, Clone)]
pub struct Controller {
    filter: Filter,
    matching: Matching,
    coordinates: Option<Coordinates>,
    levels: usize,
    /// By mode and level: where its candidates start and end.
    ranges: Vec<(usize, usize)>,
    /// Corners of the candidates, `2 n` numbers each (a point is a box with equal corners).
    corners: Vec<f64>,
    volumes: Vec<f64>,
    /// Node and action of each candidate.
    nodes: Vec<(NodeId, ActionId)>,
    /// Inverse squares of the scale.
    weights: Vec<f64>,
    belief: Belief,
    scratch: Vec<f64>,
}

impl Controller {
    /// Lays out an automaton. One without nodes does action 0 everywhere.
    pub fn new(automaton: &Automaton) -> Self {
        let filter = automaton.filter.clone();
        let levels = automaton.levels.len();
        let mut controller = Self {
            matching: automaton.matching,
            coordinates: automaton.coordinates.clone(),
            levels,
            ranges: Vec::new(),
            corners: Vec::new(),
            volumes: Vec::new(),
            nodes: Vec::new(),
            weights: automaton
                .scale
                .iter()
                .map(|scale| 1.0 / (scale * scale))
                .collect(),
            belief: filter.initial(),
            scratch: vec![0.0; filter.states()],
            filter,
        };
        for mode in 0..automaton.modes.len() {
            for level in 0..levels {
                let from = controller.nodes.len();
                for id in automaton.candidates(level, mode) {
                    controller.add(automaton, id);
                }
                controller.ranges.push((from, controller.nodes.len()));
            }
        }
        controller
    }

    fn add(&mut self, automaton: &Automaton, id: NodeId) {
        let node = &automaton.nodes[id];
        let (lower, upper) = match &node.place {
            Place::Point(point) => (point, point),
            Place::Segment { lower, upper, .. } => (lower, upper),
        };
        self.corners.extend(lower);
        self.corners.extend(upper);
        self.volumes.push(node.place.volume());
        self.nodes.push((id, node.action));
    }

    /// The belief.
    pub fn belief(&self) -> &Belief {
        &self.belief
    }

    /// Back to the start belief.
    pub fn reset(&mut self) {
        self.filter.reset(&mut self.belief);
    }

    /// Node and action at the current belief.
    pub fn decide(&self) -> (NodeId, ActionId) {
        self.decide_at(&self.belief)
    }

    /// Takes in what was sensed (length `m`) after an action.
    pub fn observe(&mut self, action: ActionId, observation: &[f64]) {
        self.filter
            .update(&mut self.belief, action, observation, &mut self.scratch);
    }

    fn decide_at(&self, belief: &Belief) -> (NodeId, ActionId) {
        let (from, to) = self
            .ranges
            .get(belief.mode * self.levels + belief.level)
            .copied()
            .unwrap_or((0, 0));
        if from == to {
            return (0, 0);
        }
        let best = match &self.coordinates {
            None => self.match_place(from, to, &belief.mean),
            Some(coordinates) => {
                let mut place = [0.0; MOST_COORDINATES];
                coordinates.write(&belief.mean, &mut place);
                self.match_place(from, to, &place[..coordinates.count()])
            }
        };
        self.nodes[best]
    }

    fn match_place(&self, from: usize, to: usize, place: &[f64]) -> usize {
        match self.matching {
            Matching::Nearest => self.nearest(from, to, place),
            Matching::Segments => self.segment(from, to, place),
        }
    }

    fn nearest(&self, from: usize, to: usize, mean: &[f64]) -> usize {
        let n = mean.len();
        let mut best = (from, f64::INFINITY);
        for (k, corners) in self.corners[2 * n * from..2 * n * to]
            .chunks_exact(2 * n)
            .enumerate()
        {
            let distance = corners[..n]
                .iter()
                .zip(mean)
                .zip(&self.weights)
                .map(|((x, m), w)| w * (m - x) * (m - x))
                .sum();
            if distance < best.1 {
                best = (from + k, distance);
            }
        }
        best.0
    }

    fn segment(&self, from: usize, to: usize, mean: &[f64]) -> usize {
        let n = mean.len();
        let mut best = (from, f64::INFINITY, f64::INFINITY);
        for (k, corners) in self.corners[2 * n * from..2 * n * to]
            .chunks_exact(2 * n)
            .enumerate()
        {
            let mut distance = 0.0;
            for i in 0..n {
                let apart = (corners[i] - mean[i])
                    .max(mean[i] - corners[n + i])
                    .max(0.0);
                distance += self.weights[i] * apart * apart;
            }
            let volume = self.volumes[from + k];
            if distance < best.1 || (distance == best.1 && volume < best.2) {
                best = (from + k, distance, volume);
            }
        }
        best.0
    }
}

impl Policy for Controller {
    fn action(&self, belief: &Belief) -> ActionId {
        self.decide_at(belief).1
    }
}
