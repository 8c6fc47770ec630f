//! Planning and simulating the corridor: the whole of `solve corridor`, and its parts.
#![allow(clippy::unwrap_used)]

use divan::{Bencher, counter::ItemsCount};
use pilotage::belief::BeliefMdp;
use pilotage::observe::Silent;
use pilotage::policy::{Automaton, Controller, Policy};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Evaluation, Options, evaluate};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::kbvi::closed;

fn main() {
    divan::main();
}

const EPISODES: usize = 10_000;

/// Read, plan, compile, evaluate.
#[divan::bench(sample_count = 10)]
fn whole() -> Evaluation {
    let corridor = read();
    let policy = plan(&BeliefMdp::new(&corridor.model));
    simulate(&corridor, &Controller::new(&compiled(&policy)))
}

#[divan::bench]
fn read() -> Scenario {
    scenario::find("corridor").unwrap()
}

#[divan::bench(sample_count = 10)]
fn plan_only(bencher: Bencher) {
    let mdp = BeliefMdp::new(&read().model);
    bencher.bench(|| plan(&mdp));
}

#[divan::bench(sample_count = 10)]
fn compile_only(bencher: Bencher) {
    let policy = plan(&BeliefMdp::new(&read().model));
    bencher.bench(|| compiled(&policy));
}

/// Episodes of sixty steps.
#[divan::bench(sample_count = 10)]
fn episodes_of_the_automaton(bencher: Bencher) {
    let corridor = read();
    let policy = plan(&BeliefMdp::new(&corridor.model));
    let controller = Controller::new(&compiled(&policy));
    bencher
        .counter(ItemsCount::new(EPISODES))
        .bench(|| simulate(&corridor, &controller));
}

#[divan::bench(sample_count = 10)]
fn episodes_of_the_grid(bencher: Bencher) {
    let corridor = read();
    let policy = plan(&BeliefMdp::new(&corridor.model));
    bencher
        .counter(ItemsCount::new(EPISODES))
        .bench(|| simulate(&corridor, &policy));
}

fn plan(mdp: &BeliefMdp) -> closed::GridPolicy {
    closed::solve(mdp, &closed::Settings::default(), &Silent).unwrap()
}

fn compiled(policy: &closed::GridPolicy) -> Automaton {
    let settings = compile::Settings::default();
    compile(policy, policy.mdp(), "kbvi-closed", &settings).unwrap()
}

fn simulate(scenario: &Scenario, policy: &dyn Policy) -> Evaluation {
    let filter = BeliefMdp::new(&scenario.model).filter();
    let options = Options {
        episodes: EPISODES,
        seed: 1,
    };
    evaluate(scenario, &filter, policy, options, &Silent)
}
