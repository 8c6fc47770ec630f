//! What every drawing has to be: well-formed, the same each time, with nothing written over anything else.

use std::collections::BTreeSet;

use super::svg::text_width;
use super::*;
use pilotage::belief::{Belief, BeliefMdp};
use pilotage::model::ActionId;
use pilotage::policy::{Automaton, GraphNode, Matching, Node, Place, Policy, PolicyGraph};
use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::solve::compile;
use pilotage::solve::value_iteration;

fn mdp(name: &str) -> BeliefMdp {
    BeliefMdp::new(&scenario::find(name).expect("a built-in model").model)
}

fn solved(name: &str, matching: Matching) -> (BeliefMdp, value_iteration::GridPolicy, Automaton) {
    let mdp = mdp(name);
    let settings = value_iteration::Settings {
        points: Some(301),
        ..value_iteration::Settings::default()
    };
    let policy = value_iteration::solve(&mdp, &settings, &Silent).expect("settings in range");
    let settings = compile::Settings {
        matching,
        episodes: 200,
        ..compile::Settings::default()
    };
    let automaton =
        compile::compile(&policy, &mdp, "value-iteration", &settings).expect("settings in range");
    (mdp, policy, automaton)
}

/// Three nodes that take turns, as in Figure 5.12.
fn by_hand() -> Automaton {
    let mut automaton = Automaton::new(&mdp("corridor-blind"), "hand", Matching::Segments);
    let node = |low: f64, high: f64, action, visits, predecessors: &[(usize, f64)]| {
        let place = Place::Segment {
            lower: vec![low],
            minimum: vec![low],
            upper: vec![high],
        };
        Node {
            visits,
            predecessors: predecessors.to_vec(),
            ..Node::new(0..=9, 0, place, action, Some(1.5))
        }
    };
    automaton.nodes = vec![
        node(
            f64::NEG_INFINITY,
            3.0,
            0,
            0.3,
            &[(0, 70.0), (1, 20.0), (2, 10.0)],
        ),
        node(3.0, 4.0, 2, 0.6, &[(1, 150.0), (0, 30.0), (2, 30.0)]),
        node(4.0, f64::INFINITY, 1, 0.1, &[(1, 30.0)]),
    ];
    automaton
}

/// Nodes of all levels and actions, each reached from a few others by a fixed rule.
fn made_up(name: &str, matching: Matching, count: usize) -> Automaton {
    let mdp = mdp(name);
    let mut automaton = Automaton::new(&mdp, "rule", matching);
    let (n, levels) = (automaton.states.len(), automaton.levels.len());
    for k in 0..count {
        let point: Vec<f64> = (0..n)
            .map(|i| ((k * 37 + i * 11) % 40) as f64 / 10.0)
            .collect();
        let place = match matching {
            Matching::Nearest => Place::Point(point),
            Matching::Segments | Matching::Tree => Place::Segment {
                upper: point.iter().map(|x| x + 0.3).collect(),
                minimum: point.clone(),
                lower: point,
            },
        };
        let level = k % levels;
        let mut node = Node::new(
            level..=level,
            k % automaton.modes.len(),
            place,
            k % automaton.actions.len(),
            None,
        );
        node.visits = 2.0 * (count - k) as f64 / (count * (count + 1)) as f64;
        let before: BTreeSet<usize> = [k * 7 + 3, k + 1, k / 2, k].map(|j| j % count).into();
        node.predecessors = before.iter().map(|&j| (j, (j % 13 + 1) as f64)).collect();
        node.predecessors
            .sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        automaton.nodes.push(node);
    }
    automaton
}

/// Takes the actions in turn as the first variable grows.
struct Stripes(usize);

impl Policy for Stripes {
    fn action(&self, belief: &Belief) -> ActionId {
        (belief.mean[0] * 2.0).floor().rem_euclid(self.0 as f64) as usize
    }
}

