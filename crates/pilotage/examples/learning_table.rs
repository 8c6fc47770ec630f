//! Learners side by side on the thesis' worlds (chapters 3, 4 and 6): ARKAQ, ARKAQ with additions, KAFAQ, and KBVI, which is told
//! map and rewards. Medians over seeds, with smallest and largest.
//!
//! ```text
//! cargo run --release -p pilotage --example learning_table -- [PROBLEM or all] [SEEDS] [FOLDER]
//! ```
//!
//! Prints a Markdown table and writes every run to `FOLDER/learning-PROBLEM.json`, with seed and version.

#![allow(clippy::print_stdout, clippy::print_stderr, clippy::unwrap_used)]

use std::time::Instant;

use pilotage::model::{self, Model};
use pilotage::observe::Silent;
use pilotage::policy::{Automaton, Controller};
use pilotage::simulate::{Estimate, Evaluation, Options, evaluate};
use pilotage::solve::kbvi::closed;
use pilotage::solve::{Form, SolveSettings, SolverKind, arkaq, kafaq, solve, yardstick};
use pilotage::world::{ProblemWorld, World};
use serde_json::{Value, json};

const PROBLEMS: [&str; 6] = [
    "basic",
    "maze-4x4",
    "cart-load-unload",
    "stations-5x5",
    "shuttle",
    "cart-pole-sd",
];

/// How automata are evaluated, learned or planned.
const EVALUATION: Options = Options {
    episodes: 2_000,
    seed: 999,
};

const VIGILANCES: [f64; 7] = [0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9];

/// The best vigilance is the lowest that comes so near to the highest share, in %.
const CLOSE: f64 = 0.5;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let which = arguments.first().map_or("all", String::as_str);
    let seeds: u64 = arguments.get(1).map_or(20, |text| text.parse().unwrap());
    let folder = arguments.get(2).map_or(".", String::as_str);
    println!(
        "| problem | learner | nodes | steps of experience | share of the yardstick, % | converged | capped |"
    );
    println!("|---|---|---|---|---|---|---|");
    for name in PROBLEMS
        .into_iter()
        .filter(|name| which == "all" || which == *name)
    {
        let table = Table::new(&model::find(name).unwrap(), seeds);
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
    /// Of ARKAQ: vigilance, clusters before merging, whether there were too many, whether rewarded ones were apart.
    network: Option<(f64, usize, bool, bool)>,
    seconds: f64,
}

struct Table {
    problem: String,
    yardstick: (String, Evaluation, Option<usize>),
    rows: Vec<Row>,
}

impl Table {
    fn new(model: &Model, seeds: u64) -> Self {
        let mut table = Self {
            problem: model.name.clone(),
            yardstick: yardstick(model),
            rows: Vec::new(),
        };
        println!(
            "| {} | {} | {} | | {:.2} ± {:.2} = 100 | | |",
            table.problem,
            table.yardstick.0,
            table
                .yardstick
                .2
                .map_or_else(|| "-".to_owned(), |n| n.to_string()),
            table.yardstick.1.discounted.mean,
            table.yardstick.1.discounted.stderr,
        );
        let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(model)) };
        let learned: Result<Vec<Run>, _> = (1..=seeds)
            .map(|seed| run_kafaq(model, &worlds, seed))
            .collect();
        match learned {
            Ok(runs) => {
                table.add("KAFAQ".to_owned(), runs);
            }
            Err(error) => println!("| {} | KAFAQ | {error} |", table.problem),
        }
        let mut add = |learner: String, settings: &arkaq::Settings| {
            let runs = (1..=seeds).map(|seed| run_arkaq(model, &worlds, settings, seed));
            table.add(learner, runs.collect())
        };
        let plain = |vigilance: f64| arkaq::Settings {
            vigilances: vec![vigilance],
            ..arkaq::Settings::default()
        };
        let shares = VIGILANCES.map(|vigilance| {
            let learner = format!("ARKAQ, vigilance {vigilance}");
            (vigilance, add(learner, &plain(vigilance)))
        });
        let most = shares.iter().map(|share| share.1).fold(0.0, f64::max);
        let best = shares
            .iter()
            .find(|share| share.1 >= most - CLOSE)
            .unwrap()
            .0;
        let extended = arkaq::Settings::extended();
        let additions = [
            (
                "Q(lambda)",
                arkaq::Settings {
                    lambda: extended.lambda,
                    ..plain(best)
                },
            ),
            (
                "longer memory",
                arkaq::Settings {
                    before: extended.before,
                    past: extended.past,
                    action: extended.action,
                    ..plain(best)
                },
            ),
            (
                "merging",
                arkaq::Settings {
                    merge: true,
                    ..plain(best)
                },
            ),
            (
                "without memory",
                arkaq::Settings {
                    before: 0.0,
                    action: 0.0,
                    ..plain(best)
                },
            ),
        ];
        for (what, settings) in additions {
            add(format!("ARKAQ, vigilance {best}, {what}"), &settings);
        }
        let tuned = arkaq::Settings {
            vigilances: extended.vigilances.clone(),
            ..arkaq::Settings::default()
        };
        add("ARKAQ, tuned vigilance".to_owned(), &tuned);
        add("ARKAQ, all additions".to_owned(), &extended);
        table
    }

    /// Prints and keeps a row; returns its median share of the yardstick.
    fn add(&mut self, learner: String, runs: Vec<Run>) -> f64 {
        let best = self.yardstick.1.discounted.mean;
        let share = spread(&runs, |run| 100.0 * run.earned.discounted.mean / best);
        println!(
            "| {} | {learner} | {} | {} | {} | {} of {} | {} |",
            self.problem,
            show(spread(&runs, |run| run.automaton.nodes.len() as f64), 0),
            show(spread(&runs, |run| run.samples as f64), 0),
            show(share, 1),
            runs.iter().filter(|run| run.converged).count(),
            runs.len(),
            runs.iter()
                .filter(|run| run.network.is_some_and(|network| network.2))
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
            "yardstick": { "what": self.yardstick.0, "earned": self.yardstick.1, "nodes": self.yardstick.2 },
            "rows": rows.collect::<Vec<_>>(),
        })
    }
}

