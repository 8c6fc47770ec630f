//! docs/learners.md: what planners promise, what they earn, and what learners do that are told nothing.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::ErrorKind;
use std::sync::Mutex;

use pilotage::scenario;
use pilotage::solve::Registry;
use rayon::prelude::*;

use crate::Page;
use crate::row::{Pair, Row, SEED, Task, estimate, or_none};

const EPISODES: usize = 10_000;

const DIGITS: usize = 3;

/// Standard errors beyond which two returns differ.
const ERRORS: f64 = 3.0;

/// Share of a return by which a promise may miss it besides.
const SHARE: f64 = 0.02;

/// Most epochs of a learner where motion or sensor are not linear, and a step of the belief takes far longer: enough for
/// exploration to cool, and to be calm for as long as convergence asks.
const EPOCHS: usize = 30;

/// What became of a solver: what was measured, or why it refused.
type Outcome = Result<Row, String>;

/// By problem and solver; the planner is [`PLANNER`].
type Outcomes = BTreeMap<String, BTreeMap<String, Outcome>>;

/// Name of whichever planner is the first for a problem.
const PLANNER: &str = "planner";

/// What was measured so far.
const KEPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/data/learners.json");

/// A problem, and what became of the planner and of every learner.
struct Line<'a> {
    name: &'static str,
    planner: Option<&'a Outcome>,
    learners: Vec<(&'static str, Option<&'a Outcome>)>,
}

/// Measures the problems that are named, or what has not been measured yet, which can take hours, unless the page is to be of what is
/// `kept` alone; each outcome is kept at once.
pub fn page(named: &[String], kept: bool) -> Page {
    let registry = Registry::builtin();
    let learners = registry.entries().iter().filter(|entry| entry.learns());
    let learners: Vec<&'static str> = learners.map(|entry| entry.name()).collect();
    let mut outcomes = known()?;
    if !kept {
        let tasks = tasks(named, &learners, &outcomes);
        outcomes = measured(&tasks, outcomes)?;
    }
    let line = |name: &'static str| Line {
        name,
        planner: outcome(&outcomes, name, PLANNER),
        learners: learners
            .iter()
            .map(|learner| (*learner, outcome(&outcomes, name, learner)))
            .collect(),
    };
    let lines: Vec<Line> = scenario::names().map(line).collect();
    Ok(heading(&learners) + &table(&lines, &learners) + &verdicts(&lines))
}

/// What was measured before; nothing where there is no file yet.
fn known() -> Result<Outcomes, Box<dyn Error>> {
    match std::fs::read_to_string(KEPT) {
        Ok(text) => Ok(serde_json::from_str(&text)?),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Outcomes::new()),
        Err(error) => Err(error.into()),
    }
}

/// Problems with who is to solve them: those that are named, or all that are not known.
fn tasks(
    named: &[String],
    learners: &[&'static str],
    known: &Outcomes,
) -> Vec<(&'static str, &'static str)> {
    let wanted = |name: &str, solver: &str| match named.is_empty() {
        true => outcome(known, name, solver).is_none(),
        false => named.iter().any(|other| other == name),
    };
    // A page without planners says little, and of learners the first takes longest.
    let solvers = [PLANNER].into_iter().chain(learners.iter().rev().copied());
    solvers
        .flat_map(|solver| scenario::names().map(move |name| (name, solver)))
        .filter(|(name, solver)| wanted(name, solver))
        .collect()
}

/// What is known, and what these tasks add to it; all is kept after each.
fn measured(tasks: &[(&str, &str)], known: Outcomes) -> Result<Outcomes, Box<dyn Error>> {
    let outcomes = Mutex::new(known);
    let measured = tasks.iter().par_bridge().map(|(name, solver)| {
        let learns = *solver != PLANNER;
        let is_linear = scenario::find(name).is_ok_and(|found| found.model.is_linear());
        let epochs = ("epoch_limit".to_owned(), EPOCHS.to_string());
        let task = Task {
            problem: (*name).to_owned(),
            solver: learns.then(|| (*solver).to_owned()),
            settings: match learns && !is_linear {
                true => vec![epochs],
                false => Vec::new(),
            },
            episodes: EPISODES,
            ..Task::default()
        };
        let found = task.measure_apart();
        // Who refuses says why.
        if found.as_ref().is_err_and(String::is_empty) {
            return Err(format!("{name}, {solver}: stopped"));
        }
        let mut all = outcomes.lock().map_err(|error| error.to_string())?;
        let of_problem = all.entry((*name).to_owned()).or_default();
        of_problem.insert((*solver).to_owned(), found);
        let text = serde_json::to_string_pretty(&*all).map_err(|error| error.to_string())?;
        std::fs::write(KEPT, text + "\n").map_err(|error| error.to_string())
    });
    measured.collect::<Result<Vec<()>, String>>()?;
    Ok(outcomes.into_inner()?)
}

fn outcome<'a>(outcomes: &'a Outcomes, name: &str, solver: &str) -> Option<&'a Outcome> {
    outcomes.get(name)?.get(solver)
}

