//! One step of an agent at run time: take in an observation, match a node, act. Read the times against `matrix_times_vector`, which
//! is measured in the same run, and against the policy the automaton was compiled from.
#![allow(clippy::unwrap_used)]

use divan::{Bencher, black_box};
use nalgebra::{DMatrix, DVector};
use pilotage::belief::BeliefMdp;
use pilotage::belief::Reading;
use pilotage::policy::{Automaton, AutomatonRunner, Matching, Node, Place};
use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::{Agent, TrackingAgent};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::value_iteration;

fn main() {
    divan::main();
}

/// The yardstick: 4 x 4 times 4, sizes known at run time only, nothing allocated.
#[divan::bench]
fn matrix_times_vector(bencher: Bencher) {
    let matrix = DMatrix::from_fn(4, 4, |i, j| (i as f64 - 0.3 * j as f64).sin());
    let vector = DVector::from_element(4, 0.7);
    let mut product = DVector::zeros(4);
    bencher.bench_local(|| {
        black_box(&mut product).gemv(1.0, black_box(&matrix), black_box(&vector), 0.0);
    });
}

const FORMS: [Matching; 2] = [Matching::Nearest, Matching::Segments];

/// The corridor's own automaton.
#[divan::bench(args = FORMS, sample_size = 1000)]
fn corridor_automaton(bencher: Bencher, matching: &Matching) {
    let policy = corridor();
    let settings = compile::Settings {
        matching: *matching,
        ..compile::Settings::default()
    };
    let automaton = compile(&policy, policy.mdp(), "value-iteration", &settings).unwrap();
    run(bencher, &automaton);
}

/// The policy it was compiled from, which looks one step ahead at every decision.
#[divan::bench(sample_size = 1000)]
fn corridor_grid(bencher: Bencher) {
    let policy = corridor();
    let filter = policy.mdp().filter();
    let mut agent = TrackingAgent::new(&filter, &policy);
    let mut time = 0.0;
    bencher.bench_local(|| {
        let action = agent.act();
        time += 0.1_f64;
        agent.observe(
            black_box(action),
            Reading::Values(black_box(&[3.5 + time.sin()])),
        );
    });
}

/// Four variables, four readings, 200 nodes at one level.
#[divan::bench(args = FORMS)]
fn four_dimensions_200_nodes(bencher: Bencher, matching: &Matching) {
    run(bencher, &synthetic(200, *matching));
}

/// The same with few nodes: one, which leaves the filter's time, and the six of the pole's automaton.
#[divan::bench(args = [1, 6], sample_size = 1000)]
fn four_dimensions_few_nodes(bencher: Bencher, nodes: usize) {
    run(bencher, &synthetic(nodes, Matching::Nearest));
}

fn corridor() -> value_iteration::GridPolicy {
    let mdp = BeliefMdp::new(&scenario::find("corridor-blind").unwrap().model);
    value_iteration::solve(&mdp, &value_iteration::Settings::default(), &Silent).unwrap()
}

fn synthetic(nodes: usize, matching: Matching) -> Automaton {
    let mdp = BeliefMdp::new(&scenario::find("cart-pole").unwrap().model);
    let mut automaton = Automaton::new(&mdp, "bench", matching);
    for k in 0..nodes {
        let corner = |width: f64| -> Vec<f64> {
            let at = |i: usize| (k as f64 * (1.7 + i as f64)).sin();
            (0..4).map(|i| at(i) + width).collect()
        };
        let place = match matching {
            Matching::Nearest => Place::Point(corner(0.0)),
            Matching::Segments | Matching::Tree => Place::Segment {
                lower: corner(-0.1),
                minimum: corner(0.0),
                upper: corner(0.1),
            },
        };
        let levels = 0..=mdp.strata() - 1;
        automaton
            .nodes
            .push(Node::new(levels, 0, place, k % 2, None));
    }
    automaton
}

/// A step is one decision and one observation.
fn run(bencher: Bencher, automaton: &Automaton) {
    let mut controller = AutomatonRunner::new(automaton);
    let observation = vec![0.2; automaton.updater.readings()];
    bencher.bench_local(|| {
        let (_, action) = black_box(controller.decide());
        controller.observe(action, black_box(&observation));
    });
}
