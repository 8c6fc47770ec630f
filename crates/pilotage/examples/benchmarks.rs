//! Makes docs/benchmarks.md: what plans on beliefs in full promise and earn, on problems that others publish numbers for.
//!
//! ```sh
//! cargo run --release -p pilotage --example benchmarks -- --out docs/benchmarks.md [PROBLEM ...]
//! ```
//!
//! Every problem is solved in a process of its own, so that time and memory are its own.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::process::Command;
use std::time::Instant;

use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::Options;
use pilotage::solve::{Form, Registry, Request, solve};
use serde::{Deserialize, Serialize};

/// Problems, and what is known of them from elsewhere.
const DATA: &str = include_str!("../../../docs/data/benchmarks.toml");

/// Episodes by which everything is measured.
const EPISODES: usize = 20_000;

const SEED: u64 = 1;

#[derive(Deserialize)]
struct Data {
    problem: Vec<Problem>,
}

#[derive(Deserialize)]
struct Problem {
    name: String,
    nodes: Vec<usize>,
    #[serde(default)]
    published: Vec<Published>,
}

#[derive(Deserialize)]
struct Published {
    who: String,
    value: String,
    source: String,
}

/// What was measured of an automaton.
#[derive(Serialize, Deserialize)]
struct Row {
    most: usize,
    nodes: usize,
    planned: f64,
    earned: (f64, f64),
    rule: Option<(f64, f64)>,
    solver: String,
    seconds: f64,
    mebibytes: Option<f64>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let data: Data = toml::from_str(DATA)?;
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [flag, name, most] = arguments.as_slice()
        && flag == "--one"
    {
        println!("{}", serde_json::to_string(&measure(name, most.parse()?)?)?);
        return Ok(());
    }
    let out = match arguments.iter().position(|argument| argument == "--out") {
        Some(place) if place + 1 < arguments.len() => {
            arguments.remove(place);
            Some(arguments.remove(place))
        }
        _ => None,
    };
    let asked = |problem: &&Problem| arguments.is_empty() || arguments.contains(&problem.name);
    let mut page = heading();
    for problem in data.problem.iter().filter(asked) {
        page += &section(problem)?;
    }
    match out {
        Some(path) => std::fs::write(path, page)?,
        None => println!("{page}"),
    }
    Ok(())
}

fn heading() -> String {
    format!(
        "# Benchmarks\n\n\
         Problems in which what is sensed depends on the place, or says yes or no. *Planned* is what the plan promises; *earned* is the discounted \
         return of its automaton where the model holds, mean ± standard error over {EPISODES} episodes; the rule of thumb is the one in the model file, on the \
         same belief. Time is that of one run with every core it got, memory the most that it held. Version {}, seed {SEED}; made by\n\n\
         ```sh\ncargo run --release -p pilotage --example benchmarks -- --out docs/benchmarks.md\n```\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// Measures a problem in processes of its own.
fn section(problem: &Problem) -> Result<String, Box<dyn Error>> {
    let about = scenario::find(&problem.name)?.model.about;
    let mut text = format!("\n## `{}`\n\n{about}\n\n", problem.name);
    text += "| nodes at most | nodes | planned | earned | rule of thumb | seconds | MiB |\n|--:|--:|--:|--:|--:|--:|--:|\n";
    for most in &problem.nodes {
        eprintln!("{}, at most {most} nodes", problem.name);
        let program = std::env::current_exe()?;
        let most = most.to_string();
        let run = Command::new(program)
            .args(["--one", &problem.name, &most])
            .output()?;
        if !run.status.success() {
            return Err(
                format!("{}: {}", problem.name, String::from_utf8_lossy(&run.stderr)).into(),
            );
        }
        let row: Row = serde_json::from_slice(&run.stdout)?;
        let estimate = |(mean, stderr): (f64, f64)| format!("{mean:.3} ± {stderr:.3}");
        text += &format!(
            "| {} | {} | {:.3} | {} | {} | {:.0} | {} |\n",
            row.most,
            row.nodes,
            row.planned,
            estimate(row.earned),
            row.rule.map_or_else(|| "-".to_owned(), estimate),
            row.seconds,
            row.mebibytes
                .map_or_else(|| "-".to_owned(), |size| format!("{size:.0}")),
        );
    }
    if !problem.published.is_empty() {
        text += "\n| published | return | source |\n|---|--:|---|\n";
    }
    for Published { who, value, source } in &problem.published {
        text += &format!("| {who} | {value} | {source} |\n");
    }
    Ok(text)
}

/// Solves a problem with the first planner for it, and runs what it found.
fn measure(name: &str, most: usize) -> Result<Row, Box<dyn Error>> {
    let scenario = scenario::find(name)?;
    let entry = *Registry::builtin().first_for(&scenario.model)?;
    let request = Request {
        nodes: Some(most),
        seed: SEED,
        ..Request::form(Form::Tree)
    };
    let clock = Instant::now();
    let solution = solve(&entry.solver(&[])?, &scenario, &request, &Silent)?;
    let seconds = clock.elapsed().as_secs_f64();
    let options = Options {
        episodes: EPISODES,
        seed: SEED + 100,
    };
    let earned = solution.earned(&scenario, options, &Silent)?;
    let pair = |estimate: pilotage::simulate::Estimate| (estimate.mean, estimate.stderr);
    Ok(Row {
        most,
        nodes: solution
            .automaton()
            .map_or(0, |automaton| automaton.nodes.len()),
        planned: solution.planned_value.unwrap_or(f64::NAN),
        earned: pair(earned.assumed.discounted),
        rule: earned.rule.map(|rule| pair(rule.discounted)),
        solver: entry.name().to_owned(),
        seconds,
        mebibytes: peak(),
    })
}

/// The most memory that this process has held, where the system says so.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes / 1024.0)
}
