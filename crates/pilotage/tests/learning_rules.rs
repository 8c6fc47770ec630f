//! The thesis' two rules by which beliefs become nodes (5.4.1 and 5.4.2).
#![allow(clippy::unwrap_used, clippy::type_complexity)]

mod common;

use common::built_in;
use pilotage::belief::{Belief, BeliefMdp};
use pilotage::policy::{Automaton, Matching, Node, Place, Policy};
use proptest::prelude::*;

fn empty(name: &str, matching: Matching) -> Automaton {
    Automaton::new(&BeliefMdp::new(&built_in(name)), "test", matching)
}

fn belief(level: usize, mean: &[f64]) -> Belief {
    Belief {
        stratum: level,
        mode: 0,
        mean: mean.to_vec(),
    }
}

/// Corners of the segments with their level, action and value.
fn segments(automaton: &Automaton) -> Vec<(usize, Vec<f64>, Vec<f64>, usize, Option<f64>)> {
    let described = |node: &Node| match &node.place {
        Place::Segment { lower, upper, .. } => (
            node.levels.0,
            lower.clone(),
            upper.clone(),
            node.action,
            node.value,
        ),
        Place::Point(point) => panic!("a point at {point:?}"),
    };
    automaton.nodes.iter().map(described).collect()
}

#[test]
fn a_segment_is_extended_by_beliefs_with_its_action() {
    let mut automaton = empty("corridor-blind", Matching::Segments);
    for (mean, value) in [(1.0, 0.5), (2.0, 0.3), (0.5, 0.4)] {
        assert_eq!(automaton.learn(&belief(0, &[mean]), 0, value), 0);
    }
    assert_eq!(
        segments(&automaton),
        [(0, vec![0.5], vec![2.0], 0, Some(0.3))]
    );
    // The point of least value (Figure 5.7).
    assert!(
        matches!(&automaton.nodes[0].place, Place::Segment { minimum, .. } if *minimum == [2.0])
    );
}

#[test]
fn a_segment_is_split_half_way_to_its_point_of_least_value() {
    let mut automaton = empty("corridor-blind", Matching::Segments);
    for (mean, value) in [(0.0, 0.1), (4.0, 0.9)] {
        automaton.learn(&belief(0, &[mean]), 0, value);
    }
    automaton.learn(&belief(0, &[3.0]), 2, 1.0);
    assert_eq!(
        segments(&automaton),
        [
            (0, vec![0.0], vec![1.5], 0, Some(0.1)),
            (0, vec![1.5], vec![4.0], 2, Some(1.0))
        ]
    );
}

#[test]
fn a_segment_does_not_grow_over_another() {
    let mut automaton = empty("corridor-blind", Matching::Segments);
    for (mean, action) in [(0.0, 0), (1.0, 2), (2.0, 0)] {
        automaton.learn(&belief(0, &[mean]), action, 0.0);
    }
    assert_eq!(automaton.nodes.len(), 3);
    // Levels do not share segments while learning.
    automaton.learn(&belief(1, &[1.0]), 0, 0.0);
    assert_eq!(automaton.nodes.len(), 4);
}

#[test]
fn nearest_points_are_added_where_the_action_differs() {
    let mut automaton = empty("corridor-blind", Matching::Nearest);
    let learned = [(0.0, 0), (1.0, 0), (4.0, 1), (2.5, 1), (2.4, 0), (9.0, 1)];
    let nodes: Vec<usize> = learned
        .iter()
        .map(|&(mean, action)| automaton.learn(&belief(0, &[mean]), action, 0.0))
        .collect();
    assert_eq!(nodes, [0, 0, 1, 1, 2, 1]);
}

/// A belief whose action turns out to be another takes the new one, and leaves no double behind.
#[test]
fn a_point_can_change_its_mind() {
    let mut automaton = empty("corridor-blind", Matching::Nearest);
    for action in [0, 1, 0, 2] {
        automaton.learn(&belief(0, &[1.0]), action, 0.0);
        assert_eq!(automaton.action(&belief(0, &[1.0])), action);
    }
    assert_eq!(automaton.nodes.len(), 1);
}

#[test]
fn merging_joins_what_nothing_keeps_apart() {
    let mut automaton = empty("corridor-blind", Matching::Segments);
    let segment = |low: f64, high: f64| Place::Segment {
        lower: vec![low],
        minimum: vec![low],
        upper: vec![high],
    };
    for (place, action, value) in [
        (segment(0.0, 1.0), 0, 0.4),
        (segment(1.5, 2.0), 0, 0.2),
        (segment(2.5, 3.0), 2, 0.9),
        (segment(3.5, 4.0), 0, 0.1),
    ] {
        automaton
            .nodes
            .push(Node::new(0..=0, 0, place, action, Some(value)));
    }
    automaton.merge_segments();
    assert_eq!(
        segments(&automaton),
        [
            (0, vec![0.0], vec![2.0], 0, Some(0.2)),
            (0, vec![2.5], vec![3.0], 2, Some(0.9)),
            (0, vec![3.5], vec![4.0], 0, Some(0.1)),
        ]
    );
}

