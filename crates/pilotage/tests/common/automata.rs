//! Automata of every kind, made of arbitrary numbers, and their files.

use pilotage::belief::{BeliefMdp, Clusters, Recall};
use pilotage::model::Model;
use pilotage::policy::{
    Automaton, Coordinates, GraphNode, Matching, Node, Observed, Place, PolicyGraph,
};
use pilotage::scenario::{self, Scenario};
use proptest::prelude::*;
use serde_json::Value;

use super::built_in;

/// Problems with one to four variables, with and without modes, walls and a map.
const PROBLEMS: [&str; 9] = [
    "corridor-blind",
    "corridor",
    "tiger",
    "load-unload",
    "maze-2d",
    "u-maze",
    "shuttle-blind",
    "cart-pole",
    THIN_WALLS,
];

/// The problem that [`thin_walls`] is.
pub const THIN_WALLS: &str = "thin-walls";

/// A maze with thin walls and blocked cells, and a variable beside its map.
pub fn thin_walls() -> Scenario {
    let text = r#"
format = 1
name = "thin-walls"
discount = 0.9

[state]
names = ["x", "y", "height"]
bounds = [[0.0, 1.6], [0.0, 1.2], [-1.0, 1.0]]

[start]
mean = [0.2, 0.2, 0.0]
covariance = [[0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]

[motion]
A = [[1.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 0.9]]
noise = [[0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.05]]

[sensor]
noise = [[0.05, 0.0, 0.0], [0.0, 0.05, 0.0], [0.0, 0.0, 0.05]]

[actions]
NORTH = { u = [0.0, 0.3, 0.0] }
EAST = { u = [0.3, 0.0, 0.2] }
SOUTH = { u = [0.0, -0.3, 0.0] }
WEST = { u = [-0.3, 0.0, -0.2], sensor_noise = [[0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]] }

[[reward]]
in = "*"
value = 1.0

[belief]
walls = "clip"
level_tolerance = 5e-3

[map]
cell = 0.4
rows = '''
+--+--+--+--+
|  |     | *|
+  +  +--+  +
|     |##|  |
+--+  +  +  +
|  |     |  |
+--+--+--+--+
'''

[world]
walls = "clamp"
"#;
    scenario::read(text, "thin-walls.toml").unwrap_or_else(|error| panic!("{error}"))
}

/// A problem of [`PROBLEMS`].
fn problem(name: &str) -> Model {
    match name {
        THIN_WALLS => thin_walls().model,
        name => built_in(name),
    }
}

pub fn empty(name: &str, matching: Matching) -> Automaton {
    Automaton::new(&BeliefMdp::new(&problem(name)), "test", matching)
}

/// An automaton with one node, all of whose numbers are known.
pub fn one_node() -> Automaton {
    let mut automaton = empty("corridor-blind", Matching::Segments);
    let place = Place::Segment {
        lower: vec![-1.0],
        minimum: vec![0.0],
        upper: vec![1.0],
    };
    automaton.nodes = vec![Node::new(0..=2, 0, place, 1, Some(0.5))];
    automaton
}

/// Numbers as they occur, and such as only just exist.
pub fn number() -> impl Strategy<Value = f64> + Clone {
    let exists = proptest::num::f64::NORMAL
        | proptest::num::f64::SUBNORMAL
        | proptest::num::f64::ZERO
        | proptest::num::f64::NEGATIVE
        | proptest::num::f64::POSITIVE;
    let most = pilotage::belief::LARGEST;
    prop_oneof![
        8 => -5.0..5.0_f64,
        1 => exists.prop_map(move |x: f64| x.clamp(-most, most)),
    ]
}

type Parts = (usize, usize, usize, usize, Vec<f64>, Vec<f64>, Option<f64>);

fn parts(coordinate: impl Strategy<Value = f64> + Clone) -> impl Strategy<Value = Parts> {
    (
        0..100_usize,
        0..100_usize,
        0..4_usize,
        0..8_usize,
        proptest::collection::vec(coordinate.clone(), 4),
        proptest::collection::vec(0.0..2.0_f64, 4),
        proptest::option::of(coordinate),
    )
}

fn node(automaton: &Automaton, parts: &Parts) -> Node {
    let (first, last, mode, action, point, width, value) = parts;
    let n = automaton.place_names().len();
    let levels = automaton.levels.len();
    let (first, last) = (first % levels, last % levels);
    let lower = point[..n].to_vec();
    let upper: Vec<f64> = lower.iter().zip(width).map(|(x, w)| x + w).collect();
    let place = match automaton.matching {
        Matching::Nearest => Place::Point(lower),
        Matching::Segments | Matching::Tree => Place::Segment {
            minimum: lower.clone(),
            lower,
            upper,
        },
    };
    let mut node = Node::new(
        first.min(last)..=first.max(last),
        mode % automaton.modes.len(),
        place,
        action % automaton.actions.len(),
        *value,
    );
    if let Some(value) = value {
        let m = automaton.updater.readings();
        node.visits = 1.0 / 3.0;
        node.predecessors = vec![(0, value.abs())];
        node.observed = Some(Observed {
            mean: point.iter().cycle().take(m).copied().collect(),
            covariance: width.iter().cycle().take(m * m).copied().collect(),
        });
    }
    node
}

/// What its modes are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Memory {
    /// Those of the problem, with its switches.
    OfTheProblem,
    /// Two clusters.
    Recall,
}