impl Run {
    fn json(&self) -> Value {
        let network = self.network.map(|(vigilance, clusters, capped, apart)| {
            json!({ "vigilance": vigilance, "clusters": clusters, "capped": capped, "goal_apart": apart })
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

fn run_kafaq(model: &Model, worlds: &kafaq::Worlds<'_>, seed: u64) -> pilotage::Result<Run> {
    let clock = Instant::now();
    let settings = kafaq::Settings {
        seed,
        ..kafaq::Settings::default()
    };
    let learned = kafaq::learn(model, worlds, &settings, None, &Silent)?;
    Ok(Run {
        seed,
        seconds: clock.elapsed().as_secs_f64(),
        earned: earned(model, &learned.automaton),
        automaton: learned.automaton,
        samples: learned.samples,
        converged: learned.converged,
        network: None,
    })
}

fn run_arkaq(
    model: &Model,
    worlds: &arkaq::Worlds<'_>,
    settings: &arkaq::Settings,
    seed: u64,
) -> Run {
    let clock = Instant::now();
    let settings = arkaq::Settings {
        seed,
        ..settings.clone()
    };
    let learned = arkaq::learn(model, worlds, &settings, None, &Silent).unwrap();
    // No cluster mixes rewarded beliefs with others.
    let rewarded = || learned.clusters.iter().map(|cluster| cluster.rewarded);
    let apart = rewarded().all(|x| x == 0.0 || x == 1.0) && rewarded().any(|x| x == 1.0);
    Run {
        seed,
        seconds: clock.elapsed().as_secs_f64(),
        earned: earned(model, &learned.automaton),
        samples: learned.samples,
        converged: learned.converged,
        network: Some((
            learned.vigilance,
            learned.clusters.len(),
            learned.capped,
            apart,
        )),
        automaton: learned.automaton,
    }
}

fn earned(model: &Model, automaton: &Automaton) -> Evaluation {
    let controller = Controller::new(automaton);
    evaluate(model, &automaton.filter, &controller, EVALUATION, &Silent)
}

/// The one who is told, and the nodes of the planner's automaton. For the pole, which no grid plans, it is the return of one who
/// never leaves the equilibrium and is paid 1 for every step.
fn yardstick(model: &Model) -> (String, Evaluation, Option<usize>) {
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
        };
        return ("never out of equilibrium".to_owned(), upright, None);
    }
    let settings = SolveSettings {
        form: Form::Segments,
        ..SolveSettings::default()
    };
    let told = yardstick::told(model);
    let plan = solve(SolverKind::KbviClosed, &told, &settings, &Silent).unwrap();
    let nodes = plan.automaton().map(|automaton| automaton.nodes.len());
    let planner = closed::Settings::default();
    let first = yardstick::yardsticks(model, &planner, EVALUATION, &Silent)
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
