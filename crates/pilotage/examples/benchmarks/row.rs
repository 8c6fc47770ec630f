//! One problem solved by one solver, in a process of its own, so that time and memory are its own.

use std::error::Error;
use std::path::Path;
use std::process::{Command, Output};

use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::{Estimate, Options};
use pilotage::solve::{Form, Registry, Request, solve};
use serde::{Deserialize, Serialize};

pub const SEED: u64 = 1;

/// What is to be measured.
#[derive(Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Task {
    /// A built-in model or a model file.
    pub problem: String,
    /// The first planner for it, unless one is named.
    pub solver: Option<String>,
    /// What the solver is told, by name and as in JSON.
    pub settings: Vec<(String, String)>,
    /// A decision tree, rather than what the solver gives unless it is told.
    pub tree: bool,
    /// The most nodes of the tree, where that is limited.
    pub most: Option<usize>,
    pub episodes: usize,
    pub seed: u64,
    /// Where the automaton is kept.
    pub keep: Option<String>,
}

impl Default for Task {
    fn default() -> Self {
        Self {
            problem: String::new(),
            solver: None,
            settings: Vec::new(),
            tree: false,
            most: None,
            episodes: 0,
            seed: SEED,
            keep: None,
        }
    }
}

/// Mean and standard error.
pub type Pair = (f64, f64);

/// What was measured of a policy.
#[derive(Serialize, Deserialize)]
pub struct Row {
    pub most: Option<usize>,
    pub nodes: Option<usize>,
    pub planned: Option<f64>,
    /// Where the model holds.
    pub assumed: Pair,
    /// In the world.
    pub earned: Pair,
    /// What the rule of thumb earns there, and how much less that is, over the same episodes.
    pub rule: Option<(Pair, Pair)>,
    pub solver: String,
    /// Steps of experience of a learner.
    pub samples: Option<u64>,
    /// Whether more of them would change nothing, where it was asked.
    #[serde(default)]
    pub converged: Option<bool>,
    /// Processor time of planning and compiling, all cores together.
    pub seconds: Option<f64>,
    pub mebibytes: Option<f64>,
    pub remarks: Vec<String>,
    /// The tree as nested conditions.
    pub conditions: String,
}

impl Task {
    /// Measures in a process of its own: this program with the task as its argument.
    pub fn measure_apart(&self) -> Result<Row, String> {
        let run = self.run_apart().map_err(|error| error.to_string())?;
        if !run.status.success() {
            return Err(String::from_utf8_lossy(&run.stderr).trim().to_owned());
        }
        serde_json::from_slice(&run.stdout).map_err(|error| error.to_string())
    }

    fn run_apart(&self) -> Result<Output, Box<dyn Error>> {
        let task = serde_json::to_string(self)?;
        eprintln!("{task}");
        let program = std::env::current_exe()?;
        Ok(Command::new(program).args(["--one", &task]).output()?)
    }

    /// Solves the problem, and runs what is found. No return may be lost by fewer nodes.
    pub fn measure(&self) -> Result<Row, Box<dyn Error>> {
        let mut scenario = scenario::find(&self.problem)?;
        let registry = Registry::builtin();
        let entry = match &self.solver {
            Some(name) => registry.find(name)?,
            None => registry.first_for(&scenario.model)?,
        };
        if entry.learns() {
            // What the rule of thumb earns is measured beside planners.
            scenario.rule = None;
        }
        let solver = entry.solver(&self.settings)?;
        let form = match self.tree {
            true => Form::Tree,
            false => solver.form(),
        };
        let request = Request {
            nodes: self.most,
            loss: form.has_size().then_some(0.0),
            seed: self.seed,
            ..Request::form(form)
        };
        let solution = solve(&solver, &scenario, &request, &Silent)?;
        let seconds = processor_time();
        let options = Options {
            episodes: self.episodes,
            seed: self.seed + 100,
        };
        let earned = solution.earned(&scenario, options, &Silent)?;
        let pair = |estimate: Estimate| (estimate.mean, estimate.stderr);
        let automaton = solution.automaton();
        if let (Some(path), Some(automaton)) = (&self.keep, automaton) {
            automaton.save(Path::new(path))?;
        }
        Ok(Row {
            most: self.most,
            nodes: solution.nodes(),
            planned: solution.planned_value,
            assumed: pair(earned.assumed.discounted),
            earned: pair(earned.world.discounted),
            rule: earned
                .rule
                .map(|rule| (pair(rule.earned.discounted), pair(rule.less))),
            solver: entry.name().to_owned(),
            samples: solution.samples,
            converged: Some(solution.converged),
            seconds,
            mebibytes: peak(),
            remarks: earned.remarks,
            conditions: automaton.map_or_else(String::new, |automaton| automaton.conditions()),
        })
    }
}

/// Heads of the columns of [`Row::line`].
pub const HEAD: &str = "| nodes at most | nodes | planner | planned | earned | rule of thumb | more than the rule | CPU seconds | MiB |\n|--:|--:|---|--:|--:|--:|--:|--:|--:|\n";

impl Row {
    /// What the output says of a promise that misses what is earned.
    pub fn of_promise(&self) -> Option<&str> {
        let mut remarks = self.remarks.iter();
        let of_promise = remarks.find(|remark| remark.starts_with("planned"));
        of_promise.map(String::as_str)
    }

    /// Itself in a table, with so many digits behind the point of returns.
    pub fn line(&self, digits: usize) -> String {
        let rule =
            |of: fn((Pair, Pair)) -> Pair| or_none(self.rule, |rule| estimate(of(rule), digits));
        let whole = |number: f64| format!("{number:.0}");
        format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} |\n",
            or_none(self.most, |most| most.to_string()),
            or_none(self.nodes, |nodes| nodes.to_string()),
            self.solver,
            or_none(self.planned, |planned| format!("{planned:.digits$}")),
            estimate(self.earned, digits),
            rule(|rule| rule.0),
            rule(|rule| rule.1),
            or_none(self.seconds, whole),
            or_none(self.mebibytes, whole),
        )
    }
}

/// Something in words, or a dash for nothing.
pub fn or_none<T>(some: Option<T>, say: impl FnOnce(T) -> String) -> String {
    some.map_or_else(|| "-".to_owned(), say)
}

/// Mean and standard error, with so many digits behind the point.
pub fn estimate((mean, stderr): Pair, digits: usize) -> String {
    format!("{mean:.digits$} ± {stderr:.digits$}")
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
