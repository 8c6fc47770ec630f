//! How long the pole of thesis 5.5.5 stays up: our automaton, the bang-bang regulator with its weights tuned, and the thesis'
//! open-loop branches with grouped actions. Prints a Markdown table.
//!
//! ```text
//! cargo run --release -p pilotage-thesis --example pole_life -- MODEL [RUNS [STEPS [SEED]]]
//! ```
//!
//! MODEL is `cart-pole` (sensor variance 0.05) or `cart-pole-noisy` (0.15). All policies meet the same noise.

#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::time::Instant;

use pilotage::belief::BeliefMdp;
use pilotage::policy::{AutomatonRunner, Policy};
use pilotage::progress::{Progress, Silent};
use pilotage::scenario::find;
use pilotage::simulate::{LifeOptions, life};
use pilotage::solve::kbvi::branches::{self, Branches};
use pilotage::solve::{PolicySearch, policy_search};
use pilotage_thesis::regulator::tuned;

struct Notes;

impl Progress for Notes {
    fn note(&self, message: &str) {
        eprintln!("{message}");
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let name = arguments.first().map_or("cart-pole", String::as_str);
    let number = |k: usize, default: u64| arguments.get(k).map_or(Ok(default), |text| text.parse());
    let options = LifeOptions {
        runs: number(1, 10)? as usize,
        steps: number(2, 1_500_000)?,
        seed: number(3, 2026)?,
    };
    let scenario = find(name)?;
    let mdp = BeliefMdp::new(&scenario.model);

    let clock = Instant::now();
    let automaton = policy_search::search(&mdp, &PolicySearch::survival(), 1, &Notes)?;
    let planning = clock.elapsed().as_secs_f64();
    let earning = policy_search::search(&mdp, &PolicySearch::default(), 1, &Notes)?;
    let (lqg, [position, angle, control]) = tuned(&mdp, 1.0)?;

    println!(
        "pilotage {}, {name}, seed {}, {} runs of {} steps, planned in {planning:.0} s",
        env!("CARGO_PKG_VERSION"),
        options.seed,
        options.runs,
        options.steps
    );
    println!(
        "\n| policy | nodes | steps | failures | within 100 steps | runs without | mean life |"
    );
    println!("|---|---|---|---|---|---|---|");
    let row = |label: &str, nodes: String, policy: &dyn Policy, options: LifeOptions| {
        let life = life(&scenario, &automaton.updater, policy, options, &Silent);
        let mean = life
            .mean()
            .map_or(format!("at least {:.0} (95%)", life.at_least()), |mean| {
                format!("{:.0} +- {:.0}", mean.mean, mean.stderr)
            });
        println!(
            "| {label} | {nodes} | {} | {} | {} | {} of {} | {mean} |",
            life.steps(),
            life.failures(),
            life.early(),
            life.unfailing(),
            life.runs.len()
        );
    };
    for (label, automaton) in [
        ("policy-search for survival", &automaton),
        ("policy-search for the return", &earning),
    ] {
        let nodes = automaton.nodes.len().to_string();
        row(label, nodes, &AutomatonRunner::new(automaton), options);
    }
    let label = format!("lqg, bang-bang (x {position:e}, angle {angle}, force {control:e})");
    row(&label, String::new(), &lqg, options);
    for (horizon, group) in [(100, 20), (140, 20), (180, 20), (6, 1)] {
        let settings = branches::Settings {
            horizon,
            group,
            ..Default::default()
        };
        let planner = Branches::new(mdp.clone(), settings);
        let label = format!("kbvi, open loop, horizon {horizon}, actions kept {group} steps");
        let short = LifeOptions {
            runs: options.runs.min(10),
            steps: options.steps.min(5000),
            ..options
        };
        row(&label, String::new(), &planner, short);
    }
    Ok(())
}