fn heading(learners: &[&str]) -> String {
    format!(
        "# Planners and learners\n\n\
         Every built-in problem, solved as `pilotage solve NAME` does by the first planner for it, and with `--with` {} by learners, which are told neither map nor rewards; of trees no return was to be lost by fewer nodes. *Planned* is what the \
         planner promises and *where it holds* what it earns where its model does, *earned* what is earned in the world of the problem: discounted returns, mean ± standard error over {EPISODES} episodes. Steps are those of experience, in thousands. \
         Version {}, seed {SEED}; made from [data/learners.json](data/learners.json), in which all was kept as it was measured, by\n\n\
         ```sh\ncargo run --release -p pilotage --example benchmarks -- --learners --out docs/learners.md\n```\n\n",
        learners
            .iter()
            .map(|name| format!("`{name}`"))
            .collect::<Vec<_>>()
            .join(" and "),
        env!("CARGO_PKG_VERSION")
    )
}

fn table(lines: &[Line], learners: &[&str]) -> String {
    let mut text = "| problem | planner | nodes | planned | where it holds | earned |".to_owned();
    for learner in learners {
        text += &format!(" {learner} earned | nodes | steps |");
    }
    text += "\n|---|---|--:|--:|--:|--:|";
    text += &"--:|--:|--:|".repeat(learners.len());
    for line in lines {
        text += &format!("\n| `{}` |", line.name);
        text += &match line.planner {
            Some(Ok(row)) => format!(
                " {} | {} | {} | {} | {} |",
                row.solver,
                nodes(row),
                or_none(row.planned, |planned| format!("{planned:.DIGITS$}")),
                estimate(row.assumed, DIGITS),
                estimate(row.earned, DIGITS)
            ),
            _ => " - | - | - | - | - |".to_owned(),
        };
        for (_, learner) in &line.learners {
            text += &match learner {
                Some(Ok(row)) => format!(
                    " {} | {} | {} |",
                    estimate(row.earned, DIGITS),
                    nodes(row),
                    or_none(row.samples, |steps| {
                        let more = if row.converged == Some(false) {
                            "+"
                        } else {
                            ""
                        };
                        format!("{}{more}", steps / 1000)
                    })
                ),
                _ => " - | - | - |".to_owned(),
            };
        }
    }
    text + "\n"
}

fn nodes(row: &Row) -> String {
    or_none(row.nodes, |nodes| nodes.to_string())
}

/// What the table says of the two claims that are made of planners, and who refused what.
fn verdicts(lines: &[Line]) -> String {
    let promises: Vec<String> = lines.iter().filter_map(missed).collect();
    let beaten: Vec<String> = lines.iter().flat_map(beaten).collect();
    let refused: Vec<String> = lines.iter().flat_map(refused).collect();
    let missing: Vec<String> = lines.iter().flat_map(missing).collect();
    let share = 100.0 * SHARE;
    section(
        &format!(
            "Promises that miss what is earned where they hold by more than {ERRORS} standard errors and {share} %"
        ),
        &promises,
    ) + &section(
        &format!("Learners that earn more than the planner by more than {ERRORS} standard errors"),
        &beaten,
    ) + &section("Refused", &refused)
        + &section("Not measured yet", &missing)
}

fn section(heading: &str, points: &[String]) -> String {
    let text: String = points.iter().map(|point| format!("- {point}\n")).collect();
    match text.is_empty() {
        true => format!("\n## {heading}\n\nNone.\n"),
        false => format!("\n## {heading}\n\n{text}"),
    }
}

/// The promise, if it misses what is earned where it should hold, and what the output says of it.
fn missed(line: &Line) -> Option<String> {
    let row = line.planner?.as_ref().ok()?;
    let (planned, (earned, stderr)) = (row.planned?, row.assumed);
    let allowed = ERRORS * stderr + SHARE * earned.abs();
    let misses = (planned - earned).abs() > allowed;
    misses.then(|| {
        let said = row.of_promise().unwrap_or("nothing is said of it");
        format!("`{}`: {said}.", line.name)
    })
}

/// The learners that earn more in the problem's world.
fn beaten(line: &Line) -> Vec<String> {
    let Some(Ok(planner)) = line.planner else {
        return Vec::new();
    };
    let more = |learner: Pair| {
        let more = learner.0 - planner.earned.0;
        let stderr = learner.1.hypot(planner.earned.1);
        (more > ERRORS * stderr).then_some((more, stderr))
    };
    let said = |(name, outcome): &(&str, Option<&Outcome>)| {
        let more = more((*outcome)?.as_ref().ok()?.earned)?;
        let world = match scenario::find(line.name).is_ok_and(|found| found.is_as_assumed()) {
            true => "",
            false => ", in a world that is not as the planner's model says",
        };
        let by = estimate(more, DIGITS);
        Some(format!("`{}`: {name}, by {by}{world}.", line.name))
    };
    line.learners.iter().filter_map(said).collect()
}

fn refused(line: &Line) -> Vec<String> {
    let said = |(name, outcome): (&str, Option<&Outcome>)| {
        let error = outcome?.as_ref().err()?;
        Some(format!("`{}`, {name}: {error}.", line.name))
    };
    all(line).filter_map(said).collect()
}

fn missing(line: &Line) -> Vec<String> {
    let not_yet = all(line).filter(|(_, outcome)| outcome.is_none());
    not_yet
        .map(|(name, _)| format!("`{}`, {name}.", line.name))
        .collect()
}

fn all<'a>(line: &Line<'a>) -> impl Iterator<Item = (&'static str, Option<&'a Outcome>)> {
    let planner = std::iter::once((PLANNER, line.planner));
    planner.chain(line.learners.clone())
}
