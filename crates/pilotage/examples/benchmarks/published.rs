//! docs/benchmarks.md: problems that others publish numbers for.

use std::error::Error;

use pilotage::scenario;
use serde::Deserialize;

use crate::Page;
use crate::row::{HEAD, Row, SEED, Task, estimate};

/// Problems, and what is known of them from elsewhere.
const DATA: &str = include_str!("../../../../docs/data/benchmarks.toml");

pub const EPISODES: usize = 20_000;

#[derive(Deserialize)]
struct Data {
    problem: Vec<Problem>,
}

#[derive(Deserialize)]
pub struct Problem {
    pub name: String,
    /// Most nodes of its trees.
    pub nodes: Vec<usize>,
    /// Whether it is also solved for agents that are told their start.
    #[serde(default)]
    told: bool,
    /// Digits behind the point of what is earned.
    #[serde(default = "usual_digits")]
    pub digits: usize,
    #[serde(default)]
    published: Vec<Published>,
}

fn usual_digits() -> usize {
    3
}

#[derive(Deserialize)]
struct Published {
    who: String,
    value: String,
    source: String,
}

/// Those problems that are asked for.
pub fn problems(asked: &dyn Fn(&str) -> bool) -> Result<Vec<Problem>, Box<dyn Error>> {
    let data: Data = toml::from_str(DATA)?;
    let problems = data.problem.into_iter();
    Ok(problems.filter(|problem| asked(&problem.name)).collect())
}

pub fn page(asked: &dyn Fn(&str) -> bool) -> Page {
    let mut page = heading();
    for problem in problems(asked)? {
        page += &section(&problem)?;
    }
    Ok(page)
}

fn heading() -> String {
    format!(
        "# Benchmarks\n\n\
         Problems in which what is sensed depends on the place, or says yes or no, modes are hidden, or walls stop the way. *Planned* is what the first planner for \
         the problem promises; *earned* is the discounted return of its automaton, a decision tree, where the model holds, mean ± standard error over {EPISODES} \
         episodes; the rule of thumb is the one in the model file, on the same belief and in the same episodes. Time is processor time of planning and compiling, memory the most that was \
         held. Nothing was set but the most nodes, and that no return may be lost by fewer. Version {}, seed {SEED}; made by\n\n\
         ```sh\ncargo run --release -p pilotage --example benchmarks -- --out docs/benchmarks.md\n```\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// The tree of at most so many nodes for a problem, by whichever planner is the first for it.
pub fn measured(name: &str, most: Option<usize>, seed: u64) -> Result<Row, String> {
    let task = Task {
        problem: name.to_owned(),
        tree: true,
        most,
        episodes: EPISODES,
        seed,
        ..Task::default()
    };
    task.measure_apart()
}

fn section(problem: &Problem) -> Page {
    let model = scenario::find(&problem.name)?.model;
    let mut text = format!("\n## `{}`\n\n{}\n\n", problem.name, model.about);
    text += HEAD;
    for most in &problem.nodes {
        text += &measured(&problem.name, Some(*most), SEED)?.line(problem.digits);
    }
    if problem.told {
        let most = problem.nodes.iter().copied().max();
        let starts = 1..=model.start.len();
        let rows: Result<Vec<Row>, _> = starts
            .map(|start| measured(&format!("{}@{start}", problem.name), most, SEED))
            .collect();
        text += &told(&rows?, problem.digits);
    }
    if !problem.published.is_empty() {
        text += "\n| published | return | source |\n|---|--:|---|\n";
    }
    for Published { who, value, source } in &problem.published {
        text += &format!("| {who} | {value} | {source} |\n");
    }
    Ok(text)
}

/// What agents earn that are told their start, each with a plan of its own.
fn told(rows: &[Row], digits: usize) -> String {
    let count = rows.len() as f64;
    let mean = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let variance = mean(&|row| row.earned.1.powi(2)) / count;
    let earned = (mean(&|row| row.earned.0), variance.sqrt());
    let lines: String = rows.iter().map(|row| row.line(digits)).collect();
    format!(
        "\nTold which start it is, one after the other; on average {:.digits$} is planned and {} earned:\n\n{HEAD}{lines}",
        mean(&|row| row.planned.unwrap_or(f64::NAN)),
        estimate(earned, digits),
    )
}
