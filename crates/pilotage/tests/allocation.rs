//! A controller allocates nothing while it runs. (A binary of its own, because it counts every allocation.)
#![allow(clippy::unwrap_used)]

mod common;

use common::built_in;
use pilotage::belief::BeliefMdp;
use pilotage::policy::{Automaton, AutomatonRunner, Matching, Node, Place};

fn automaton(name: &str, matching: Matching) -> Automaton {
    let model = built_in(name);
    let mdp = BeliefMdp::new(&model);
    let mut automaton = Automaton::new(&mdp, "test", matching);
    for k in 0..50 {
        let corner = |offset: f64| -> Vec<f64> {
            (0..model.state_dim())
                .map(|i| (f64::from(k) * 0.37 + i as f64).sin() + offset)
                .collect()
        };
        let place = match matching {
            Matching::Nearest => Place::Point(corner(0.0)),
            Matching::Segments | Matching::Tree => Place::Segment {
                lower: corner(-0.2),
                minimum: corner(0.0),
                upper: corner(0.2),
            },
        };
        let action = k as usize % model.actions.len();
        let levels = 0..=mdp.strata() - 1;
        automaton
            .nodes
            .push(Node::new(levels, 0, place, action, None));
    }
    automaton
}

#[test]
fn a_controller_allocates_nothing_in_a_step() {
    for name in ["corridor-blind", "load-unload", "maze-2d", "cart-pole"] {
        for matching in [Matching::Nearest, Matching::Segments] {
            let automaton = automaton(name, matching);
            let mut controller = AutomatonRunner::new(&automaton);
            let observation = vec![0.1; automaton.updater.readings()];
            let mut nodes = 0;
            let counted = allocation_counter::measure(|| {
                for time in 0..200 {
                    if time % 50 == 0 {
                        controller.reset();
                    }
                    let (node, action) = controller.decide();
                    nodes += node;
                    controller.observe(action, &observation);
                }
            });
            assert!(nodes > 0);
            assert_eq!(counted.count_total, 0, "{name}, {matching:?}");
        }
    }
}

#[test]
fn the_counter_counts() {
    let counted = allocation_counter::measure(|| {
        std::hint::black_box(vec![1.0; 3]);
    });
    assert_eq!(counted.count_total, 1);
}
