//! Makes docs/benchmarks.md: what plans on beliefs in full promise and earn, on problems that others publish numbers for; or docs/gallery.md:
//! the same of problems that people have.
//!
//! ```sh
//! cargo run --release -p pilotage --example benchmarks -- --out docs/benchmarks.md [PROBLEM ...]
//! cargo run --release -p pilotage --example benchmarks -- --gallery target/gallery --out docs/gallery.md [PROBLEM ...]
//! ```
//!
//! The automata of the gallery are kept in the folder named; scripts/gallery.sh draws them too.
//!
//! Every problem is solved in a process of its own, so that time and memory are its own.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::path::Path;
use std::process::Command;

use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::Options;
use pilotage::solve::{Form, Registry, Request, solve};
use serde::{Deserialize, Serialize};

/// Problems, and what is known of them from elsewhere.
const DATA: &str = include_str!("../../../docs/data/benchmarks.toml");

/// Episodes by which everything is measured.
const EPISODES: usize = 20_000;

/// Episodes by which problems of the gallery are measured.
const GALLERY_EPISODES: usize = 10_000;

/// Most nodes of the automata of the gallery that are drawn, and of those that are written out.
const GALLERY_NODES: usize = 30;
const WRITTEN_OUT: usize = 12;

const SEED: u64 = 1;

#[derive(Deserialize)]
struct Data {
    problem: Vec<Problem>,
}

