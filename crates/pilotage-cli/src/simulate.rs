//! `pilotage simulate`

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use pilotage::Error;
use pilotage::belief::BeliefMdp;
use pilotage::policy::{AutomatonRunner, GraphRunner, Saved};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::wake_up::{Settings, measure};
use pilotage::simulate::{Agent, evaluate, evaluate_agent};
use pilotage::solve::Form;
use serde_json::json;

use crate::failure::Failure;
use crate::options::{Evaluation, policy_and_problem, shown};
use crate::progress::Bars;
use crate::summary;

#[derive(Args)]
pub struct Arguments {
    /// Name of a built-in problem, or a model file; with @2 after it, the agent is told that it begins at its second start.
    problem: PathBuf,
    /// A policy file written by `pilotage solve --out`.
    #[arg(long)]
    policy: PathBuf,
    /// Act in the world of another model with the same actions and sensor, such as robot-basic for a policy of basic.
    #[arg(long, value_name = "PROBLEM", conflicts_with = "wake_up")]
    world: Option<PathBuf>,
    /// Carry the robot to one of its start places, tell it so, and let it find out which (models with several starts).
    #[arg(long)]
    wake_up: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    evaluation: Evaluation,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    arguments.evaluation.start_threads()?;
    let (policy, scenario) = policy_and_problem(&arguments.policy, Some(&arguments.problem))?;
    let bars = Bars::new(arguments.json);
    if arguments.wake_up {
        return wake_up(arguments, &scenario, &policy, &bars);
    }
    let world = match &arguments.world {
        None => scenario,
        Some(world) => {
            let world = scenario::find(world)?;
            policy.check_world(&world.model, &shown(&arguments.policy))?;
            world
        }
    };
    let clock = Instant::now();
    let options = arguments.evaluation.options();
    let evaluation = match &policy {
        Saved::Automaton(automaton) => {
            let runner = AutomatonRunner::new(automaton);
            evaluate(&world, &automaton.updater, &runner, options, &bars)
        }
        Saved::Graph(graph) => {
            let agent = || -> Box<dyn Agent> { Box::new(GraphRunner::new(graph)) };
            evaluate_agent(&world, &agent, options, &bars)
        }
    };
    evaluation.check()?;
    let seconds = clock.elapsed().as_secs_f64();
    let mut out = std::io::stdout().lock();
    if arguments.json {
        let mut report = identity(&policy, arguments.evaluation.seed);
        report["world"] = json!(world.model.name);
        report["planned_value"] = json!(policy.planned_value());
        report["evaluation"] = json!(evaluation);
        report["seconds"] = json!({ "evaluate": seconds });
        writeln!(out, "{report}")?;
    } else {
        writeln!(
            out,
            "{}",
            summary::heading(&world.model.name, policy.solver(), Some(policy.nodes()))
        )?;
        write!(
            out,
            "{}",
            summary::evaluation(&evaluation, policy.planned_value())
        )?;
    }
    Ok(())
}

fn wake_up(
    arguments: &Arguments,
    Scenario { model, truth, .. }: &Scenario,
    saved: &Saved,
    bars: &Bars,
) -> Result<(), Failure> {
    let refused = |why: &str| Error::Unsupported {
        solver: "wake-up",
        model: model.name.clone(),
        reason: format!(
            "its hypotheses are followed by filters, and this policy {why}; simulate it without --wake-up, or solve with value-iteration"
        ),
    };
    let automaton = match saved {
        Saved::Graph(_) => return Err(refused("keeps no belief").into()),
        Saved::Automaton(automaton) if automaton.updater.filter().is_none() => {
            let why = "keeps its belief in full, in which all starts are already";
            return Err(refused(why).into());
        }
        Saved::Automaton(automaton) => automaton,
    };
    let settings = Settings {
        episodes: arguments.evaluation.episodes,
        seed: arguments.evaluation.seed,
        ..Settings::default()
    };
    let clock = Instant::now();
    let policy = AutomatonRunner::new(automaton);
    let result = measure(&BeliefMdp::new(model), truth, &policy, &settings, bars)?;
    let mut out = std::io::stdout().lock();
    if arguments.json {
        let mut report = identity(saved, settings.seed);
        report["wake_up"] = json!(result);
        report["seconds"] = json!({ "evaluate": clock.elapsed().as_secs_f64() });
        writeln!(out, "{report}")?;
        return Ok(());
    }
    writeln!(
        out,
        "{}: {} kidnappings, at most {} steps each\n",
        model.name, result.episodes, model.episode.length
    )?;
    for (who, reached) in [
        ("woken up lost", &result.lost),
        ("told its start", &result.told),
    ] {
        writeln!(
            out,
            "  {who:<15} reached the goal {}, discounted return {}",
            summary::estimate(&reached.success),
            summary::estimate(&reached.discounted)
        )?;
    }
    writeln!(
        out,
        "  lost over told  {}\n",
        summary::estimate(&result.ratio)
    )?;
    writeln!(out, "  one hypothesis left after")?;
    for (steps, &count) in result
        .alone_after
        .iter()
        .enumerate()
        .filter(|&(_, &count)| count > 0)
    {
        writeln!(
            out,
            "  {steps:>6} steps  {:>6.2} %",
            share(count, result.episodes)
        )?;
    }
    writeln!(
        out,
        "         never  {:>6.2} %",
        share(result.never_alone, result.episodes)
    )?;
    Ok(())
}

/// What every report begins with.
fn identity(policy: &Saved, seed: u64) -> serde_json::Value {
    json!({
        "pilotage": env!("CARGO_PKG_VERSION"),
        "problem": policy.problem(),
        "solver": policy.solver(),
        "policy": match policy {
            Saved::Automaton(automaton) => json!(automaton.matching),
            Saved::Graph(_) => json!(Form::Graph.name()),
        },
        "seed": seed,
        "nodes": policy.nodes(),
    })
}

fn share(count: usize, of: usize) -> f64 {
    100.0 * count as f64 / of as f64
}
