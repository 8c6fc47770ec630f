//! `pilotage solve`

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use pilotage::model::WallBelief;
use pilotage::policy::write_whole;
use pilotage::report::{returns_svg, values_svg};
use pilotage::scenario::{self, Scenario, Walls};
use pilotage::simulate::{Estimate, Evaluation as Earned};
use pilotage::solve::kbvi::formulas::{Formulas, IntegralFormula, RewardFormula, SpreadFormula};
use pilotage::solve::lqg::Weights;
use pilotage::solve::{Form, Solution, SolveSettings, SolverKind, solve};
use pilotage::solve::{arkaq, kafaq};
use serde_json::json;

use crate::failure::Failure;
use crate::options::{Evaluation, at_least_one, beside};
use crate::progress::Bars;
use crate::summary;

#[derive(Args)]
pub struct Arguments {
    /// Name of a built-in problem (see `pilotage list`), or a model file.
    problem: String,
    /// Solver to use (see `pilotage list`).
    #[arg(long, value_name = "SOLVER", default_value = "kbvi-closed")]
    with: String,
    /// Form of the policy: nearest, segments, or grid (the planner itself, not compiled).
    #[arg(long, value_name = "FORM", default_value = "nearest")]
    policy: String,
    /// Write the policy to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Measure what compiling the planner into an automaton cost, over the same episodes.
    #[arg(long)]
    value_lost: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    evaluation: Evaluation,
    #[command(flatten)]
    planner: Planner,
    #[command(flatten)]
    learner: Learner,
}

#[derive(Args)]
#[command(next_help_heading = "Learner settings")]
struct Learner {
    /// Keep the state of learning in this file, and go on from there if it exists.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Draw how learning went: FILE-returns.svg and FILE-values.svg.
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    /// A setting of the learner by name, such as lambda=0.5; may be given more than once.
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_and_value)]
    learn: Vec<(String, String)>,
}