#[derive(Deserialize)]
struct Problem {
    name: String,
    nodes: Vec<usize>,
    /// Whether it is also solved for agents that are told their start.
    #[serde(default)]
    told: bool,
    /// Digits behind the point of what is earned.
    #[serde(default = "usual_digits")]
    digits: usize,
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

/// Mean and standard error of what a rule of thumb earns, and of how much less that is, over the same episodes.
type Beside = ((f64, f64), (f64, f64));

/// What was measured of an automaton.
#[derive(Serialize, Deserialize)]
struct Row {
    /// The most nodes that it may have, where that is limited.
    most: Option<usize>,
    nodes: usize,
    planned: f64,
    earned: (f64, f64),
    rule: Option<Beside>,
    solver: String,
    /// Processor time of planning and compiling, all cores together.
    seconds: Option<f64>,
    mebibytes: Option<f64>,
    remarks: Vec<String>,
    /// The tree as nested conditions.
    conditions: String,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(name) = value_of("--one", &mut arguments) {
        let most = value_of("--most", &mut arguments).map(|most| most.parse());
        let episodes = value_of("--episodes", &mut arguments).map(|episodes| episodes.parse());
        let keep = value_of("--keep", &mut arguments);
        let row = measure(
            &name,
            most.transpose()?,
            episodes.transpose()?.unwrap_or(EPISODES),
            keep.as_deref(),
        )?;
        println!("{}", serde_json::to_string(&row)?);
        return Ok(());
    }
    let out = value_of("--out", &mut arguments);
    let folder = value_of("--gallery", &mut arguments);
    let asked = |name: &str| arguments.is_empty() || arguments.iter().any(|other| other == name);
    let mut page;
    if let Some(folder) = folder {
        std::fs::create_dir_all(&folder)?;
        page = gallery_heading();
        for name in scenario::gallery_names().filter(|name| asked(name)) {
            page += &exhibit(name, &folder)?;
        }
    } else {
        let data: Data = toml::from_str(DATA)?;
        page = heading();
        for problem in data.problem.iter().filter(|problem| asked(&problem.name)) {
            page += &section(problem)?;
        }
    }
    match out {
        Some(path) => std::fs::write(path, page)?,
        None => println!("{page}"),
    }
    Ok(())
}

/// Takes a flag and its value out of the arguments.
fn value_of(flag: &str, arguments: &mut Vec<String>) -> Option<String> {
    let place = arguments.iter().position(|argument| argument == flag)?;
    if place + 1 >= arguments.len() {
        return None;
    }
    arguments.remove(place);
    Some(arguments.remove(place))
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

fn gallery_heading() -> String {
    format!(
        "# Gallery\n\n\
         Problems that people have, each a model file in [models/gallery](../models/gallery) with a rule of thumb that an engineer would write. Each is solved as \
         `pilotage solve NAME --loss 0` does, no return being lost by fewer nodes, and with `--nodes {GALLERY_NODES}` for an automaton to look at. *Earned* is the discounted return of the automaton where the model holds, mean ± standard error over {GALLERY_EPISODES} \
         episodes; the rule acts on the same belief in the same episodes, which is why *more than the rule* is known better than either. Where what was planned misses what is earned, the remark says why. Maps show what the \
         automaton does: the mean of the belief across and up, how sure it is in the panels. Version {}, seed {SEED}; made by\n\n\
         ```sh\nscripts/gallery.sh\n```\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// Measures a problem of the gallery, and keeps its small automaton in a folder.
fn exhibit(name: &str, folder: &str) -> Result<String, Box<dyn Error>> {
    let model = scenario::find(name)?.model;
    let kept = format!("{folder}/{name}.json");
    let small = in_its_own_process(name, Some(GALLERY_NODES), GALLERY_EPISODES, Some(&kept))?;
    let large = in_its_own_process(name, None, GALLERY_EPISODES, None)?;
    let mut text = format!(
        "\n## `{name}`\n\n{}\n\n![What the automaton of {name} does](gallery/{name}-map.svg)\n\n{HEAD}{}{}",
        model.about,
        small.line(usual_digits()),
        large.line(usual_digits())
    );
    for remark in &large.remarks {
        text += &format!("\nRemark: {remark}.\n");
    }
    if small.nodes <= WRITTEN_OUT {
        text += &format!("\n```text\n{}\n```\n", small.conditions.trim_end());
    }
    Ok(text)
}

/// Measures a problem in processes of its own.
fn section(problem: &Problem) -> Result<String, Box<dyn Error>> {
    let model = scenario::find(&problem.name)?.model;
    let mut text = format!("\n## `{}`\n\n{}\n\n", problem.name, model.about);
    text += HEAD;
    for most in &problem.nodes {
        text +=
            &in_its_own_process(&problem.name, Some(*most), EPISODES, None)?.line(problem.digits);
    }
    if problem.told {
        let most = problem.nodes.iter().copied().max();
        let starts = 1..=model.start.len();
        let rows: Result<Vec<Row>, _> = starts
            .map(|start| {
                in_its_own_process(&format!("{}@{start}", problem.name), most, EPISODES, None)
            })
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

/// Heads of the columns.
const HEAD: &str = "| nodes at most | nodes | planner | planned | earned | rule of thumb | more than the rule | CPU seconds | MiB |\n|--:|--:|---|--:|--:|--:|--:|--:|--:|\n";

/// What agents earn that are told their start, each with a plan of its own.
fn told(rows: &[Row], digits: usize) -> String {
    let count = rows.len() as f64;
    let mean = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>() / count;
    let variance = mean(&|row| row.earned.1.powi(2)) / count;
    let lines: String = rows.iter().map(|row| row.line(digits)).collect();
    format!(
        "\nTold which start it is, one after the other; on average {:.digits$} is planned and {:.digits$} ± {:.digits$} earned:\n\n{HEAD}{lines}",
        mean(&|row| row.planned),
        mean(&|row| row.earned.0),
        variance.sqrt(),
    )
}

/// Measures a problem in a process of its own, which keeps the automaton in a file where one is named.
fn in_its_own_process(
    name: &str,
    most: Option<usize>,
    episodes: usize,
    keep: Option<&str>,
) -> Result<Row, Box<dyn Error>> {
    let limit = most.map(|most| most.to_string());
    eprintln!(
        "{name}, {} nodes",
        limit.as_deref().unwrap_or("any number of")
    );
    let flags = [
        ("--one", Some(name)),
        ("--most", limit.as_deref()),
        ("--episodes", Some(&episodes.to_string())),
        ("--keep", keep),
    ];
    let given = flags
        .into_iter()
        .filter_map(|(flag, value)| Some([flag, value?]));
    let run = Command::new(std::env::current_exe()?)
        .args(given.flatten())
        .output()?;
    if !run.status.success() {
        return Err(format!("{name}: {}", String::from_utf8_lossy(&run.stderr)).into());
    }
    Ok(serde_json::from_slice(&run.stdout)?)
}

impl Row {
    fn line(&self, digits: usize) -> String {
        let estimate = |(mean, stderr): (f64, f64)| format!("{mean:.digits$} ± {stderr:.digits$}");
        let rule = |of: fn(Beside) -> (f64, f64)| match self.rule {
            Some(rule) => estimate(of(rule)),
            None => "-".to_owned(),
        };
        format!(
            "| {} | {} | {} | {:.digits$} | {} | {} | {} | {} | {} |\n",
            self.most
                .map_or_else(|| "-".to_owned(), |most| most.to_string()),
            self.nodes,
            self.solver,
            self.planned,
            estimate(self.earned),
            rule(|rule| rule.0),
            rule(|rule| rule.1),
            whole(self.seconds),
            whole(self.mebibytes),
        )
    }
}

fn whole(number: Option<f64>) -> String {
    number.map_or_else(|| "-".to_owned(), |number| format!("{number:.0}"))
}

/// Solves a problem with the first planner for it, and runs what it found. No return may be lost by fewer nodes.
fn measure(
    name: &str,
    most: Option<usize>,
    episodes: usize,
    keep: Option<&str>,
) -> Result<Row, Box<dyn Error>> {
    let scenario = scenario::find(name)?;
    let entry = *Registry::builtin().first_for(&scenario.model)?;
    let request = Request {
        nodes: most,
        loss: Some(0.0),
        seed: SEED,
        ..Request::form(Form::Tree)
    };
    let solution = solve(&entry.solver(&[])?, &scenario, &request, &Silent)?;
    let seconds = processor_time();
    let options = Options {
        episodes,
        seed: SEED + 100,
    };
    let earned = solution.earned(&scenario, options, &Silent)?;
    let pair = |estimate: pilotage::simulate::Estimate| (estimate.mean, estimate.stderr);
    let automaton = solution.automaton();
    if let (Some(path), Some(automaton)) = (keep, automaton) {
        automaton.save(Path::new(path))?;
    }
    Ok(Row {
        most,
        nodes: automaton.map_or(0, |automaton| automaton.nodes.len()),
        planned: solution.planned_value.unwrap_or(f64::NAN),
        earned: pair(earned.assumed.discounted),
        rule: earned
            .rule
            .map(|rule| (pair(rule.earned.discounted), pair(rule.less))),
        solver: entry.name().to_owned(),
        seconds,
        mebibytes: peak(),
        remarks: earned.remarks,
        conditions: automaton.map_or_else(String::new, |automaton| automaton.conditions()),
    })
}

/// Processor time of this process so far, where the system says so: user and system time, in hundredths of a second, are fields 14 and 15.
fn processor_time() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field, in brackets, may hold spaces.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(14)? + ticks(15)?) / 100.0)
}

/// The most memory that this process has held, where the system says so.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes / 1024.0)
}