/// Two segments of one level that differ in action share at most a border.
fn overlap(automaton: &Automaton) -> Option<String> {
    let all = segments(automaton);
    for (k, a) in all.iter().enumerate() {
        for b in &all[..k] {
            let inside = |i: usize| a.1[i] < b.2[i] && b.1[i] < a.2[i];
            if a.0 == b.0 && a.3 != b.3 && (0..a.1.len()).all(inside) {
                return Some(format!("{a:?} and {b:?}"));
            }
        }
    }
    None
}

/// Beliefs in one or two variables with actions and values: anywhere, or on whole numbers, where they meet again and again.
fn lessons() -> impl Strategy<Value = (usize, Vec<(usize, Vec<f64>, usize, f64)>)> {
    let coordinate = prop_oneof![
        Just(0.0..4.0_f64).prop_flat_map(|range| range).boxed(),
        (0..=4_i32).prop_map(f64::from).boxed(),
    ];
    let lesson = (
        0..2_usize,
        proptest::collection::vec(coordinate, 2),
        0..3_usize,
        -1.0..1.0_f64,
    );
    (1..=2_usize, proptest::collection::vec(lesson, 1..40))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn every_belief_gets_its_latest_action((dims, lessons) in lessons()) {
        let name = ["corridor-blind", "maze-2d"][dims - 1];
        for matching in [Matching::Nearest, Matching::Segments] {
            let mut automaton = empty(name, matching);
            for (level, mean, action, value) in &lessons {
                let belief = belief(*level, &mean[..dims]);
                let id = automaton.learn(&belief, *action, *value);
                prop_assert_eq!(automaton.nodes[id].action, *action);
                prop_assert_eq!(automaton.action(&belief), *action, "{:?} {:?}", matching, automaton.nodes);
                if matching == Matching::Segments {
                    prop_assert_eq!(overlap(&automaton), None);
                }
            }
            prop_assert!(automaton.nodes.len() <= lessons.len());
        }
    }

    #[test]
    fn points_of_least_value_stay_inside((dims, lessons) in lessons()) {
        let mut automaton = empty(["corridor-blind", "maze-2d"][dims - 1], Matching::Segments);
        for (level, mean, action, value) in &lessons {
            automaton.learn(&belief(*level, &mean[..dims]), *action, *value);
        }
        automaton.merge_segments();
        prop_assert_eq!(overlap(&automaton), None);
        for node in &automaton.nodes {
            let Place::Segment { lower, minimum, upper } = &node.place else { unreachable!() };
            for i in 0..dims {
                prop_assert!(lower[i] <= minimum[i] && minimum[i] <= upper[i]);
            }
        }
    }

    /// Merging changes no decision inside a segment, and no place loses its action: what lay in a segment still does. (A flat
    /// segment may come to lie on a border, where either side may decide.)
    #[test]
    fn merging_keeps_what_segments_do((dims, lessons) in lessons()) {
        let mut automaton = empty(["corridor-blind", "maze-2d"][dims - 1], Matching::Segments);
        for (level, mean, action, value) in &lessons {
            automaton.learn(&belief(*level, &mean[..dims]), *action, *value);
        }
        let before = segments(&automaton);
        automaton.merge_segments();
        let after = segments(&automaton);
        for (level, lower, upper, action, _) in &before {
            let middle: Vec<f64> = lower.iter().zip(upper).map(|(a, b)| 0.5 * (a + b)).collect();
            let kept = after.iter().any(|(other, low, high, does, _)| {
                other == level && does == action && (0..dims).all(|i| low[i] <= middle[i] && middle[i] <= high[i])
            });
            prop_assert!(kept);
            if (0..dims).all(|i| lower[i] < upper[i]) {
                prop_assert_eq!(automaton.action(&belief(*level, &middle)), *action);
            }
        }
    }

    /// A belief learned with an action is near no other: the condensed rule reproduces every lesson that no later one overruled, once
    /// it has been told often enough.
    #[test]
    fn points_reproduce_consistent_lessons((dims, lessons) in lessons()) {
        let mut automaton = empty(["corridor-blind", "maze-2d"][dims - 1], Matching::Nearest);
        let taught = |mean: &[f64]| usize::from(mean[0] > 1.7) + usize::from(mean[dims - 1] > 3.1);
        for _ in 0..=lessons.len() {
            for (level, mean, _, _) in &lessons {
                automaton.learn(&belief(*level, &mean[..dims]), taught(&mean[..dims]), 0.0);
            }
        }
        for (level, mean, _, _) in &lessons {
            prop_assert_eq!(automaton.action(&belief(*level, &mean[..dims])), taught(&mean[..dims]));
        }
    }
}
