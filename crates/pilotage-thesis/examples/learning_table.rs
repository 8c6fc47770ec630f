//! Learners side by side on the thesis' worlds (chapters 3, 4 and 6): ARKAQ, ARKAQ with additions, KAFAQ, and KBVI, which is told
//! map and rewards. Medians over seeds, with smallest and largest.
//!
//! ```text
//! cargo run --release -p pilotage-thesis --example learning_table -- [PROBLEM or all] [SEEDS] [FOLDER]
//! ```
//!
//! Prints a Markdown table and writes every run to `FOLDER/learning-PROBLEM.json`, with seed and version.

#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)]

use std::time::Instant;

use pilotage::policy::{Automaton, AutomatonRunner};
use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Estimate, Evaluation, Options, evaluate};
use pilotage::solve::value_iteration;
use pilotage::solve::{Form, Request, ValueIteration, Worlds, arkaq, kafaq, plan};
use pilotage::world::{ProblemWorld, World};
use pilotage_thesis::baseline::{baselines, told};
use rayon::prelude::*;
use serde_json::{Value, json};

const PROBLEMS: [&str; 6] = [
    "basic",
    "maze-4x4",
    "cart-load-unload",
    "stations-5x5",
    "shuttle-blind",
    "cart-pole-sd",
];

/// How automata are evaluated, learned or planned.
const EVALUATION: Options = Options {
    episodes: 2_000,
    seed: 999,
};

const VIGILANCES: [f64; 6] = [0.1, 0.3, 0.5, 0.7, 0.8, 0.9];

/// The best vigilance is the lowest that comes so near to the highest share, in %.
const CLOSE: f64 = 0.5;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let which = arguments.first().map_or("all", String::as_str);
    let seeds: u64 = arguments.get(1).map_or(20, |text| text.parse().unwrap());
    let folder = arguments.get(2).map_or(".", String::as_str);
    println!(
        "| problem | learner | clusters | nodes | steps of experience | share of the yardstick, % | converged | capped |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for name in PROBLEMS
        .into_iter()
        .filter(|name| which == "all" || which == *name)
    {
        let table = Table::new(&scenario::find(name).unwrap(), seeds);
        let file = format!("{folder}/learning-{name}.json");
        std::fs::write(file, serde_json::to_string(&table.json()).unwrap()).unwrap();
    }
}

/// A learner's runs over the seeds.
struct Row {
    learner: String,
    runs: Vec<Run>,
}

struct Run {
    seed: u64,
    automaton: Automaton,
    earned: Evaluation,
    samples: u64,
    converged: bool,
    /// Of ARKAQ.
    network: Option<Network>,
    seconds: f64,
}

struct Network {
    vigilance: f64,
    clusters: usize,
    /// Before merging.
    states: usize,
    capped: bool,
    /// Whether no cluster mixes rewarded beliefs with others.
    goal_apart: bool,
}

struct Table {
    problem: String,
    baseline: (String, Evaluation, Option<usize>),
    rows: Vec<Row>,
}