/// A memory of two clusters with as many modes, which changes with every step.
fn recalling(automaton: &mut Automaton, model: &Model) {
    let centre = |share: f64| -> Vec<f64> {
        let bounds = model.state.iter().map(|variable| variable.bounds);
        bounds.map(|b| b.low + share * b.width()).collect()
    };
    let clusters = Clusters::new(model, vec![centre(0.2), centre(0.7)]);
    let actions = automaton.actions.len();
    let next = (0..2 * actions * 2).map(|i| (i / 3) % 2).collect();
    let recall = Recall::new(clusters, actions, vec![1, 0], next);
    automaton.modes = vec!["after 1".to_owned(), "after 2".to_owned()];
    let filter = automaton.updater.filter().expect("a Kalman filter");
    automaton.updater = filter.clone().recalling(recall).into();
}

/// Automata of any form, the coordinates of whose places are drawn from `coordinate`.
pub fn any_automaton(
    coordinate: impl Strategy<Value = f64> + Clone,
    nodes: std::ops::Range<usize>,
) -> impl Strategy<Value = Automaton> {
    let matching = prop_oneof![Just(Matching::Nearest), Just(Matching::Segments)];
    let memory = prop_oneof![3 => Just(Memory::OfTheProblem), 1 => Just(Memory::Recall)];
    let name = proptest::sample::select(PROBLEMS.to_vec());
    let nodes = proptest::collection::vec(parts(coordinate), nodes);
    let scale = proptest::collection::vec(0.1..10.0_f64, 4);
    let vectors = proptest::collection::vec(proptest::collection::vec(-2.0..2.0_f64, 4), 0..4);
    (name, matching, memory, nodes, scale, vectors).prop_map(
        |(name, matching, memory, nodes, scale, vectors)| {
            let model = problem(name);
            let mut automaton = empty(name, matching);
            let bounded = model.state.iter().all(|v| v.bounds.width().is_finite());
            if memory == Memory::Recall && bounded {
                recalling(&mut automaton, &model);
            }
            let n = automaton.states.len();
            if !vectors.is_empty() {
                automaton.coordinates = Some(Coordinates {
                    names: (0..vectors.len()).map(|i| format!("mode {i}")).collect(),
                    rows: vectors.iter().map(|vector| vector[..n].to_vec()).collect(),
                });
            }
            automaton.scale = scale[..automaton.place_names().len()].to_vec();
            automaton.nodes = nodes.iter().map(|parts| node(&automaton, parts)).collect();
            automaton
        },
    )
}

/// The checksum of a policy, made from the description in docs/policy-format.md alone.
pub fn checksum(policy: &str) -> String {
    let (mut quoted, mut escaped) = (false, false);
    let mut hash: u64 = 14_695_981_039_346_656_037;
    for byte in policy.bytes() {
        if !quoted && b" \t\r\n".contains(&byte) {
            continue;
        }
        quoted ^= byte == b'"' && !escaped;
        escaped = quoted && byte == b'\\' && !escaped;
        hash = (hash ^ u64::from(byte)).wrapping_mul(1_099_511_628_211);
    }
    format!("fnv1a64-{hash:016x}")
}

/// The text of a policy file whose policy was changed, with the checksum it should have.
pub fn sealed(mut file: Value) -> String {
    file["checksum"] = checksum(&file["policy"].to_string()).into();
    file.to_string()
}

/// Policy graphs of any size, whose ways lead anywhere.
pub fn any_graph() -> impl Strategy<Value = PolicyGraph> {
    let model = built_in("light-dark-binary");
    let ways = model.laws.symbols.len() + 1;
    let actions = model.actions.len();
    (1usize..12).prop_flat_map(move |nodes| {
        let next = proptest::collection::vec(0..nodes, ways);
        let next = prop_oneof![4 => next, 1 => Just(Vec::new())];
        let node = (0..actions, next, 0.0..=1.0).prop_map(|(action, next, visits)| GraphNode {
            gone: next.iter().map(|_| 0.25 * visits).collect(),
            action,
            next,
            visits,
        });
        let model = model.clone();
        proptest::collection::vec(node, nodes).prop_map(move |nodes| PolicyGraph {
            nodes,
            ..PolicyGraph::new(&model, "any")
        })
    })
}
