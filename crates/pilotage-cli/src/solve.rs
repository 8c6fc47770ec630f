//! `pilotage solve`

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use pilotage::policy::{check_writable, write_whole};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Estimate;
use pilotage::solve::kbvi::formulas::{Formulas, IntegralFormula, RewardFormula, SpreadFormula};
use pilotage::solve::kbvi::quadratic::MOST_EFFORT;
use pilotage::solve::lqg::Weights;
use pilotage::solve::{Earned, Form, Solution, SolveSettings, SolverKind, solve};
use pilotage::solve::{arkaq, kafaq};
use pilotage_report::{returns_svg, values_svg};
use serde_json::json;

use crate::failure::Failure;
use crate::learner_help::learner_settings;
use crate::options::{Evaluation, at_least_one, beside, quoted, shown as shown_path};
use crate::progress::Bars;
use crate::summary;

#[derive(Args)]
#[command(after_help = learner_settings())]
pub struct Arguments {
    /// Name of a built-in problem (see `pilotage list`), or a model file.
    problem: PathBuf,
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

/// What the files of the curves end in.
const CURVES: [&str; 2] = ["returns.svg", "values.svg"];

#[derive(Args)]
#[command(next_help_heading = "Learner settings")]
struct Learner {
    /// Keep the state of learning in this file, and go on from there if it exists.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Draw how learning went: FILE-returns.svg and FILE-values.svg.
    #[arg(long, value_name = "FILE")]
    curves: Option<PathBuf>,
    /// A setting of the learner by name, such as lambda=0.5; may be given more than once. Listed below.
    #[arg(long, value_name = "KEY=VALUE", value_parser = key_and_value)]
    learn: Vec<(String, String)>,
}

fn factor(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(factor) if factor > 0.0 && factor <= MOST_EFFORT => Ok(factor),
        Ok(_) => Err(format!("must be above 0, at most {MOST_EFFORT}")),
        Err(error) => Err(format!("{error}")),
    }
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
            returns_svg(automaton, learning)?,
            values_svg(automaton, learning)?,
        ];
        let mut files = Vec::new();
        for (suffix, picture) in CURVES.into_iter().zip(pictures) {
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
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = factor)]
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
    /// Files that cannot be written are known before work is done that they should keep.
    fn check_files(&self) -> Result<(), Failure> {
        let curves = self.learner.curves.iter();
        let curves = curves.flat_map(|path| CURVES.map(|suffix| beside(path, suffix)));
        for path in self.out.clone().into_iter().chain(curves) {
            check_writable(&path)?;
        }
        Ok(())
    }

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
    arguments.check_files()?;
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
    let earned = solution.earned(&scenario, arguments.evaluation.options(), &bars)?;
    earned.check()?;
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
            writeln!(out, "  {}", shown_path(&file))?;
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
        "evaluation_assumed": earned.assumed,
        "evaluation": earned.world,
        "upper_bound": serde_json::Value::Null,
        "remarks": earned.remarks,
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
    lines.push(summary::earned(
        earned,
        solution.planned_value,
        scenario.is_as_assumed(),
    ));
    lines.extend(
        earned
            .remarks
            .iter()
            .map(|remark| format!("  remark: {remark}")),
    );
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
    if let (Some(path), Some(_)) = (&arguments.out, solution.automaton()) {
        // A policy names its problem, which is enough to find a built-in one.
        let problem = match arguments.problem.to_str().and_then(scenario::builtin) {
            Some(_) => String::new(),
            None => format!(" --problem {}", quoted(&arguments.problem)),
        };
        lines.push(format!(
            "  kept in {}; `pilotage draw {}{problem}` draws it",
            shown_path(path),
            quoted(path)
        ));
    }
    lines.push(String::new());
    lines.join("\n")
}
