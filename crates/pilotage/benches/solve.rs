//! Planning and simulating the corridor: the whole of `solve corridor`, and its parts.
#![allow(clippy::unwrap_used)]

use divan::{Bencher, counter::ItemsCount};
use pilotage::belief::BeliefMdp;
use pilotage::policy::{Automaton, AutomatonRunner, Policy};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Evaluation, Options, evaluate};
use pilotage::solve::compile::{self, compile};
use pilotage::solve::value_iteration;

fn main() {
    divan::main();
}

const EPISODES: usize = 10_000;

/// Read, plan, compile, evaluate.
#[divan::bench(sample_count = 10)]
fn whole() -> Evaluation {
    let corridor = read();
    let policy = plan(&BeliefMdp::new(&corridor.model));
    simulate(&corridor, &AutomatonRunner::new(&compiled(&policy)))
}

#[divan::bench]
fn read() -> Scenario {
    scenario::find("corridor-blind").unwrap()
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
    let controller = AutomatonRunner::new(&compiled(&policy));
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

fn plan(mdp: &BeliefMdp) -> value_iteration::GridPolicy {
    value_iteration::solve(mdp, &value_iteration::Settings::default(), &Silent).unwrap()
}

fn compiled(policy: &value_iteration::GridPolicy) -> Automaton {
    let settings = compile::Settings::default();
    compile(policy, policy.mdp(), "value-iteration", &settings).unwrap()
}

fn simulate(scenario: &Scenario, policy: &dyn Policy) -> Evaluation {
    let filter = BeliefMdp::new(&scenario.model).filter();
    let options = Options {
        episodes: EPISODES,
        seed: 1,
    };
    evaluate(scenario, &filter, policy, options, &Silent)
}
