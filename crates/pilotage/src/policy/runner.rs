//! An automaton laid out flat, to be run: a step allocates nothing.

use crate::belief::{Belief, Held, Reading, Updater};
use crate::model::ActionId;
use crate::policy::{
    Automaton, Coordinates, MOST_COORDINATES, Matching, NodeId, Place, Policy, StratumFeatures,
    Tree,
};

/// Nodes compared at a time, side by side in memory so that one instruction serves several.
const LANES: usize = 8;

/// Runs an automaton: keeps its belief, matches its nodes.
#[derive(Debug, Clone)]
pub struct AutomatonRunner {
    updater: Updater,
    matching: Matching,
    /// The tree, with what it may ask of each stratum.
    tree: Option<(Tree, Vec<StratumFeatures>)>,
    coordinates: Option<Coordinates>,
    levels: usize,
    /// By mode and level: the blocks of candidates from the first up to, not including, the last.
    ranges: Vec<(usize, usize)>,
    /// Corners of the candidates in units of the scale: of a block of [`LANES`] candidates a row per variable for points, two for
    /// segments (lower, upper). Rows are filled up with points at infinity.
    rows: Vec<[f64; LANES]>,
    /// Node and action of each candidate; in a block the smaller ones come first, so that they win ties.
    nodes: Vec<(NodeId, ActionId)>,
    /// Inverse of the scale.
    inverse: Vec<f64>,
    held: Held,
}

impl AutomatonRunner {
    /// Lays out an automaton. One without nodes does action 0 everywhere.
    pub fn new(automaton: &Automaton) -> Self {
        let updater = automaton.updater.clone();
        let levels = automaton.levels.len();
        let mut controller = Self {
            matching: automaton.matching,
            tree: automaton.tree.as_ref().map(|tree| {
                let features = |stratum| StratumFeatures::of(automaton, stratum);
                (tree.clone(), (0..levels).map(features).collect())
            }),
            coordinates: automaton.coordinates.clone(),
            levels,
            ranges: Vec::new(),
            rows: Vec::new(),
            nodes: Vec::new(),
            inverse: automaton.scale.iter().map(|scale| 1.0 / scale).collect(),
            held: updater.start(),
            updater,
        };
        if controller.tree.is_some() {
            let nodes = automaton.nodes.iter().enumerate();
            controller.nodes = nodes.map(|(id, node)| (id, node.action)).collect();
            return controller;
        }
        for mode in 0..automaton.modes.len() {
            let own = automaton.of_mode(mode);
            for level in 0..levels {
                let from = controller.nodes.len() / LANES;
                let volume = |id: NodeId| automaton.nodes[id].place.volume();
                let mut candidates: Vec<NodeId> = automaton.nearest_to_level(level, &own).collect();
                candidates.sort_by(|&a, &b| volume(a).total_cmp(&volume(b)));
                for block in candidates.chunks(LANES) {
                    controller.add(automaton, block);
                }
                let to = controller.nodes.len() / LANES;
                controller.ranges.push((from, to));
            }
        }
        controller
    }

    fn add(&mut self, automaton: &Automaton, block: &[NodeId]) {
        let nodes = || block.iter().map(|&id| (id, &automaton.nodes[id]));
        let mut row = |corner: &dyn Fn(&Place) -> f64| {
            let mut row = [f64::INFINITY; LANES];
            for (lane, (_, node)) in row.iter_mut().zip(nodes()) {
                *lane = corner(&node.place);
            }
            self.rows.push(row);
        };
        for (i, inverse) in self.inverse.iter().enumerate() {
            let (lower, upper) = (Place::lower, Place::upper);
            row(&|place| lower(place)[i] * inverse);
            if self.matching == Matching::Segments {
                row(&|place| upper(place)[i] * inverse);
            }
        }
        let padding = std::iter::repeat_n((0, 0), LANES - block.len());
        self.nodes
            .extend(nodes().map(|(id, node)| (id, node.action)).chain(padding));
    }

    /// The belief.
    pub fn belief(&self) -> &Belief {
        self.held.belief()
    }

    /// Back to the start belief.
    pub fn reset(&mut self) {
        self.updater.reset(&mut self.held);
    }

    /// Node and action at the current belief.
    pub fn decide(&self) -> (NodeId, ActionId) {
        self.decide_in_full(&self.held)
    }

    /// Takes in what was sensed after an action.
    pub fn observe<'a>(&mut self, action: ActionId, reading: impl Into<Reading<'a>>) {
        self.updater.update(&mut self.held, action, reading.into());
    }

    fn decide_in_full(&self, held: &Held) -> (NodeId, ActionId) {
        match (&self.tree, held.moments()) {
            (Some((tree, _)), Some(moments)) => self.node(tree.find(moments)),
            _ => self.decide_at(held.belief()),
        }
    }

    fn node(&self, id: NodeId) -> (NodeId, ActionId) {
        self.nodes.get(id).copied().unwrap_or((0, 0))
    }

    fn decide_at(&self, belief: &Belief) -> (NodeId, ActionId) {
        if let Some((tree, features)) = &self.tree {
            return self.node(tree.find(&(&features[belief.stratum], belief)));
        }
        let (from, to) = self
            .ranges
            .get(belief.mode * self.levels + belief.stratum)
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
            Matching::Nearest | Matching::Tree => {
                self.closest::<1>(from, to, place, |[point], at| point - at)
            }
            Matching::Segments => self.closest::<2>(from, to, place, |[lower, upper], at| {
                // `f64::max` would also look after NaN, of which there is none.
                let (below, above) = (lower - at, at - upper);
                let outside = if below > above { below } else { above };
                if outside > 0.0 { outside } else { 0.0 }
            }),
        }
    }

    /// The first of the candidates in blocks `from..to` that are closest to a place. `apart` gives the distance along one variable
    /// from that variable's `ROWS` rows.
    fn closest<const ROWS: usize>(
        &self,
        from: usize,
        to: usize,
        place: &[f64],
        apart: impl Fn([f64; ROWS], f64) -> f64,
    ) -> usize {
        let height = ROWS * place.len();
        let blocks = self.rows[from * height..to * height].chunks_exact(height);
        let mut closest = (f64::INFINITY, from * LANES);
        for (block, rows) in blocks.enumerate() {
            let mut distance = [0.0; LANES];
            for ((rows, m), inverse) in rows.chunks_exact(ROWS).zip(place).zip(&self.inverse) {
                let at = m * inverse;
                for (lane, distance) in distance.iter_mut().enumerate() {
                    let apart = apart(std::array::from_fn(|row| rows[row][lane]), at);
                    *distance += apart * apart;
                }
            }
            // Few blocks hold a closer one, so which it is can be asked afterwards.
            let least = least(distance);
            if least < closest.0 {
                let lane = distance.iter().position(|&distance| distance == least);
                closest = (least, (from + block) * LANES + lane.unwrap_or(0));
            }
        }
        closest.1
    }
}

/// The least of the lanes, found by halves.
fn least(mut lanes: [f64; LANES]) -> f64 {
    let mut half = LANES / 2;
    while half > 0 {
        for lane in 0..half {
            let (a, b) = (lanes[lane], lanes[lane + half]);
            lanes[lane] = if a < b { a } else { b };
        }
        half /= 2;
    }
    lanes[0]
}

impl Policy for AutomatonRunner {
    fn action(&self, belief: &Belief) -> ActionId {
        self.decide_at(belief).1
    }

    fn action_in_full(&self, held: &Held) -> ActionId {
        self.decide_in_full(held).1
    }
}
