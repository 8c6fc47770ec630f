//! docs/learners.md: what planners promise, what they earn, and what learners do that are told nothing.

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

/// What became of a solver: what was measured, or why it refused.
type Outcome = Result<Row, String>;

/// A problem, and what became of the planner and of every learner.
struct Line {
    name: &'static str,
    planner: Outcome,
    learners: Vec<(&'static str, Outcome)>,
}

pub fn page(asked: &dyn Fn(&str) -> bool) -> Page {
    let registry = Registry::builtin();
    let learners = registry.entries().iter().filter(|entry| entry.learns());
    let learners: Vec<&'static str> = learners.map(|entry| entry.name()).collect();
    let names: Vec<&'static str> = scenario::names().filter(|name| asked(name)).collect();
    let solvers: Vec<Option<&'static str>> = std::iter::once(None)
        .chain(learners.iter().copied().map(Some))
        .collect();
    let tasks: Vec<Task> = names
        .iter()
        .flat_map(|name| solvers.iter().map(move |solver| (name, solver)))
        .map(|(name, solver)| Task {
            problem: (*name).to_owned(),
            solver: solver.map(str::to_owned),
            episodes: EPISODES,
            ..Task::default()
        })
        .collect();
    let outcomes: Vec<Outcome> = tasks.par_iter().map(Task::measure_apart).collect();
    let mut outcomes = outcomes.into_iter();
    let mut outcome = || outcomes.next().unwrap_or_else(|| Err("lost".to_owned()));
    let lines: Vec<Line> = names
        .into_iter()
        .map(|name| Line {
            name,
            planner: outcome(),
            learners: learners
                .iter()
                .map(|learner| (*learner, outcome()))
                .collect(),
        })
        .collect();
    Ok(heading(&learners) + &table(&lines, &learners) + &verdicts(&lines))
}

fn heading(learners: &[&str]) -> String {
    format!(
        "# Planners and learners\n\n\
         Every built-in problem, solved as `pilotage solve NAME` does by the first planner for it, and with `--with` {} by learners, which are told neither map nor rewards; of trees no return was to be lost by fewer nodes. *Planned* is what the \
         planner promises and *where it holds* what it earns where its model does, *earned* what is earned in the world of the problem: discounted returns, mean ± standard error over {EPISODES} episodes. Steps are those of experience, in thousands. \
         Version {}, seed {SEED}; made by\n\n\
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
        text += &match &line.planner {
            Ok(row) => format!(
                " {} | {} | {} | {} | {} |",
                row.solver,
                nodes(row),
                or_none(row.planned, |planned| format!("{planned:.DIGITS$}")),
                estimate(row.assumed, DIGITS),
                estimate(row.earned, DIGITS)
            ),
            Err(_) => " - | - | - | - | - |".to_owned(),
        };
        for (_, learner) in &line.learners {
            text += &match learner {
                Ok(row) => format!(
                    " {} | {} | {} |",
                    estimate(row.earned, DIGITS),
                    nodes(row),
                    or_none(row.samples, |steps| (steps / 1000).to_string())
                ),
                Err(_) => " - | - | - |".to_owned(),
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
    let row = line.planner.as_ref().ok()?;
    let (planned, (earned, stderr)) = (row.planned?, row.assumed);
    let allowed = ERRORS * stderr + SHARE * earned.abs();
    let misses = (planned - earned).abs() > allowed;
    misses.then(|| {
        let said = row
            .remarks
            .iter()
            .find(|remark| remark.starts_with("planned"));
        let said = said.map_or("nothing is said of it", String::as_str);
        format!("`{}`: {said}.", line.name)
    })
}

/// The learners that earn more in the problem's world.
fn beaten(line: &Line) -> Vec<String> {
    let Ok(planner) = &line.planner else {
        return Vec::new();
    };
    let more = |learner: Pair| {
        let more = learner.0 - planner.earned.0;
        let stderr = learner.1.hypot(planner.earned.1);
        (more > ERRORS * stderr).then_some((more, stderr))
    };
    let said = |(name, outcome): &(&str, Outcome)| {
        let more = more(outcome.as_ref().ok()?.earned)?;
        Some(format!(
            "`{}`: {name}, by {}.",
            line.name,
            estimate(more, DIGITS)
        ))
    };
    line.learners.iter().filter_map(said).collect()
}

fn refused(line: &Line) -> Vec<String> {
    let outcomes = line.learners.iter().map(|(name, outcome)| (*name, outcome));
    std::iter::once(("the planner", &line.planner))
        .chain(outcomes)
        .filter_map(|(name, outcome)| {
            let error = outcome.as_ref().err()?;
            Some(format!("`{}`, {name}: {error}", line.name))
        })
        .collect()
}
