//! KAFAQ-learning on the thesis' worlds (4.3): medians over many seeds, beside yardsticks that are told map and rewards.
//!
//! `cargo run --release --example kafaq_table -- [PROBLEM or all] [SEEDS] [FILE]` prints a table, and the automaton of the first
//! seed where there are no more than two; it writes every run to FILE as JSON.
#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)]

mod shared;

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use pilotage::model::{self, Model};
use pilotage::observe::Silent;
use pilotage::policy::{Automaton, Controller, Place};
use pilotage::simulate::{Evaluation, evaluate};
use pilotage::solve::kafaq::{self, Learned, Settings};
use pilotage::world::{ProblemWorld, World};
use serde_json::json;
use shared::{EVALUATION, yardsticks};

const PROBLEMS: [&str; 6] = [
    "basic",
    "basic-inner",
    "maze-4x4",
    "cart-load-unload",
    "stations-5x5",
    "shuttle",
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let which = arguments.first().map_or("all", String::as_str);
    let seeds: u64 = arguments.get(1).map_or(20, |text| text.parse().unwrap());
    let file = arguments.get(2).map_or("kafaq_table.json", String::as_str);
    let mut results = Vec::new();
    for name in PROBLEMS
        .into_iter()
        .filter(|name| which == "all" || which == *name)
    {
        let model = model::find(name).unwrap();
        let yardsticks = yardsticks(&model);
        for (what, earned) in &yardsticks {
            println!("{name}: {what}: {}", returns(earned));
        }
        let runs = learn_all(&model, seeds);
        if seeds <= 2 {
            print_automaton(&runs[0].learned);
        }
        print_row(
            name,
            &runs,
            yardsticks.first().map(|yardstick| &yardstick.1),
        );
        results.push(json!({
            "problem": name,
            "yardsticks": yardsticks.iter().map(|(what, earned)| json!({ "what": what, "earned": earned })).collect::<Vec<_>>(),
            "runs": runs.iter().map(Run::json).collect::<Vec<_>>(),
        }));
    }
    std::fs::write(file, serde_json::to_string_pretty(&results).unwrap()).unwrap();
}

struct Run {
    seed: u64,
    learned: Learned,
    earned: Evaluation,
    seconds: f64,
}

impl Run {
    fn new(model: &Model, seed: u64) -> Self {
        let clock = Instant::now();
        let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(model)) };
        let settings = Settings {
            seed,
            ..Settings::default()
        };
        let learned = kafaq::learn(model, &worlds, &settings, None, &Silent).unwrap();
        let seconds = clock.elapsed().as_secs_f64();
        let automaton = &learned.automaton;
        let earned = evaluate(
            model,
            &automaton.filter,
            &Controller::new(automaton),
            EVALUATION,
            &Silent,
        );
        Self {
            seed,
            learned,
            earned,
            seconds,
        }
    }

    fn json(&self) -> serde_json::Value {
        json!({
            "seed": self.seed,
            "earned": self.earned,
            "nodes": self.learned.automaton.nodes.len(),
            "converged": self.learned.converged,
            "samples": self.learned.samples,
            "memory": self.learned.memory,
            "seconds": self.seconds,
        })
    }
}

/// All seeds, two at a time.
fn learn_all(model: &Model, seeds: u64) -> Vec<Run> {
    let next = AtomicUsize::new(1);
    let mut runs: Vec<Run> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..2)
            .map(|_| {
                scope.spawn(|| {
                    let seeds = std::iter::from_fn(|| {
                        let seed = next.fetch_add(1, Ordering::Relaxed) as u64;
                        (seed <= seeds).then_some(seed)
                    });
                    seeds.map(|seed| Run::new(model, seed)).collect::<Vec<_>>()
                })
            })
            .collect();
        workers
            .into_iter()
            .flat_map(|worker| worker.join().unwrap())
            .collect()
    });
    runs.sort_by_key(|run| run.seed);
    runs
}

fn returns(earned: &Evaluation) -> String {
    format!(
        "{:.2} ± {:.2} discounted, {:.3} ± {:.3} a step",
        earned.discounted.mean,
        earned.discounted.stderr,
        earned.undiscounted.mean / earned.steps.mean,
        earned.undiscounted.stderr / earned.steps.mean,
    )
}

fn print_row(name: &str, runs: &[Run], yardstick: Option<&Evaluation>) {
    let spread = |of: &dyn Fn(&Run) -> f64, digits: usize| {
        let mut values: Vec<f64> = runs.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        let middle = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
        format!(
            "{middle:.digits$} [{:.digits$}, {:.digits$}]",
            values[0],
            values[values.len() - 1]
        )
    };
    let (discounted, undiscounted) = yardstick.map_or((f64::NAN, f64::NAN), |yardstick| {
        (yardstick.discounted.mean, yardstick.undiscounted.mean)
    });
    println!(
        "{name}: nodes {}, discounted {} = {}% of the yardstick, undiscounted {}%, converged {} of {}, steps {}, seconds {}",
        spread(&|run| run.learned.automaton.nodes.len() as f64, 0),
        spread(&|run| run.earned.discounted.mean, 2),
        spread(&|run| 100.0 * run.earned.discounted.mean / discounted, 1),
        spread(
            &|run| 100.0 * run.earned.undiscounted.mean / undiscounted,
            1
        ),
        runs.iter().filter(|run| run.learned.converged).count(),
        runs.len(),
        spread(&|run| run.learned.samples as f64, 0),
        spread(&|run| run.seconds, 1),
    );
}

fn print_automaton(learned: &Learned) {
    let automaton: &Automaton = &learned.automaton;
    println!("  {}", learned.memory);
    for node in &automaton.nodes {
        if let Place::Segment { lower, upper, .. } = &node.place {
            println!(
                "  levels {:?} {:?} {lower:.2?}..{upper:.2?} {} {:.1?}",
                node.levels, automaton.modes[node.mode], automaton.actions[node.action], node.value
            );
        }
    }
}