fn key_and_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` is not KEY=VALUE, such as lambda=0.5"))?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
}

impl Learner {
    /// A learner's settings with those given by name; the seed is the run's.
    fn settings<S: Default>(
        &self,
        set: impl Fn(&mut S, &str, &str) -> pilotage::Result<()>,
    ) -> Result<S, Failure> {
        let mut settings = S::default();
        for (key, value) in &self.learn {
            if key == "seed" {
                return Err(Failure::Usage("the seed is set by --seed".to_owned()));
            }
            set(&mut settings, key, value)?;
        }
        Ok(settings)
    }

    /// Whether any of it was asked for.
    fn is_given(&self) -> bool {
        self.checkpoint.is_some() || self.curves.is_some() || !self.learn.is_empty()
    }

    /// Draws the curves that were asked for; returns their files.
    fn draw(&self, solution: &Solution) -> Result<Vec<PathBuf>, Failure> {
        let (Some(path), Some(learning), Some(automaton)) =
            (&self.curves, &solution.learning, solution.automaton())
        else {
            return Ok(Vec::new());
        };
        let pictures = [
            ("returns.svg", returns_svg(automaton, learning)?),
            ("values.svg", values_svg(automaton, learning)?),
        ];
        let mut files = Vec::new();
        for (suffix, picture) in pictures {
            let file = beside(path, suffix);
            write_whole(&file, picture.as_bytes())?;
            files.push(file);
        }
        Ok(files)
    }
}

#[derive(Args)]
#[command(next_help_heading = "Planner settings")]
struct Planner {
    /// Points of the grid along each variable.
    #[arg(long, value_name = "POINTS")]
    grid: Option<usize>,
    /// Most memory for the grid, MiB.
    #[arg(long, value_name = "MIB", default_value_t = SolveSettings::default().memory)]
    memory: u64,
    /// First horizon that kbvi tries.
    #[arg(long, value_name = "STEPS", default_value_t = *SolveSettings::default().horizons.start())]
    first_horizon: usize,
    /// Last horizon that kbvi tries.
    #[arg(long, value_name = "STEPS", default_value_t = *SolveSettings::default().horizons.end())]
    last_horizon: usize,
    /// Steps for which kbvi keeps an action once chosen.
    #[arg(long, value_name = "STEPS", default_value_t = 1, value_parser = at_least_one)]
    group: usize,
    /// Episodes a planner runs to see which beliefs its policy meets.
    #[arg(long, value_name = "EPISODES", value_parser = at_least_one)]
    runs: Option<usize>,
    /// Factor on the length of a policy search's simulations: less is faster, more is thorougher.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    effort: f64,
    /// kbvi looks less far ahead with every step of an episode.
    #[arg(long)]
    decreasing: bool,
    /// Formulas kbvi uses.
    #[arg(long, value_enum, default_value_t = Formula::Exact)]
    formulas: Formula,
    /// What a deviation of each state variable costs lqg, comma-separated; default: the model's own cost, or 1 at each limit.
    #[arg(long, value_name = "WEIGHTS", value_delimiter = ',')]
    state_weights: Option<Vec<f64>>,
    /// What each control costs lqg, comma-separated; default: the model's own cost, or 1 at the largest of an action.
    #[arg(long, value_name = "WEIGHTS", value_delimiter = ',')]
    control_weights: Option<Vec<f64>>,
}

/// Sets of formulas.
#[derive(Clone, Copy, ValueEnum)]
enum Formula {
    /// The corrected ones.
    Exact,
    /// Rewards as ramps, everything else corrected.
    Ramp,
    /// As printed in the thesis.
    Printed,
}

impl Formula {
    fn set(self) -> Formulas {
        match self {
            Self::Exact => Formulas::default(),
            Self::Ramp => Formulas {
                reward: RewardFormula::Ramp,
                ..Formulas::default()
            },
            Self::Printed => Formulas {
                reward: RewardFormula::Ramp,
                spread: SpreadFormula::Printed,
                integral: IntegralFormula::Printed,
            },
        }
    }
}

impl Arguments {
    fn settings(&self, solver: SolverKind) -> Result<SolveSettings, Failure> {
        Ok(SolveSettings {
            form: Form::parse(&self.policy)?,
            seed: self.evaluation.seed,
            points: self.planner.grid,
            memory: self.planner.memory,
            horizons: self.planner.first_horizon..=self.planner.last_horizon,
            runs: self.planner.runs,
            group: self.planner.group,
            effort: self.planner.effort,
            decreasing: self.planner.decreasing,
            formulas: self.planner.formulas.set(),
            weights: Weights {
                state: self.planner.state_weights.clone(),
                control: self.planner.control_weights.clone(),
            },
            kafaq: if solver == SolverKind::Arkaq {
                kafaq::Settings::default()
            } else {
                self.learner.settings(kafaq::Settings::set)?
            },
            arkaq: if solver == SolverKind::Arkaq {
                self.learner.settings(arkaq::Settings::set)?
            } else {
                arkaq::Settings::default()
            },
            checkpoint: self.learner.checkpoint.clone(),
        })
    }
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let solver = SolverKind::parse(&arguments.with)?;
    let settings = arguments.settings(solver)?;
    if arguments.out.is_some() && settings.form == Form::Grid {
        return Err(Failure::Usage(
            "a planner that is not compiled cannot be saved; choose --policy nearest or segments"
                .to_owned(),
        ));
    }
    if arguments.learner.is_given() && !solver.learns() {
        return Err(Failure::Usage(format!(
            "{} plans; --checkpoint, --curves and --learn are for learners, such as --with kafaq",
            solver.name()
        )));
    }
    let scenario = scenario::find(&arguments.problem)?;
    arguments.evaluation.start_threads()?;
    let bars = Bars::new(arguments.json);

    let clock = Instant::now();
    let solution = solve(solver, &scenario, &settings, &bars)?;
    let solve_seconds = clock.elapsed().as_secs_f64();
    if let (Some(path), Some(automaton)) = (&arguments.out, solution.automaton()) {
        automaton.save(path)?;
    }
    let curves = arguments.learner.draw(&solution)?;
    let clock = Instant::now();
    let earned = solution.evaluate(&scenario, arguments.evaluation.options(), &bars)?;
    let seconds = (solve_seconds, clock.elapsed().as_secs_f64());
    let lost = arguments
        .value_lost
        .then(|| value_lost(arguments, solver, &scenario, &settings, &solution, &bars))
        .transpose()?;

    let mut out = std::io::stdout().lock();
    if arguments.json {
        let mut report = report(arguments, &scenario, solver, &solution, &earned, seconds);
        if let Some(lost) = lost {
            report["value_lost"] = json!(lost);
        }
        writeln!(out, "{report}")?;
    } else {
        write!(
            out,
            "{}",
            shown(arguments, &scenario, solver, &solution, &earned, seconds)
        )?;
        if let Some(lost) = lost {
            writeln!(
                out,
                "  lost in compiling    {} (the planner's return less the automaton's, same episodes)",
                summary::estimate(&lost)
            )?;
        }
        for file in curves {
            writeln!(out, "  {}", file.display())?;
        }
    }
    Ok(())
}

/// Solves again without compiling, and compares.
fn value_lost(
    arguments: &Arguments,
    solver: SolverKind,
    scenario: &Scenario,
    settings: &SolveSettings,
    solution: &Solution,
    bars: &Bars,
) -> Result<Estimate, Failure> {
    let uncompiled = SolveSettings {
        form: Form::Grid,
        ..settings.clone()
    };
    let planner = solve(solver, scenario, &uncompiled, bars)?;
    let options = arguments.evaluation.options();
    solution
        .value_lost(&planner, scenario, options, bars)
        .ok_or_else(|| Failure::Usage("--value-lost compares an automaton with the planner it was compiled from; choose --policy nearest or segments".to_owned()))
}

fn report(
    arguments: &Arguments,
    scenario: &Scenario,
    solver: SolverKind,
    solution: &Solution,
    earned: &Earned,
    (solve, evaluate): (f64, f64),
) -> serde_json::Value {
    json!({
        "pilotage": env!("CARGO_PKG_VERSION"),
        "problem": scenario.model.name,
        "solver": solver.name(),
        "policy": solution.automaton().map_or(json!(arguments.policy), |automaton| json!(automaton.matching)),
        "seed": arguments.evaluation.seed,
        "converged": solution.converged,
        "policy_convergence_horizon": solution.policy_convergence_horizon,
        "levels": solution.levels,
        "nodes": solution.automaton().map(|automaton| automaton.nodes.len()),
        "planned_value": solution.planned_value,
        "samples": solution.samples,
        "evaluation": earned,
        "seconds": { "solve": solve, "evaluate": evaluate },
    })
}

fn shown(
    arguments: &Arguments,
    scenario: &Scenario,
    solver: SolverKind,
    solution: &Solution,
    earned: &Earned,
    (solve, evaluate): (f64, f64),
) -> String {
    let nodes = solution.automaton().map(|automaton| automaton.nodes.len());
    let mut lines = vec![summary::heading(&scenario.model.name, solver.name(), nodes)];
    lines.extend(solution.automaton().map(summary::nodes));
    lines.push(String::new());
    lines.push(summary::evaluation(earned, solution.planned_value));
    if scenario.truth.walls == Walls::Clamp && scenario.model.belief.walls == WallBelief::Ignore {
        lines.push("  the filter does not know of the walls, so the plan expects another return than is earned".to_owned());
    }
    if let Some(horizon) = solution.policy_convergence_horizon {
        lines.push(format!("  policy convergence horizon {horizon}"));
    }
    if let (Some(learning), Some(samples)) = (&solution.learning, solution.samples) {
        lines.push(format!(
            "  learned in {samples} steps, with {}",
            learning.describe()
        ));
    }
    if !solution.converged {
        lines.push("  not converged: the policy still changes with more work; see --help for what can be raised".to_owned());
    }
    lines.push(format!(
        "  {solve:.2} s to solve, {evaluate:.2} s to evaluate, seed {}",
        arguments.evaluation.seed
    ));
    if let Some(path) = &arguments.out {
        lines.push(format!(
            "  kept in {0}; `pilotage draw {0}` draws it",
            path.display()
        ));
    }
    lines.push(String::new());
    lines.join("\n")
}