impl Table {
    fn new(scenario: &Scenario, seeds: u64) -> Self {
        let mut table = Self {
            problem: scenario.model.name.clone(),
            baseline: baseline(scenario),
            rows: Vec::new(),
        };
        println!(
            "| {} | {} | | {} | | {:.2} ± {:.2} = 100 | | |",
            table.problem,
            table.baseline.0,
            table
                .baseline
                .2
                .map_or_else(|| "-".to_owned(), |n| n.to_string()),
            table.baseline.1.discounted.mean,
            table.baseline.1.discounted.stderr,
        );
        let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(scenario)) };
        let all = || (1..=seeds).into_par_iter();
        let learned: Result<Vec<Run>, _> = all()
            .map(|seed| run_kafaq(scenario, &worlds, seed))
            .collect();
        match learned {
            Ok(runs) => {
                table.add("KAFAQ".to_owned(), runs);
            }
            Err(error) => println!("| {} | KAFAQ | {error} |", table.problem),
        }
        let mut add = |learner: &str, settings: &arkaq::Settings| {
            let runs = all().map(|seed| run_arkaq(scenario, &worlds, settings, seed));
            table.add(format!("ARKAQ, {learner}"), runs.collect())
        };
        let extended = arkaq::Settings::extended();
        let plain = arkaq::Settings::default();
        let deep = arkaq::Settings::remembering();
        let at = |settings: &arkaq::Settings, vigilance: f64| arkaq::Settings {
            vigilances: vec![vigilance],
            ..settings.clone()
        };
        let mut best = |what: &str, settings: &arkaq::Settings| {
            let shares = VIGILANCES.map(|vigilance| {
                let learner = format!("{what}vigilance {vigilance}");
                (vigilance, add(&learner, &at(settings, vigilance)))
            });
            let most = shares.iter().map(|share| share.1).fold(0.0, f64::max);
            let found = shares.iter().find(|share| share.1 >= most - CLOSE);
            found.unwrap().0
        };
        let plainly = best("", &plain);
        let deeply = best("Q(lambda), longer memory, ", &deep);
        let additions = [
            (
                "Q(lambda)",
                arkaq::Settings {
                    lambda: extended.lambda,
                    ..at(&plain, plainly)
                },
            ),
            (
                "longer memory",
                arkaq::Settings {
                    depth: extended.depth,
                    state_limit: extended.state_limit,
                    ..at(&plain, plainly)
                },
            ),
            (
                "merging",
                arkaq::Settings {
                    merge: true,
                    ..at(&plain, plainly)
                },
            ),
            (
                "without memory",
                arkaq::Settings {
                    depth: 0,
                    ..at(&plain, plainly)
                },
            ),
        ];
        for (what, settings) in additions {
            add(&format!("vigilance {plainly}, {what}"), &settings);
        }
        let merged = arkaq::Settings {
            merge: true,
            ..at(&deep, deeply)
        };
        add(
            &format!("Q(lambda), longer memory, vigilance {deeply}, merging"),
            &merged,
        );
        let tuned = arkaq::Settings {
            vigilances: extended.vigilances.clone(),
            ..plain
        };
        add("tuned vigilance", &tuned);
        add("all additions", &extended);
        table
    }

    /// Prints and keeps a row; returns its median share of the baseline.
    fn add(&mut self, learner: String, runs: Vec<Run>) -> f64 {
        let best = self.baseline.1.discounted.mean;
        let clusters = |run: &Run| run.network.as_ref().map_or(0.0, |one| one.clusters as f64);
        let clusters = if runs.iter().any(|run| run.network.is_some()) {
            show(spread(&runs, clusters), 0)
        } else {
            String::new()
        };
        let share = spread(&runs, |run| 100.0 * run.earned.discounted.mean / best);
        println!(
            "| {} | {learner} | {} | {} | {} | {} | {} of {} | {} |",
            self.problem,
            clusters,
            show(spread(&runs, |run| run.automaton.nodes.len() as f64), 0),
            show(spread(&runs, |run| run.samples as f64), 0),
            show(share, 1),
            runs.iter().filter(|run| run.converged).count(),
            runs.len(),
            runs.iter()
                .filter(|run| run.network.as_ref().is_some_and(|network| network.capped))
                .count(),
        );
        self.rows.push(Row { learner, runs });
        share[1]
    }

    fn json(&self) -> Value {
        let rows = self.rows.iter().map(|row| {
            json!({
                "learner": row.learner,
                "runs": row.runs.iter().map(Run::json).collect::<Vec<_>>(),
            })
        });
        json!({
            "pilotage": env!("CARGO_PKG_VERSION"),
            "problem": self.problem,
            "evaluation_seed": EVALUATION.seed,
            "yardstick": { "what": self.baseline.0, "earned": self.baseline.1, "nodes": self.baseline.2 },
            "rows": rows.collect::<Vec<_>>(),
        })
    }
}

