//! Policy files: what is written is read again, and what is not as it has to be is refused with its place.
#![allow(clippy::unwrap_used)]

mod common;

use common::automata::{any_automaton, checksum, empty, number, one_node, sealed};
use common::built_in;
use pilotage::Error;
use pilotage::belief::{Belief, LARGEST};
use pilotage::model::Model;
use pilotage::policy::{
    Automaton, AutomatonRunner, Branch, Coordinates, Feature, Matching, Node, Place, Term, Test,
    Tree,
};
use proptest::prelude::*;
use serde_json::{Value, json};

#[test]
fn a_policy_of_another_problem_is_refused() {
    let automaton = one_node();
    let corridor = built_in("corridor-blind");
    assert!(automaton.check_problem(&corridor, "policy.json").is_ok());
    let refused = |model: &Model| {
        automaton
            .check_problem(model, "policy.json")
            .unwrap_err()
            .to_string()
    };
    let foreign = refused(&built_in("tiger"));
    assert!(
        foreign.contains("policy.json") && foreign.contains("for corridor-blind, not for tiger"),
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

/// What reading a good file says after a change of its policy, whose checksum is made right again.
fn refusal_of(automaton: &Automaton, change: impl FnOnce(&mut Value)) -> String {
    let mut file: Value = serde_json::from_str(&automaton.to_json().unwrap()).unwrap();
    change(&mut file["policy"]);
    reason(&sealed(file))
}

fn reason(text: &str) -> String {
    match Automaton::from_json(text, "policy.json") {
        Err(Error::Policy { origin, reason }) => {
            assert_eq!(origin, "policy.json");
            reason
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn files_of_other_formats_are_refused() {
    let this = format!("pilotage {} and reads format 2", env!("CARGO_PKG_VERSION"));
    for (format, version, advice) in [
        (1, "0.1.0", "solve again to renew it"),
        (0, "0.0.1", "solve again to renew it"),
        (3, "7.1.0", "use that version, or solve again"),
    ] {
        let file = json!({"format": format, "pilotage": version, "automaton": {"problem": "corridor-blind"}});
        let reason = reason(&file.to_string());
        let written = format!("policy format {format} was written by pilotage {version}");
        for part in [written.as_str(), &this, advice] {
            assert!(reason.contains(part), "{reason}");
        }
    }
}

/// A policy as pilotage 0.1.0 wrote it.
#[test]
fn a_file_of_version_0_1_0_is_refused() {
    let reason = reason(include_str!("fixtures/policy-0.1.0.json"));
    assert!(
        reason.starts_with("policy format 1 was written by pilotage 0.1.0")
            && reason.contains("solve again"),
        "{reason}"
    );
}

#[test]
fn what_is_no_policy_file_is_refused() {
    for text in [
        "",
        "not json",
        "{}",
        "[1, 2]",
        "{\"format\": \"two\"}",
        "{\"format\": 2.0, \"pilotage\": \"0.2.0\"}",
        "{\"format\": -2, \"pilotage\": \"0.2.0\"}",
        "{\"format\": 2, \"format\": 2, \"pilotage\": \"0.2.0\"}",
        "\u{0}",
        "\u{feff}{}",
    ] {
        assert!(reason(text).contains("not a policy file"), "{text}");
    }
    let whole = one_node().to_json().unwrap();
    for part in [whole.len() / 4, whole.len() / 2, whole.len() - 3] {
        reason(&whole[..part]);
    }
    reason(&format!("{whole}{whole}"));
}

/// Neither nesting nor length takes the reader's time or memory.
#[test]
fn what_is_deep_or_long_is_refused_at_once() {
    let head = "{\"format\": 2, \"pilotage\": \"0.2.0\", \"checksum\": \"\", \"policy\": ";
    let million = 1_000_000;
    let texts = [
        "[".repeat(million),
        format!("{head}{}", "[".repeat(million)),
        format!("{head}{}{}}}", "[".repeat(million), "]".repeat(million)),
        format!("{head}{}", "{\"policy\":".repeat(million)),
        format!("{head}[{}0]}}", "0,".repeat(million)),
        format!(
            "{{\"format\": 2, {} \"pilotage\": \"\"}}",
            "\"policy\": 0,".repeat(million)
        ),
        format!("{head}0}}{}", " ".repeat(40 * million)),
    ];
    let clock = std::time::Instant::now();
    for text in &texts {
        reason(text);
    }
    // In optimised code they take a few tenths of a second.
    assert!(clock.elapsed().as_secs() < 20, "{:?}", clock.elapsed());
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.json");
    std::fs::write(&path, &texts[6]).unwrap();
    let error = Automaton::load(&path).unwrap_err().to_string();
    assert!(error.contains("32 MiB"), "{error}");
}

#[test]
fn what_is_too_long_to_be_read_again_is_not_written() {
    let mut automaton = one_node();
    automaton.nodes[0].predecessors = vec![(0, 0.012_345_678_901_234_567); 1_500_000];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("policy.json");
    std::fs::write(&path, "old").unwrap();
    let error = automaton.save(&path).unwrap_err().to_string();
    for part in ["32 MiB that are read again", "`level_tolerance`"] {
        assert!(error.contains(part), "{error}");
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
}

/// An automaton with everything that a file can have.
fn rich() -> Automaton {
    let mut automaton = empty("load-unload", Matching::Segments);
    automaton.coordinates = Some(Coordinates {
        names: vec!["half".to_owned()],
        rows: vec![vec![0.5; automaton.states.len()]],
    });
    let place = Place::Segment {
        lower: vec![-1.0],
        minimum: vec![0.0],
        upper: vec![1.0],
    };
    automaton.nodes = vec![Node::new(0..=0, 0, place, 1, Some(0.5))];
    automaton
}

/// A tree in the plane that asks for a sum.
fn grown() -> Automaton {
    let mut automaton = empty("maze-2d-unbounded", Matching::Tree);
    let leaf = |x: f64, action| {
        let place = Place::Segment {
            lower: vec![x, 0.0],
            minimum: vec![x, 0.0],
            upper: vec![x, 0.0],
        };
        Node::new(0..=0, 0, place, action, None)
    };
    automaton.nodes = vec![leaf(0.0, 0), leaf(1.0, 1), leaf(2.0, 2)];
    automaton.tree = Some(Tree {
        tests: vec![
            Test {
                feature: Feature::Mean(0),
                plus: vec![Term {
                    times: -2.0,
                    feature: Feature::Mean(1),
                }],
                less_than: 0.5,
                yes: Branch::Node(0),
                no: Branch::Test(1),
            },
            Test {
                feature: Feature::Deviation(1),
                plus: Vec::new(),
                less_than: 1e6,
                yes: Branch::Node(1),
                no: Branch::Node(2),
            },
        ],
    });
    automaton
}

#[test]
fn a_tree_that_asks_for_a_sum_is_read_again_shown_and_followed() {
    let text = grown().to_json().unwrap();
    let automaton = Automaton::from_json(&text, "policy.json").unwrap();
    assert_eq!(automaton.tree, grown().tree);
    let [x, y] = [0, 1].map(|i| automaton.states[i].clone());
    let first = format!("if {x} - 2*{y} < 0.5:");
    assert_eq!(automaton.conditions().lines().next(), Some(first.as_str()));
    let at = |x: f64, y: f64| {
        automaton.matched(&Belief {
            stratum: 0,
            mode: 0,
            mean: vec![x, y],
        })
    };
    // 2.4 - 2 = 0.4 is less, 2.6 - 2 = 0.6 is not.
    assert_eq!([at(2.4, 1.0), at(2.6, 1.0)], [Some(0), Some(1)]);
}

const DAMAGES_OF_A_TREE: &[Damage] = &[
    (
        |p| p["tree"][0]["plus"][0]["feature"] = json!({ "mean": 2 }),
        "tree[0].plus[0].feature",
        "there are 2 state variables",
    ),
    (
        |p| p["tree"][0]["plus"][0]["times"] = 1e200.into(),
        "tree[0].plus[0].times",
        "1e200",
    ),
    (
        |p| {
            let term = p["tree"][0]["plus"][0].clone();
            p["tree"][0]["plus"] = Value::Array(vec![term; 7]);
        },
        "tree[0].plus",
        "7 terms, of at most 6",
    ),
    (
        |p| p["tree"][0]["plus"][0]["of"] = 1.into(),
        "",
        "unknown field `of`",
    ),
    (
        |p| p["tree"][1]["feature"] = json!({ "mode": 3 }),
        "tree[1].feature",
        "there are 1 modes",
    ),
    (
        |p| p["tree"][1]["no"] = json!({ "test": 1 }),
        "tree[1].no",
        "which does not come later",
    ),
];

/// Changes of a good policy, each with the place and the word that the refusal has.
type Damage = (fn(&mut Value), &'static str, &'static str);

const DAMAGES_OF_ONE_NODE: &[Damage] = &[
    (
        |p| p["nodes"][0]["action"] = 3.into(),
        "nodes[0].action",
        "there are 3 actions",
    ),
    (
        |p| p["nodes"][0]["action"] = (-1).into(),
        "",
        "expected usize",
    ),
    (
        |p| p["nodes"][0]["action"] = 1.5.into(),
        "",
        "expected usize",
    ),
    (
        |p| p["nodes"][0]["mode"] = 1.into(),
        "nodes[0].mode",
        "there are 1 modes",
    ),
    (
        |p| p["nodes"][0]["levels"] = json!([0, 99]),
        "nodes[0].levels[1]",
        "levels",
    ),
    (
        |p| p["nodes"][0]["levels"] = json!([2, 1]),
        "nodes[0].levels",
        "after the last",
    ),
    (
        |p| p["nodes"][0]["levels"] = json!([0, 1, 2]),
        "",
        "damaged",
    ),
    (
        |p| p["nodes"][0]["place"] = json!({"point": [0.0]}),
        "nodes[0].place",
        "a point",
    ),
    (
        |p| p["nodes"][0]["place"] = json!({"circle": [0.0]}),
        "",
        "unknown variant",
    ),
    (
        |p| p["nodes"][0]["place"]["segment"]["lower"] = json!([]),
        "nodes[0].place.segment.lower",
        "0 items where 1",
    ),
    (
        |p| p["nodes"][0]["place"]["segment"]["minimum"] = json!([2.0]),
        "nodes[0].place.segment.minimum[0]",
        "not between -1 and 1",
    ),
    (
        |p| p["nodes"][0]["place"]["segment"]["upper"] = json!([1e61]),
        "nodes[0].place.segment.upper[0]",
        "1e61",
    ),
    (
        |p| p["nodes"][0]["value"] = 1e300.into(),
        "nodes[0].value",
        "larger than 1e60",
    ),
    (
        |p| p["nodes"][0]["visits"] = 1.5.into(),
        "nodes[0].visits",
        "share",
    ),
    (
        |p| p["nodes"][0]["predecessors"] = json!([[1, 0.5]]),
        "nodes[0].predecessors[0][0]",
        "there are 1 nodes",
    ),
    (
        |p| p["nodes"][0]["predecessors"] = json!([[0, -0.5]]),
        "nodes[0].predecessors[0][1]",
        "0 or more",
    ),
    (
        |p| p["nodes"][0]["observed"] = json!({"mean": [0.0, 1.0], "covariance": [[1.0]]}),
        "nodes[0].observed.mean",
        "2 items where 1",
    ),
    (
        |p| p["nodes"][0]["observed"] = json!({"mean": [0.0], "covariance": [[1.0, 0.0]]}),
        "nodes[0].observed.covariance[0]",
        "2 items where 1",
    ),
    (
        |p| p["nodes"][0]["surprise"] = 1.into(),
        "",
        "unknown field `surprise`",
    ),
    (|p| p["nodes"] = json!([]), "nodes", "empty"),
    (
        |p| p["matching"] = "nearest".into(),
        "nodes[0].place",
        "a segment",
    ),
    (|p| p["matching"] = "farthest".into(), "", "unknown variant"),
    (
        |p| p["scale"] = json!([1.0, 1.0]),
        "scale",
        "2 items where 1",
    ),
    (|p| p["scale"] = json!([0.0]), "scale[0]", "at least 1e-60"),
    (|p| p["scale"] = json!([-1.0]), "scale[0]", "at least 1e-60"),
    (
        |p| p["problem"] = "corridor\u{1b}[31m".into(),
        "problem",
        "control character \\u{1b}",
    ),
    (
        |p| p["solver"] = "a\nb".into(),
        "solver",
        "control character \\u{a}",
    ),
    (|p| p["states"] = json!([]), "states", "empty"),
    (|p| p["states"] = json!([""]), "states[0]", "empty name"),
    (
        |p| p["actions"][2] = "EAST".into(),
        "actions[2]",
        "there already",
    ),
    (
        |p| p["actions"][0] = "\u{202e}TSAE".into(),
        "actions[0]",
        "control character",
    ),
    (|p| p["modes"] = json!([]), "modes", "empty"),
    (
        |p| p["modes"] = json!(["\u{9b}"]),
        "modes[0]",
        "control character",
    ),
    (|p| p["fingerprint"] = "1".into(), "", "a fingerprint is"),
    (|p| p["start"]["level"] = 99.into(), "start.level", "levels"),
    (|p| p["start"]["mode"] = 1.into(), "start.mode", "modes"),
    (
        |p| p["start"]["mean"] = json!([1.0, 2.0]),
        "start.mean",
        "2 items where 1",
    ),
    (
        |p| p["start"]["mean"] = json!([1e100]),
        "start.mean[0]",
        "1e100",
    ),
    (
        |p| p["filter"]["A"] = json!([[1.0, 0.0]]),
        "filter.A[0]",
        "2 items where 1",
    ),
    (
        |p| p["filter"]["A"] = json!([[1e150]]),
        "filter.A[0][0]",
        "1e150",
    ),
    (
        |p| p["filter"]["Bu"] = json!([[1.0]]),
        "filter.Bu",
        "1 items where 3",
    ),
    (|p| p["filter"]["H"] = json!([]), "filter.H", "empty"),
    (
        |p| p["filter"]["H"] = json!([[1.0], [1.0]]),
        "filter.levels[0].steps[0].gain[0]",
        "1 items where 2",
    ),
    (
        |p| p["filter"]["classes"] = json!([0, 0]),
        "filter.classes",
        "2 items where 3",
    ),
    (
        |p| p["filter"]["classes"][1] = 1.into(),
        "filter.classes[1]",
        "there are 1 noise classes",
    ),
    (
        |p| p["filter"]["levels"] = json!([]),
        "start.level",
        "there are 0 levels",
    ),
    (
        |p| p["filter"]["levels"][0]["steps"] = json!([]),
        "filter.classes[0]",
        "there are 0 noise classes",
    ),
    (
        |p| p["filter"]["levels"][1]["steps"] = json!([]),
        "filter.levels[1].steps",
        "0 items where 1",
    ),
    (
        |p| p["filter"]["levels"][1]["steps"][0]["next"] = 99.into(),
        "filter.levels[1].steps[0].next",
        "levels",
    ),
    (
        |p| p["filter"]["levels"][1]["steps"][0]["gain"] = json!([]),
        "filter.levels[1].steps[0].gain",
        "0 items where 1",
    ),
    (
        |p| p["filter"]["levels"][1]["covariance"] = json!([[-0.5]]),
        "filter.levels[1].covariance",
        "not positive semi-definite",
    ),
    (
        |p| p["filter"]["levels"][1]["covariance"] = json!([[0.5], [0.5]]),
        "filter.levels[1].covariance",
        "2 items where 1",
    ),
    (
        |p| p["filter"]["levels"][1]["covariance"] = json!([[null]]),
        "",
        "invalid type: null",
    ),
    (
        |p| p["filter"]["walls"] = json!({"bounds": []}),
        "filter.walls.bounds",
        "0 items where 1",
    ),
    (
        |p| p["filter"]["walls"] = json!({"bounds": [[1.0, 0.0]]}),
        "filter.walls.bounds[0]",
        "not below",
    ),
    (
        |p| {
            p["filter"]["walls"] =
                json!({"bounds": [[0.0, 1.0]], "map": {"cell": 1.0, "rows": ["."]}})
        },
        "filter.walls.map",
        "two directions",
    ),
    (
        |p| p["memory"] = json!({"switches": [{"when": "before", "becomes": 1}]}),
        "memory.switches[0].becomes",
        "modes",
    ),
    (
        |p| p["memory"] = json!({"switches": [{"when": "before", "becomes": 0, "actions": [3]}]}),
        "memory.switches[0].actions[0]",
        "actions",
    ),
    (
        |p| p["memory"] = json!({"switches": [{"when": "before", "becomes": 0, "mode": 1}]}),
        "memory.switches[0].mode",
        "modes",
    ),
    (
        |p| p["memory"] = json!({"switches": [{"when": "before", "becomes": 0, "region": [{"state": 1, "within": [0.0, 1.0]}]}]}),
        "memory.switches[0].region[0].state",
        "state variables",
    ),
    (
        |p| p["memory"] = json!({"switches": [{"when": "before", "becomes": 0, "region": [{"state": 0, "within": [1.0, 1.0]}]}]}),
        "memory.switches[0].region[0].within",
        "not below",
    ),
    (
        |p| p["memory"] = json!({"switches": [], "recall": {}}),
        "",
        "damaged",
    ),
    (
        |p| p["memory"] = recall(&[("bounds", json!([[0.0, 0.0]]))]),
        "memory.recall.bounds[0]",
        "not below",
    ),
    (
        |p| p["memory"] = recall(&[("bounds", json!([]))]),
        "memory.recall.bounds",
        "0 items where 1",
    ),
    (
        |p| p["memory"] = recall(&[("centres", json!([]))]),
        "memory.recall.centres",
        "empty",
    ),
    (
        |p| p["memory"] = recall(&[("centres", json!([[0.0, 0.0]]))]),
        "memory.recall.centres[0]",
        "2 items where 1",
    ),
    (
        |p| p["memory"] = recall(&[("first", json!([1]))]),
        "memory.recall.first[0]",
        "modes",
    ),
    (
        |p| p["memory"] = recall(&[("next", json!([]))]),
        "memory.recall.next",
        "0 items where 1",
    ),
    (
        |p| p["memory"] = recall(&[("next", json!([[[0], [0]]]))]),
        "memory.recall.next[0]",
        "2 items where 3",
    ),
    (
        |p| p["memory"] = recall(&[("next", json!([[[0], [0, 0], [0]]]))]),
        "memory.recall.next[0][1]",
        "2 items where 1",
    ),
    (
        |p| p["memory"] = recall(&[("next", json!([[[0], [0], [1]]]))]),
        "memory.recall.next[0][2][0]",
        "modes",
    ),
    (
        |p| drop(p.as_object_mut().unwrap().remove("filter")),
        "",
        "missing field `filter`",
    ),
];

/// A memory of one mode in one cluster, for one state variable and three actions, with some keys changed.
fn recall(changes: &[(&str, Value)]) -> Value {
    let mut recall = json!({"bounds": [[0.0, 4.0]], "centres": [[1.0]], "first": [0], "next": [[[0], [0], [0]]]});
    for (key, value) in changes {
        recall[key] = value.clone();
    }
    json!({ "recall": recall })
}

const DAMAGES_OF_A_RICH_ONE: &[Damage] = &[
    (
        |p| p["coordinates"] = json!([]),
        "coordinates",
        "0 items where 1 to 8",
    ),
    (
        |p| p["coordinates"][0]["name"] = "\u{7f}".into(),
        "coordinates[0].name",
        "control character",
    ),
    (
        |p| p["coordinates"][0]["vector"] = json!([1.0, 2.0, 3.0]),
        "coordinates[0].vector",
        "3 items where",
    ),
    (
        |p| p["memory"]["switches"][0]["becomes"] = 9.into(),
        "memory.switches[0].becomes",
        "modes",
    ),
];

const DAMAGES_OF_A_MAP: &[Damage] = &[
    (
        |p| p["filter"]["walls"]["map"]["cell"] = 0.0.into(),
        "filter.walls.map.cell",
        "at least",
    ),
    (
        |p| p["filter"]["walls"]["map"]["rows"] = json!([]),
        "filter.walls.map.rows",
        "empty",
    ),
    (
        |p| p["filter"]["walls"]["map"]["rows"][3] = "..x..?.**.".into(),
        "filter.walls.map.rows",
        "row 3",
    ),
    (
        |p| p["filter"]["walls"]["map"]["rows"][0] = "....#...*\u{7}".into(),
        "filter.walls.map.rows[0]",
        "control character",
    ),
    (
        |p| p["filter"]["walls"]["map"]["rows"][0] = ".".repeat(2_000_000).into(),
        "filter.walls.map.rows",
        "characters",
    ),
    (
        |p| p["filter"]["levels"][0]["covariance"] = json!([[0.3, 0.1], [0.2, 0.3]]),
        "filter.levels[0].covariance[1][0]",
        "not symmetric",
    ),
    (
        |p| p["filter"]["levels"][0]["covariance"] = json!([[0.3, 0.4], [0.4, 0.3]]),
        "filter.levels[0].covariance",
        "correlations at most 1",
    ),
];

#[test]
fn damaged_policies_are_refused_with_the_place() {
    let mut mapped = empty("u-maze", Matching::Nearest);
    mapped.nodes = vec![Node::new(0..=0, 0, Place::Point(vec![1.0, 2.0]), 1, None)];
    for (automaton, damages) in [
        (one_node(), DAMAGES_OF_ONE_NODE),
        (rich(), DAMAGES_OF_A_RICH_ONE),
        (mapped, DAMAGES_OF_A_MAP),
        (grown(), DAMAGES_OF_A_TREE),
    ] {
        for (damage, place, word) in damages {
            let reason = refusal_of(&automaton, damage);
            let says = match *place {
                "" => "damaged policy file: ".to_owned(),
                place => format!("damaged policy file: {place}: "),
            };
            assert!(
                reason.starts_with(&says) && reason.contains(word),
                "{says}{word}\n{reason}"
            );
            assert!(reason.contains("solve again"), "{reason}");
        }
    }
}

/// Few bytes that would take much memory or time to run.
#[test]
fn what_would_take_too_much_memory_is_refused() {
    let many = |count: usize, item: Value| Value::Array(vec![item; count]);
    let reason = refusal_of(&one_node(), |p| {
        let level = p["filter"]["levels"][0].clone();
        p["filter"]["levels"] = many(20_000, level);
        p["actions"] = (0..2000).map(|i| Value::from(format!("A{i}"))).collect();
        p["filter"]["Bu"] = many(2000, json!([0.0]));
        p["filter"]["classes"] = many(2000, 0.into());
    });
    assert!(
        reason.contains(
            "filter.levels: gains of 1 x 1 at 20000 levels for 2000 actions are more than"
        ),
        "{reason}"
    );
    let reason = refusal_of(&one_node(), |p| p["modes"] = many(2_000_000, "".into()));
    assert!(
        reason.contains(
            "nodes: 1 nodes in 1 coordinates at 10 levels, and again for each of 1999999 modes"
        ),
        "{reason}"
    );
}

#[test]
fn a_checksum_that_is_wrong_is_refused_with_the_right_one() {
    let mut file: Value = serde_json::from_str(&one_node().to_json().unwrap()).unwrap();
    file["policy"]["nodes"][0]["value"] = 0.75.into();
    let right = checksum(&file["policy"].to_string());
    let reason = reason(&file.to_string());
    assert!(
        reason.contains("damaged") && reason.contains("solve again") && reason.contains(&right),
        "{reason}"
    );
    // Edited on purpose, and said so.
    let edited = Automaton::from_json(&sealed(file), "x").unwrap();
    assert_eq!(edited.nodes[0].value, Some(0.75));
}

/// The checksum covers tokens, so that a file may be laid out anew.
#[test]
fn white_space_between_tokens_does_not_count() {
    let mut automaton = one_node();
    automaton.states = vec!["a \\\" b,\t:".replace('\t', " ")];
    automaton.problem = "\u{e9} \\".to_owned();
    let text = automaton.to_json().unwrap();
    let value: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        value["checksum"],
        checksum(&text[text.find("\"policy\": ").unwrap() + 10..text.len() - 3])
    );
    for layout in [
        text.replace('\n', ""),
        text.replace('\n', "\r\n\t"),
        format!("\n\n {text} \n"),
    ] {
        assert_eq!(Automaton::from_json(&layout, "x").unwrap(), automaton);
    }
    // Inside a text it does.
    assert!(Automaton::from_json(&text.replace("a \\", "a  \\"), "x").is_err());
}

#[test]
fn automata_that_could_not_be_read_again_are_not_written() {
    let refused = |change: fn(&mut Automaton)| {
        let mut automaton = one_node();
        change(&mut automaton);
        automaton.to_json().unwrap_err().to_string()
    };
    type Change = (fn(&mut Automaton), &'static str);
    let changes: [Change; 7] = [
        (|a| a.nodes.clear(), "nodes: the list is empty"),
        (|a| a.nodes[0].value = Some(f64::NAN), "nodes[0].value: NaN"),
        (
            |a| a.planned_value = Some(f64::INFINITY),
            "planned_value: inf",
        ),
        (|a| a.scale[0] = 0.0, "scale[0]"),
        (
            |a| a.actions[0].push('\u{1b}'),
            "actions[0]: the control character",
        ),
        (
            |a| drop(a.levels.pop()),
            "filter.levels: 9 covariances, and the filter has 30 steps of 3 actions",
        ),
        (
            |a| a.levels[3][0] = f64::NEG_INFINITY,
            "filter.levels[3].covariance[0][0]: -inf",
        ),
    ];
    for (change, says) in changes {
        let error = refused(change);
        assert!(
            error.contains(says) && error.contains("cannot be kept"),
            "{says}: {error}"
        );
    }
}

/// The places of a JSON value, with their parents.
fn paths(value: &Value, here: &str, found: &mut Vec<String>) {
    found.push(here.to_owned());
    match value {
        Value::Object(object) => {
            for (key, value) in object {
                paths(value, &format!("{here}/{key}"), found);
            }
        }
        Value::Array(list) => {
            for (i, value) in list.iter().enumerate() {
                paths(value, &format!("{here}/{i}"), found);
            }
        }
        _ => {}
    }
}

/// Runs an automaton on readings that are not what its filter expects.
fn runs(automaton: &Automaton) {
    let mut controller = AutomatonRunner::new(automaton);
    for step in 0..60_i32 {
        let (node, action) = controller.decide();
        assert!(node < automaton.nodes.len() && action < automaton.actions.len());
        let size = if step % 7 == 0 { LARGEST } else { 0.5 };
        let reading = if step % 2 == 0 { size } else { -size };
        controller.observe(action, &vec![reading; automaton.updater.readings()]);
        let belief = controller.belief();
        assert!(belief.mean.iter().all(|m| m.abs() <= LARGEST), "{belief:?}");
        assert!(belief.stratum < automaton.levels.len() && belief.mode < automaton.modes.len());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn saving_and_loading_changes_nothing(automaton in any_automaton(number(), 1..12)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("policy.json");
        automaton.save(&path).unwrap();
        let loaded = Automaton::load(&path).unwrap();
        prop_assert_eq!(&loaded, &automaton);
        let text = automaton.to_json().unwrap();
        prop_assert_eq!(loaded.to_json().unwrap(), text.as_str());
        prop_assert!(text.lines().all(|line| line.len() <= 160), "{}", text);
        // Zeros keep their sign, too.
        prop_assert_eq!(format!("{loaded:?}"), format!("{automaton:?}"));
    }

    /// A file whose bytes are not those written is refused, unless the difference means nothing.
    #[test]
    fn changed_bytes_are_refused(
        automaton in any_automaton(-5.0..5.0_f64, 1..4),
        flips in proptest::collection::vec((any::<proptest::sample::Index>(), 1..=255_u8), 1..3),
    ) {
        let mut bytes = automaton.to_json().unwrap().into_bytes();
        for (place, flip) in flips {
            let place = place.index(bytes.len());
            bytes[place] ^= flip;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("policy.json");
        std::fs::write(&path, bytes).unwrap();
        if let Ok(loaded) = Automaton::load(&path) {
            prop_assert_eq!(loaded, automaton);
        }
    }

    #[test]
    fn edited_text_is_refused(
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
            Ok(loaded) => prop_assert_eq!(loaded, automaton),
            Err(error) => prop_assert!(error.to_string().starts_with("edited.json: ")),
        }
    }

    /// A policy that was changed by somebody who knows how the checksum is made is refused, or it runs.
    #[test]
    fn changed_policies_are_refused_or_run(
        automaton in any_automaton(-5.0..5.0_f64, 1..4),
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), 0..18_usize), 1..4),
    ) {
        let mut file: Value = serde_json::from_str(&automaton.to_json().unwrap()).unwrap();
        for (place, kind) in changes {
            let mut found = Vec::new();
            paths(&file["policy"], "/policy", &mut found);
            let value = file.pointer_mut(&found[place.index(found.len())]).unwrap();
            let numbers = [
                json!(0), json!(1), json!(-1), json!(2), json!(7), json!(1e59), json!(-1e60), json!(1e61), json!(1e308), json!(1e-320),
                json!(u64::MAX), json!(null), json!([]), json!({}), json!("x"),
            ];
            match kind {
                15 => if let Value::Array(list) = value { list.push(list.first().cloned().unwrap_or_default()) },
                16 => if let Value::Array(list) = value { list.pop(); },
                17 => if let Value::Array(list) = value { list.reverse() },
                kind => *value = numbers[kind].clone(),
            }
        }
        if let Ok(loaded) = Automaton::from_json(&sealed(file), "changed.json") {
            runs(&loaded);
            let again = loaded.to_json().unwrap();
            prop_assert_eq!(Automaton::from_json(&again, "again.json").unwrap(), loaded);
        }
    }
}