struct Written {
    text: String,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

fn written(svg: &str) -> Vec<Written> {
    let document = roxmltree::Document::parse(svg).expect("well-formed XML");
    let texts = document
        .descendants()
        .filter(|node| node.has_tag_name("text"));
    texts
        .map(|node| {
            let value = |name: &str| {
                node.attribute(name)
                    .and_then(|text| text.parse::<f64>().ok())
                    .expect("a number")
            };
            let (x, y, size) = (value("x"), value("y"), value("font-size"));
            let text = node.text().unwrap_or_default().to_owned();
            let bold = if node.attribute("font-weight").is_some() {
                1.1
            } else {
                1.0
            };
            let width = bold * text_width(&text, size);
            let left = match node.attribute("text-anchor") {
                Some("middle") => x - 0.5 * width,
                Some("end") => x - width,
                _ => x,
            };
            Written {
                text,
                left,
                right: left + width,
                top: y - 0.75 * size,
                bottom: y + 0.2 * size,
            }
        })
        .collect()
}

/// Asserts what holds for every drawing.
fn assert_sound(svg: &str) {
    assert!(
        !svg.contains("NaN") && !svg.contains("inf"),
        "a number is not finite"
    );
    let document = roxmltree::Document::parse(svg).expect("well-formed XML");
    let root = document.root_element();
    for name in ["title", "desc"] {
        let child = root.children().find(|node| node.has_tag_name(name));
        assert!(
            child
                .and_then(|node| node.text())
                .is_some_and(|text| !text.is_empty()),
            "no {name}"
        );
    }
    let size = |name: &str| {
        root.attribute(name)
            .and_then(|text| text.parse::<f64>().ok())
            .expect("a number")
    };
    let texts = written(svg);
    for (k, a) in texts.iter().enumerate() {
        assert!(
            a.left >= 0.0 && a.right <= size("width") && a.top >= 0.0 && a.bottom <= size("height"),
            "{:?} is cut off",
            a.text
        );
        for b in &texts[..k] {
            let apart =
                a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
            assert!(apart, "{:?} lies over {:?}", a.text, b.text);
        }
    }
}

fn assert_names_actions(svg: &str, names: &[String]) {
    let texts = written(svg);
    for name in names {
        let never = format!("{name} (never chosen)");
        assert!(
            texts
                .iter()
                .any(|written| written.text == *name || written.text == never),
            "{name} is not in the legend"
        );
    }
}

#[test]
fn automaton_by_hand() {
    insta::assert_snapshot!(automaton_svg(&by_hand()).expect("sound"));
}

/// A chain of four nodes that do the same, a loop, a way that is never gone, and one that ends.
fn graph_by_hand() -> PolicyGraph {
    let node = |action, next: &[usize], visits, gone: &[f64]| GraphNode {
        action,
        next: next.to_vec(),
        visits,
        gone: gone.to_vec(),
    };
    let light = scenario::find("light-dark-binary")
        .expect("a built-in model")
        .model;
    PolicyGraph {
        nodes: vec![
            node(1, &[1, 0, 4], 0.4, &[0.1, 0.3, 0.0]),
            node(2, &[2, 2, 2], 0.1, &[0.05, 0.05, 0.0]),
            node(2, &[3, 3, 2], 0.1, &[0.05, 0.05, 0.0]),
            node(2, &[5, 4, 4], 0.1, &[0.05, 0.05, 0.0]),
            node(1, &[1, 3, 3], 0.1, &[0.05, 0.05, 0.0]),
            node(0, &[], 0.2, &[]),
        ],
        ..PolicyGraph::new(&light, "hand")
    }
}

#[test]
fn policy_graph_by_hand() {
    insta::assert_snapshot!(graph_svg(&graph_by_hand()).expect("sound"));
}

#[test]
fn policy_graphs_of_every_size_are_readable() {
    for count in [1, 2, 3, 7, 15, 24, 40, 41, 90] {
        for known in [true, false] {
            let mut graph = graph_by_hand();
            let visits = f64::from(known) / count as f64;
            let node = |k: usize| GraphNode {
                action: k % 3,
                next: [k * 7 + 3, k + 1, k / 2].map(|j| j % count).into(),
                visits,
                gone: vec![0.5 * visits, 0.5 * visits, 0.0],
            };
            graph.nodes = (0..count).map(node).collect();
            let svg = graph_svg(&graph).expect("sound");
            assert_sound(&svg);
            assert_names_actions(&svg, &graph.actions);
        }
    }
    let mut graph = graph_by_hand();
    graph.nodes[0].next[0] = 6;
    let error = graph_svg(&graph).expect_err("it leads nowhere").to_string();
    assert!(
        error.contains("node 0 leads to a node that is not there"),
        "{error}"
    );
    graph.nodes.clear();
    assert!(graph_svg(&graph).is_err());
}

#[test]
fn corridor_automaton() {
    let (_, _, automaton) = solved("corridor-blind", Matching::Nearest);
    insta::assert_snapshot!(automaton_svg(&automaton).expect("sound"));
}

#[test]
fn corridor_belief_map() {
    let (mdp, policy, automaton) = solved("corridor-blind", Matching::Segments);
    insta::assert_snapshot!(belief_map_svg(&mdp, &policy, Some(&automaton)).expect("sound"));
}

#[test]
fn automata_of_every_size_are_readable() {
    for count in [0, 1, 2, 3, 7, 15, 24, 40, 41, 90] {
        for (name, matching) in [
            ("corridor-blind", Matching::Segments),
            ("load-unload", Matching::Nearest),
            ("cart-pole", Matching::Nearest),
        ] {
            let automaton = made_up(name, matching, count);
            let svg = automaton_svg(&automaton).expect("sound");
            assert_sound(&svg);
            assert_names_actions(&svg, &automaton.actions);
            assert_eq!(svg, automaton_svg(&automaton).expect("sound"));
            let cards = svg.matches("<g>").count();
            assert_eq!(cards, count.min(40), "{name} with {count} nodes");
            assert_eq!(svg.contains("left out, with"), count > 40);
        }
    }
}

#[test]
fn automata_of_problems_are_readable() {
    for name in ["corridor-blind", "corridor-declare", "tiger", "load-unload"] {
        for matching in [Matching::Nearest, Matching::Segments] {
            let (mdp, policy, automaton) = solved(name, matching);
            let svg = automaton_svg(&automaton).expect("sound");
            assert_sound(&svg);
            assert_names_actions(&svg, &automaton.actions);
            assert_sound(&belief_map_svg(&mdp, &policy, Some(&automaton)).expect("sound"));
        }
    }
}

#[test]
fn belief_maps_of_every_kind_are_readable() {
    for name in [
        "corridor-blind",
        "tiger",
        "load-unload",
        "maze-2d",
        "cart-pole",
        "scalar-lqg",
    ] {
        let mdp = mdp(name);
        let names: Vec<String> = mdp
            .model()
            .actions
            .iter()
            .map(|action| action.name.clone())
            .collect();
        let policy = Stripes(names.len());
        for automaton in [
            None,
            Some(made_up(name, Matching::Nearest, 30)),
            Some(made_up(name, Matching::Segments, 30)),
        ] {
            let svg = belief_map_svg(&mdp, &policy, automaton.as_ref()).expect("sound");
            assert_sound(&svg);
            assert_names_actions(&svg, &names);
        }
    }
}

#[test]
fn names_are_escaped() {
    let mut automaton = by_hand();
    automaton.problem = "<a> & \"b\"\u{1}".to_owned();
    automaton.actions[0] = "x<y & 'z'".to_owned();
    let svg = automaton_svg(&automaton).expect("sound");
    assert_sound(&svg);
    assert_names_actions(&svg, &automaton.actions);
}

#[test]
fn what_is_not_a_number_is_refused() {
    let mut automaton = by_hand();
    automaton.nodes[1].place = Place::Point(vec![f64::NAN]);
    let message = automaton_svg(&automaton).expect_err("NaN").to_string();
    assert!(message.contains("node 1"), "{message}");
    assert!(belief_map_svg(&mdp("corridor-blind"), &Stripes(3), Some(&automaton)).is_err());
    assert!(belief_map_svg(&mdp("maze-2d"), &Stripes(5), Some(&by_hand())).is_err());
}

#[test]
fn colours_follow_the_scheme_and_need_no_variables() {
    let svg = automaton_svg(&by_hand()).expect("sound");
    assert!(svg.contains("@media (prefers-color-scheme: dark)"));
    assert!(!svg.contains("var("));
    let document = roxmltree::Document::parse(&svg).expect("well-formed XML");
    let texts = document
        .descendants()
        .filter(|node| node.has_tag_name("text"));
    assert!(texts.into_iter().all(|node| {
        node.attribute("fill")
            .is_some_and(|fill| fill.starts_with('#'))
    }));
}

fn series(count: usize) -> Vec<Series> {
    (0..count)
        .map(|k| {
            let points: Vec<(f64, f64)> = (0..50)
                .map(|i| (f64::from(i), (f64::from(i) / (k as f64 + 4.0)).sqrt()))
                .collect();
            Series {
                name: format!("solver {k}"),
                band: (k == 0).then(|| {
                    points
                        .iter()
                        .map(|point| (point.1 - 0.1, point.1 + 0.1))
                        .collect()
                }),
                points,
            }
        })
        .collect()
}

#[test]
fn two_curves() {
    insta::assert_snapshot!(
        curves_svg("Learning", "episodes", "return", &series(2)).expect("sound")
    );
}

#[test]
fn curves_of_any_number_are_readable() {
    for count in [1, 5, 8, 9, 20] {
        let svg = curves_svg("Learning", "episodes", "return", &series(count)).expect("sound");
        assert_sound(&svg);
        let texts = written(&svg);
        assert!(
            series(count)
                .iter()
                .all(|line| texts.iter().any(|written| written.text == line.name))
        );
    }
}

#[test]
fn curves_break_where_there_is_nothing() {
    let mut lines = series(1);
    lines[0].points[20].1 = f64::NAN;
    let svg = curves_svg("Gaps", "x", "y", &lines).expect("sound");
    assert_sound(&svg);
    assert_eq!(svg.matches("stroke-linejoin").count(), 2);
    let nothing = Series {
        points: vec![(0.0, f64::NAN)],
        ..Series::default()
    };
    assert!(curves_svg("Nothing", "x", "y", &[nothing]).is_err());
    lines[0].band = Some(Vec::new());
    assert!(curves_svg("Band", "x", "y", &lines).is_err());
}

#[test]
fn flat_and_single_curves_have_an_axis() {
    for points in [
        vec![(3.0, 2.0)],
        vec![(0.0, 0.0), (1.0, 0.0)],
        vec![(0.0, -1e-9), (1e9, 1e-9)],
    ] {
        let line = Series {
            name: "flat".to_owned(),
            points,
            band: None,
        };
        assert_sound(&curves_svg("Flat", "x", "y", &[line]).expect("sound"));
    }
}
