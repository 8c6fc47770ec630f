//! ARKAQ on the shuttle, beside one who is told which way it faces.
#![allow(clippy::unwrap_used)]

use pilotage::policy::AutomatonRunner;
use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::{Options, evaluate};
use pilotage::solve::arkaq::{self, Learned, Settings};
use pilotage::solve::value_iteration;
use pilotage::world::{ProblemWorld, World};
use pilotage_thesis::baseline::baselines;

/// Two docks, and which way the shuttle faces is to be told from the last three steps.
#[test]
fn a_longer_memory_finds_which_way_the_shuttle_faces_and_merges_into_a_handful_of_states() {
    let scenario = scenario::find("shuttle-blind").unwrap();
    let short = Settings {
        lambda: 0.9,
        vigilances: vec![0.5],
        ..Settings::default()
    };
    let long = Settings {
        depth: 3,
        state_limit: 1_000,
        merge: true,
        ..short.clone()
    };
    let told = value_iteration::Settings::default();
    let options = |episodes| Options { episodes, seed: 77 };
    let best = baselines(&scenario, &told, options(2_000), &Silent).unwrap()[0].earned;
    let share = |learned: &Learned| {
        let (filter, policy) = (
            &learned.automaton.updater,
            AutomatonRunner::new(&learned.automaton),
        );
        let earned = evaluate(&scenario, filter, &policy, options(500), &Silent);
        earned.discounted.mean / best.discounted.mean
    };
    let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&scenario)) };
    let learn = |settings: &Settings| {
        arkaq::learn(&scenario.model, &worlds, settings, None, &Silent).unwrap()
    };
    let (short, long) = (learn(&short), learn(&long));
    let (one, three) = (share(&short), share(&long));
    assert!(three >= 0.85 && three > 1.5 * one, "{one} and {three}");
    let nodes = long.automaton.nodes.len();
    assert!(10 * nodes < long.learning.states, "{nodes}");
}
