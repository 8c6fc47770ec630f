//! Automata: the thesis' rules for learning them, running them, keeping them in files.
#![allow(clippy::unwrap_used)]

mod common;

use common::built_in;
use pilotage::Error;
use pilotage::belief::{Belief, BeliefMdp};
use pilotage::model::{ActionId, Model};
use pilotage::policy::{
    Automaton, Controller, Matching, Node, Observed, Place, Policy, write_whole,
};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::rollout;
use proptest::prelude::*;

const PROBLEMS: [&str; 5] = ["corridor", "tiger", "load-unload", "maze-2d", "cart-pole"];

fn empty(name: &str, matching: Matching) -> Automaton {
    Automaton::new(&BeliefMdp::new(&built_in(name)), "test", matching)
}

/// Numbers as they occur, and such as only just exist.
fn number() -> impl Strategy<Value = f64> + Clone {
    prop_oneof![
        8 => -5.0..5.0_f64,
        1 => proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL | proptest::num::f64::ZERO,
    ]
}

type Parts = (usize, usize, usize, usize, Vec<f64>, Vec<f64>, Option<f64>);

fn node(automaton: &Automaton, parts: &Parts) -> Node {
    let (first, last, mode, action, point, width, value) = parts;
    let n = automaton.states.len();
    let levels = automaton.levels.len();
    let (first, last) = (first % levels, last % levels);
    let lower = point[..n].to_vec();
    let upper: Vec<f64> = lower.iter().zip(width).map(|(x, w)| x + w).collect();
    let place = match automaton.matching {
        Matching::Nearest => Place::Point(lower),
        Matching::Segments => Place::Segment {
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
        node.visits = 1.0 / 3.0;
        node.predecessors = vec![(0, *value)];
        node.observed = Some(Observed {
            mean: point.clone(),
            covariance: width.clone(),
        });
    }
    node
}

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

fn any_automaton(
    coordinate: impl Strategy<Value = f64> + Clone,
    nodes: std::ops::Range<usize>,
) -> impl Strategy<Value = Automaton> {
    let matching = prop_oneof![Just(Matching::Nearest), Just(Matching::Segments)];
    let name = proptest::sample::select(PROBLEMS.to_vec());
    let nodes = proptest::collection::vec(parts(coordinate), nodes);
    let scale = proptest::collection::vec(0.1..10.0_f64, 4);
    (name, matching, nodes, scale).prop_map(|(name, matching, nodes, scale)| {
        let mut automaton = empty(name, matching);
        automaton.scale = scale[..automaton.states.len()].to_vec();
        automaton.nodes = nodes.iter().map(|parts| node(&automaton, parts)).collect();
        automaton
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn saving_and_loading_changes_nothing(automaton in any_automaton(number(), 0..12)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("policy.json");
        automaton.save(&path).unwrap();
        let loaded = Automaton::load(&path).unwrap();
        prop_assert_eq!(&loaded, &automaton);
        prop_assert_eq!(loaded.to_json().unwrap(), automaton.to_json().unwrap());
    }

    /// Also where levels and modes have no node of their own, and for means on a grid, where distances are equal.
    #[test]
    fn a_controller_decides_as_its_automaton(
        automaton in any_automaton(-5.0..5.0_f64, 1..30),
        beliefs in proptest::collection::vec(
            (0..100_usize, 0..4_usize, proptest::collection::vec(-8.0..8.0_f64, 4)), 20),
    ) {
        let controller = Controller::new(&automaton);
        for (level, mode, mean) in beliefs {
            let belief = Belief {
                level: level % automaton.levels.len(),
                mode: mode % automaton.modes.len(),
                mean: mean[..automaton.states.len()].to_vec(),
            };
            prop_assert_eq!(controller.action(&belief), automaton.action(&belief));
        }
    }

    /// The same on whole numbers, so that many nodes are equally near: the first of them counts for both.
    #[test]
    fn a_controller_breaks_ties_as_its_automaton(
        mut automaton in any_automaton((-2..=2_i32).prop_map(f64::from), 1..30),
        means in proptest::collection::vec(proptest::collection::vec(-3..=3_i32, 4), 20),
    ) {
        automaton.scale.fill(1.0);
        let controller = Controller::new(&automaton);
        for mean in means {
            let mean = mean[..automaton.states.len()].iter().copied().map(f64::from).collect();
            let belief = Belief { level: 0, mode: 0, mean };
            prop_assert_eq!(controller.action(&belief), automaton.action(&belief));
        }
    }

    /// A file that was tampered with is refused, or holds an automaton that runs.
    #[test]
    fn no_edit_of_a_file_makes_it_panic(
        automaton in any_automaton(-5.0..5.0_f64, 1..4),
        place in any::<proptest::sample::Index>(),
        length in 0..12_usize,
        piece in proptest::sample::select(vec![
            "", "0", "1", "-1", "9", "1e308", "1e999", "18446744073709551615", "null", "[]", "{}", "\"inf\"", ",", "]", "true",
        ]),
    ) {
        let text = automaton.to_json().unwrap();
        let from = place.index(text.len());
        let edited = format!("{}{piece}{}", &text[..from], &text[(from + length).min(text.len())..]);
        match Automaton::from_json(&edited, "edited.json") {
            Ok(automaton) => {
                let mut controller = Controller::new(&automaton);
                let observation = vec![0.5; automaton.filter.readings()];
                for _ in 0..3 {
                    let (_, action) = controller.decide();
                    controller.observe(action, &observation);
                    prop_assert_eq!(controller.action(controller.belief()), automaton.action(controller.belief()));
                }
            }
            Err(error) => prop_assert!(error.to_string().starts_with("edited.json: ")),
        }
    }
}

fn one_node() -> Automaton {
    let mut automaton = empty("corridor", Matching::Segments);
    let place = Place::Segment {
        lower: vec![-1.0],
        minimum: vec![0.0],
        upper: vec![1.0],
    };
    automaton.nodes = vec![Node::new(0..=2, 0, place, 1, Some(0.5))];
    automaton
}

/// Applies a change to the JSON of a good file and returns what reading it says.
fn refusal(change: impl FnOnce(&mut serde_json::Value)) -> String {
    let mut json: serde_json::Value = serde_json::from_str(&one_node().to_json().unwrap()).unwrap();
    change(&mut json);
    match Automaton::from_json(&json.to_string(), "policy.json") {
        Err(Error::Policy { origin, reason }) => {
            assert_eq!(origin, "policy.json");
            reason
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_file_of_another_version_is_refused() {
    let reason = refusal(|json| json["format"] = 2.into());
    assert!(
        reason.contains("format 2") && reason.contains("reads format 1"),
        "{reason}"
    );
    let reason = refusal(|json| {
        json["format"] = 99.into();
        json["pilotage"] = "7.1.0".into();
        json["automaton"] = "unlike anything known".into();
    });
    assert!(reason.contains("written by pilotage 7.1.0"), "{reason}");
}

#[test]
fn what_is_no_policy_file_is_refused() {
    for text in [
        "",
        "not json",
        "{}",
        "[1, 2]",
        "{\"format\": \"one\"}",
        "\u{0}",
    ] {
        let error = Automaton::from_json(text, "notes.txt")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("notes.txt") && error.contains("not a policy file"),
            "{error}"
        );
    }
    let whole = one_node().to_json().unwrap();
    for part in [whole.len() / 4, whole.len() / 2, whole.len() - 3] {
        assert!(Automaton::from_json(&whole[..part], "cut.json").is_err());
    }
}

#[test]
fn damaged_files_are_refused() {
    let node = |json: &mut serde_json::Value, key: &str, value: serde_json::Value| {
        json["automaton"]["nodes"][0][key] = value;
    };
    let segment = |lower: f64, minimum: f64, upper: f64| serde_json::json!({"segment": {"lower": [lower], "minimum": [minimum], "upper": [upper]}});
    for (what, reason) in [
        ("action", refusal(|json| node(json, "action", 3.into()))),
        ("mode", refusal(|json| node(json, "mode", 1.into()))),
        (
            "level",
            refusal(|json| node(json, "levels", vec![0, 99].into())),
        ),
        (
            "level",
            refusal(|json| node(json, "levels", vec![2, 1].into())),
        ),
        (
            "coordinates",
            refusal(|json| node(json, "place", serde_json::json!({"point": [0.0, 1.0]}))),
        ),
        (
            "segment",
            refusal(|json| node(json, "place", segment(1.0, 0.0, -1.0))),
        ),
        (
            "predecessor",
            refusal(|json| node(json, "predecessors", serde_json::json!([[1, 0.5]]))),
        ),
        (
            "damaged",
            refusal(|json| node(json, "place", serde_json::json!({"circle": [0.0]}))),
        ),
        (
            "scale",
            refusal(|json| json["automaton"]["scale"] = serde_json::json!([1.0, 1.0])),
        ),
        (
            "scale",
            refusal(|json| json["automaton"]["scale"] = serde_json::json!([0.0])),
        ),
        (
            "level",
            refusal(|json| json["automaton"]["levels"][0] = serde_json::json!([0.3, 0.0])),
        ),
        (
            "filter",
            refusal(|json| {
                json["automaton"]["levels"].as_array_mut().unwrap().pop();
            }),
        ),
        (
            "filter",
            refusal(|json| json["automaton"]["filter"]["states"] = 2.into()),
        ),
        (
            "filter",
            refusal(|json| json["automaton"]["filter"]["readings"] = u64::MAX.into()),
        ),
        (
            "filter",
            refusal(|json| json["automaton"]["filter"]["next"][0] = 99.into()),
        ),
        (
            "filter",
            refusal(|json| {
                json["automaton"]["filter"]["gains"]
                    .as_array_mut()
                    .unwrap()
                    .pop();
            }),
        ),
        (
            "filter",
            refusal(|json| json["automaton"]["filter"]["start"][0] = 99.into()),
        ),
        (
            "missing field",
            refusal(|json| {
                json["automaton"].as_object_mut().unwrap().remove("filter");
            }),
        ),
    ] {
        assert!(reason.contains(what), "{what}: {reason}");
        assert!(reason.contains("solve again"), "{what}: {reason}");
    }
}

#[test]
fn a_policy_of_another_problem_is_refused() {
    let automaton = one_node();
    let corridor = built_in("corridor");
    assert!(automaton.check_problem(&corridor, "policy.json").is_ok());
    let refused = |model: &Model| {
        automaton
            .check_problem(model, "policy.json")
            .unwrap_err()
            .to_string()
    };
    let foreign = refused(&built_in("tiger"));
    assert!(
        foreign.contains("policy.json") && foreign.contains("for corridor, not for tiger"),
        "{foreign}"
    );
    let mut changed = corridor.clone();
    changed.sensor.noise[0] += 1e-12;
    assert!(refused(&changed).contains("has changed"));
    // Words do not count.
    let mut retold = corridor;
    retold.about = "A corridor.".to_owned();
    assert!(automaton.check_problem(&retold, "policy.json").is_ok());
}

#[test]
fn files_are_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let listing = || std::fs::read_dir(folder.path()).unwrap().count();

    let path = folder.path().join("policy.json");
    std::fs::write(&path, "old").unwrap();
    write_whole(&path, b"new").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"new");
    assert_eq!(listing(), 1);

    let lost = folder.path().join("missing").join("policy.json");
    let error = one_node().save(&lost).unwrap_err();
    assert!(matches!(&error, Error::Io { path, .. } if *path == lost));
    assert!(error.to_string().contains("missing"), "{error}");
    assert_eq!(listing(), 1);

    // A folder cannot be replaced by a file: the move fails after everything was written, and nothing is left behind.
    let taken = folder.path().join("folder");
    std::fs::create_dir(&taken).unwrap();
    assert!(write_whole(&taken, b"new").is_err());
    assert!(taken.is_dir());
    assert_eq!(listing(), 2);

    assert!(Automaton::load(&folder.path().join("nowhere.json")).is_err());
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    assert!(matches!(
        Automaton::load(&path).unwrap_err(),
        Error::Io { .. }
    ));
}

/// A place where even the administrator cannot write.
#[cfg(target_os = "linux")]
#[test]
fn a_read_only_target_is_an_error() {
    let error = one_node()
        .save(std::path::Path::new("/proc/policy.json"))
        .unwrap_err();
    assert!(error.to_string().contains("/proc/policy.json"), "{error}");
}

/// What a policy does on a line: one action between each two borders, the same at every level.
#[derive(Debug)]
struct Pieces {
    borders: Vec<f64>,
    actions: Vec<ActionId>,
}

impl Policy for Pieces {
    fn action(&self, belief: &Belief) -> ActionId {
        let passed = self
            .borders
            .iter()
            .filter(|border| **border <= belief.mean[0]);
        self.actions[passed.count()]
    }
}

/// Borders at least 0.05 apart, and actions that change at each of them.
fn pieces() -> impl Strategy<Value = Pieces> {
    let widths = proptest::collection::vec(0.05..1.5_f64, 0..6);
    let turns = proptest::collection::vec(1..3_usize, 6);
    (-2.0..2.0_f64, widths, turns).prop_map(|(first, widths, turns)| {
        let mut borders = Vec::new();
        let mut actions = vec![0];
        let mut at = first;
        for (width, turn) in widths.iter().zip(turns) {
            borders.push(at);
            actions.push((actions[actions.len() - 1] + turn) % 3);
            at += width;
        }
        Pieces { borders, actions }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Among the means that were met, a compiled automaton does exactly what the policy does, right up to its borders.
    #[test]
    fn compiling_on_a_line_keeps_every_border(pieces in pieces()) {
        let model = built_in("corridor-unbounded");
        let mdp = BeliefMdp::new(&model);
        for matching in [Matching::Nearest, Matching::Segments] {
            let settings = compile::Settings { matching, episodes: 20, ..compile::Settings::default() };
            let automaton = compile(&pieces, &mdp, "test", &settings).unwrap();
            let met = rollout::decisions(
                &mdp, &mdp.filter(), &pieces, settings.episodes, model.episode.length, settings.seed);
            let means = || met.iter().flatten().map(|decision| decision.belief.mean[0]);
            let (low, high) = (means().fold(f64::INFINITY, f64::min), means().fold(f64::NEG_INFINITY, f64::max));
            let inside: Vec<f64> = pieces.borders.iter().copied().filter(|x| low < *x && *x < high).collect();
            let near = inside.iter().flat_map(|border| [border - 1e-9, border + 1e-9]);
            let spread = (0..=500).map(|k| low + (high - low) * f64::from(k) / 500.0);
            for mean in near.chain(spread).chain(means()).filter(|x| (low..=high).contains(x)) {
                if pieces.borders.iter().any(|border| (border - mean).abs() < 0.5e-9) {
                    continue;
                }
                for level in [0, 1, mdp.levels().len() - 1] {
                    let belief = Belief { level, mode: 0, mean: vec![mean] };
                    prop_assert_eq!(
                        automaton.action(&belief), pieces.action(&belief),
                        "{:?} at {}, borders {:?}", matching, mean, inside);
                }
            }
            // A segment for every interval; a point for every interval, or two for every border. Borders beside the way count too.
            let borders = pieces.borders.len();
            let most = match matching {
                Matching::Segments => borders + 1,
                Matching::Nearest => (borders + 1).max(2 * borders),
            };
            prop_assert!(automaton.nodes.len() <= most);
        }
    }
}
