//! What was measured, as a page of Markdown.

use std::fmt::Write as _;

use pilotage::simulate::Evaluation;
use pilotage_thesis::baseline::Baseline;

use super::run::{Pole, Run};
use super::{EVALUATION, Measured, POLE};

/// Median, least and greatest.
fn spread(values: impl Iterator<Item = f64>, digits: usize) -> String {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let [Some(least), Some(greatest)] = [values.first(), values.last()] else {
        return String::new();
    };
    let middle = 0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2]);
    if least == greatest {
        return format!("{middle:.digits$}");
    }
    format!("{middle:.digits$} ({least:.digits$} to {greatest:.digits$})")
}

fn thousands(samples: u64) -> f64 {
    samples as f64 / 1e3
}

/// The whole page.
pub fn page(measured: &[Measured], poles: &[Pole], seeds: u64) -> String {
    let mut text = format!(
        "# KAFAQ-learning, measured\n\nMade by `cargo run --release -p pilotage-thesis --example kafaq_table -- all {seeds} docs` with pilotage {}. \
         Medians over seeds 1 to {seeds} with the least and the greatest; every automaton is evaluated over {} episodes (seed {}). Each run is in \
         [data/kafaq.json](data/kafaq.json). The learner sees actions, observations and rewards, and knows A, B, H, Q, R and the outer bounds.\n",
        env!("CARGO_PKG_VERSION"),
        EVALUATION.episodes,
        EVALUATION.seed
    );
    if !measured.is_empty() {
        text += &learning(measured);
        text += &baselines(measured);
    }
    if measured.iter().any(|one| one.runs[0].on_robot.is_some()) {
        text += &robot(measured);
    }
    if !poles.is_empty() {
        text += &pole(poles);
    }
    text
}

fn learning(measured: &[Measured]) -> String {
    let mut text = "\n## Returns and regions\n\nThe yardstick is closed-loop KBVI, which is told map and rewards; for stations-5x5 that of the best single \
         pair, for shuttle one who also knows which way it faces. Closed components are parts of the automaton that are not left again, ways out that a node takes less than once in a hundred times not counted.\n\n\
         | problem | regions | closed components | discounted return | % of yardstick | undiscounted, % of yardstick | converged | thousand steps | seconds |\n\
         |---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for one in measured {
        let baseline = &one.baselines[0].earned;
        let of = |value: fn(&Run) -> f64, digits| spread(one.runs.iter().map(value), digits);
        let share = |value: fn(&Evaluation) -> f64| {
            let runs = one.runs.iter();
            spread(
                runs.map(|run| 100.0 * value(&run.earned) / value(baseline)),
                1,
            )
        };
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {} of {} | {} | {} |",
            one.model.name,
            of(|run| run.learned.automaton.nodes.len() as f64, 0),
            of(|run| run.components as f64, 0),
            of(|run| run.earned.discounted.mean, 2),
            share(|earned| earned.discounted.mean),
            share(|earned| earned.undiscounted.mean),
            one.runs.iter().filter(|run| run.learned.converged).count(),
            one.runs.len(),
            of(|run| thousands(run.learned.samples), 0),
            of(|run| run.seconds, 2),
        );
    }
    text
}

fn baselines(measured: &[Measured]) -> String {
    let mut text =
        "\nWhat others earn, mean ± standard error:\n\n| problem | who | discounted return | a step |\n|---|---|---|---|\n".to_owned();
    for one in measured {
        for Baseline { who: what, earned } in &one.baselines {
            let _ = writeln!(
                text,
                "| {} | {what} | {:.2} ± {:.2} | {:.3} ± {:.3} |",
                one.model.name,
                earned.discounted.mean,
                earned.discounted.stderr,
                earned.undiscounted.mean / earned.steps.mean,
                earned.undiscounted.stderr / earned.steps.mean
            );
        }
    }
    text
}

fn robot(measured: &[Measured]) -> String {
    let mut text = "\n## On the robot\n\nThe automata of the first table, unchanged, in the worlds of robot-basic, robot-maze-4x4 and robot-cart-load-unload: two \
         wheels that slip, a compass, four range finders as noisy as the learner assumes.\n\n\
         | problem | discounted return on the robot | % of that in the learning world | undiscounted, % |\n|---|---|---|---|\n"
        .to_owned();
    for one in measured {
        let pairs: Vec<(&Evaluation, &Evaluation)> = one
            .runs
            .iter()
            .filter_map(|run| Some((run.on_robot.as_ref()?, &run.earned)))
            .collect();
        if pairs.is_empty() {
            continue;
        }
        let share = |value: fn(&Evaluation) -> f64| {
            let shares = pairs.iter();
            spread(
                shares.map(|(here, there)| 100.0 * value(here) / value(there)),
                1,
            )
        };
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} |",
            one.model.name,
            spread(pairs.iter().map(|(here, _)| here.discounted.mean), 2),
            share(|earned| earned.discounted.mean),
            share(|earned| earned.undiscounted.mean)
        );
    }
    text
}

fn pole(poles: &[Pole]) -> String {
    let unfailing = poles.iter().filter(|pole| pole.failures == 0).count();
    let first = poles
        .iter()
        .take(10)
        .filter(|pole| pole.failures == 0)
        .count();
    let of = |value: fn(&Pole) -> f64, digits| spread(poles.iter().map(value), digits);
    format!(
        "\n## The pole\n\n{POLE}: 750,000 steps of balancing for every seed, more than the thesis' four hours of 720,000. Regions lie along the two modes of the \
         motion that do not die out by themselves, the fall and the drift. The thesis reports 162 regions.\n\n\
         | seeds without a failure | of the first ten | regions | failures | converged | thousand steps | seconds |\n|---|---|---|---|---|---|---|\n\
         | {unfailing} of {} | {first} of {} | {} | {} | {} | {} | {} |\n",
        poles.len(),
        poles.len().min(10),
        of(|pole| pole.learned.automaton.nodes.len() as f64, 0),
        of(|pole| pole.failures as f64, 0),
        poles.iter().filter(|pole| pole.learned.converged).count(),
        of(|pole| thousands(pole.learned.samples), 0),
        of(|pole| pole.seconds, 2),
    )
}