impl Run {
    fn json(&self) -> Value {
        let network = self.network.as_ref().map(|network| {
            json!({
                "vigilance": network.vigilance,
                "clusters": network.clusters,
                "states": network.states,
                "capped": network.capped,
                "goal_apart": network.goal_apart,
            })
        });
        json!({
            "seed": self.seed,
            "earned": self.earned,
            "nodes": self.automaton.nodes.len(),
            "samples": self.samples,
            "converged": self.converged,
            "network": network,
            "seconds": self.seconds,
        })
    }
}

fn run_kafaq(scenario: &Scenario, worlds: &Worlds<'_>, seed: u64) -> pilotage::Result<Run> {
    let clock = Instant::now();
    let settings = kafaq::Settings {
        seed,
        ..kafaq::Settings::default()
    };
    let learned = kafaq::learn(&scenario.model, worlds, &settings, None, &Silent)?;
    Ok(Run {
        seed,
        seconds: clock.elapsed().as_secs_f64(),
        earned: earned(scenario, &learned.automaton),
        automaton: learned.automaton,
        samples: learned.samples,
        converged: learned.converged,
        network: None,
    })
}

fn run_arkaq(
    scenario: &Scenario,
    worlds: &Worlds<'_>,
    settings: &arkaq::Settings,
    seed: u64,
) -> Run {
    let clock = Instant::now();
    let settings = arkaq::Settings {
        seed,
        ..settings.clone()
    };
    let learned = arkaq::learn(&scenario.model, worlds, &settings, None, &Silent).unwrap();
    let rewarded = || {
        learned
            .learning
            .clusters
            .iter()
            .map(|cluster| cluster.rewarded)
    };
    let goal_apart = rewarded().all(|x| x == 0.0 || x == 1.0) && rewarded().any(|x| x == 1.0);
    Run {
        seed,
        seconds: clock.elapsed().as_secs_f64(),
        earned: earned(scenario, &learned.automaton),
        samples: learned.samples,
        converged: learned.converged,
        network: Some(Network {
            vigilance: learned.learning.vigilance,
            clusters: learned.learning.clusters.len(),
            states: learned.learning.states,
            capped: learned.learning.capped,
            goal_apart,
        }),
        automaton: learned.automaton,
    }
}

fn earned(scenario: &Scenario, automaton: &Automaton) -> Evaluation {
    let controller = AutomatonRunner::new(automaton);
    evaluate(
        scenario,
        &automaton.updater,
        &controller,
        EVALUATION,
        &Silent,
    )
}

/// The one who is told, and the nodes of the planner's automaton. For the pole, which no grid plans, it is the return of one who
/// never leaves the equilibrium and is paid 1 for every step.
fn baseline(scenario: &Scenario) -> (String, Evaluation, Option<usize>) {
    let model = &scenario.model;
    if model.state.len() > 2 {
        let steps = model.episode.length;
        let estimate = |mean: f64| Estimate { mean, stderr: 0.0 };
        let most = (1.0 - model.discount.powi(steps as i32)) / (1.0 - model.discount);
        let upright = Evaluation {
            episodes: 0,
            discounted: estimate(most),
            undiscounted: estimate(steps as f64),
            steps: estimate(steps as f64),
            failed: 0.0,
            lost: None,
        };
        return ("never out of equilibrium".to_owned(), upright, None);
    }
    let told = told(scenario);
    let request = Request::form(Form::Segments);
    let plan = plan(&ValueIteration::default(), &told.model, &request, &Silent).unwrap();
    let nodes = plan.automaton().map(|automaton| automaton.nodes.len());
    let planner = value_iteration::Settings::default();
    let first = baselines(scenario, &planner, EVALUATION, &Silent)
        .unwrap()
        .swap_remove(0);
    (first.who.to_owned(), first.earned, nodes)
}

/// Smallest, median and largest.
fn spread(runs: &[Run], of: impl Fn(&Run) -> f64) -> [f64; 3] {
    let mut values: Vec<f64> = runs.iter().map(of).collect();
    values.sort_by(f64::total_cmp);
    let middle = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
    [values[0], middle, values[values.len() - 1]]
}

fn show([low, middle, high]: [f64; 3], digits: usize) -> String {
    format!("{middle:.digits$} [{low:.digits$}, {high:.digits$}]")
}
