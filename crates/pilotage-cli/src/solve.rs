//! `pilotage solve`

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use pilotage::policy::{check_writable, write_whole};
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::Estimate;
use pilotage::solve::bound;
use pilotage::solve::{Earned, Entry, Form, Registry, Request, Solution, Solved, Solver, solve};
use pilotage_report::{returns_svg, values_svg};
use serde_json::json;

use crate::failure::Failure;
use crate::options::{Evaluation, at_least_one, beside, quoted, shown as shown_path};
use crate::progress::Bars;
use crate::settings_help::settings_of_solvers;
use crate::summary;

#[derive(Args)]
#[command(after_help = settings_of_solvers())]
pub struct Arguments {
    /// Name of a built-in problem (see `pilotage list`), or a model file; with @2 after it, the agent is told that it begins at its second
    /// start.
    problem: PathBuf,
    /// Solver to use (see `pilotage list`); default: the first planner that accepts the problem.
    #[arg(long, value_name = "SOLVER")]
    with: Option<String>,
    /// Form of the policy: tree, nearest, segments, graph (which needs no belief, for discrete sensors), or grid (the planner itself, not
    /// compiled); default: what suits the solver.
    #[arg(long, value_name = "FORM")]
    policy: Option<String>,
    /// Most nodes of a tree or graph; default: as many as it takes.
    #[arg(long, value_name = "NODES", value_parser = at_least_one)]
    nodes: Option<usize>,
    /// Return that a tree or graph may lose, as a share of that of the plan [default: 0.01].
    #[arg(long, value_name = "SHARE")]
    loss: Option<f64>,
    /// Write the policy to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Measure what compiling the planner into an automaton or graph cost, over the same episodes.
    #[arg(long)]
    value_lost: bool,
    /// Find an upper bound on what any policy can earn where the model holds.
    #[arg(long)]
    bound: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    evaluation: Evaluation,
    #[command(flatten)]
    told: Told,
    #[command(flatten)]
    learner: Learner,
}

fn key_and_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text
        .split_once('=')
        .ok_or_else(|| format!("`{text}` is not KEY=VALUE, such as lambda=0.5"))?;
    Ok((key.trim().to_owned(), value.trim().to_owned()))
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
}

impl Learner {
    /// Whether any of it was asked for.
    fn is_given(&self) -> bool {
        self.checkpoint.is_some() || self.curves.is_some()
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
#[command(next_help_heading = "Solver settings")]
struct Told {
    /// A setting of the solver by name, such as points=401; may be given more than once. All are listed below.
    #[arg(long, visible_alias = "learn", value_name = "KEY=VALUE", value_parser = key_and_value)]
    set: Vec<(String, String)>,
    /// Episodes run to see which beliefs a policy meets.
    #[arg(long, value_name = "EPISODES", value_parser = at_least_one)]
    runs: Option<usize>,
    /// Points of a grid along each variable.
    #[arg(long, value_name = "POINTS")]
    grid: Option<usize>,
    /// Most memory for a grid, MiB.
    #[arg(long, value_name = "MIB")]
    memory: Option<u64>,
    /// First horizon that kbvi tries.
    #[arg(long, value_name = "STEPS")]
    first_horizon: Option<usize>,
    /// Last horizon that kbvi tries.
    #[arg(long, value_name = "STEPS")]
    last_horizon: Option<usize>,
    /// Steps for which kbvi keeps an action once chosen.
    #[arg(long, value_name = "STEPS", value_parser = at_least_one)]
    group: Option<usize>,
    /// Factor on the length of a policy search's simulations: less is faster, more is thorougher.
    #[arg(long, value_name = "FACTOR")]
    effort: Option<f64>,
    /// kbvi looks less far ahead with every step of an episode.
    #[arg(long)]
    decreasing: bool,
    /// Formulas kbvi uses.
    #[arg(long, value_enum)]
    formulas: Option<Formula>,
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
    fn settings(self) -> [(&'static str, &'static str); 3] {
        let (reward, others) = match self {
            Self::Exact => ("exact", "exact"),
            Self::Ramp => ("ramp", "exact"),
            Self::Printed => ("ramp", "printed"),
        };
        [
            ("reward_formula", reward),
            ("spread_formula", others),
            ("integral_formula", others),
        ]
    }
}

impl Arguments {
    /// Files that cannot be written are known before work is done that they should keep.
    fn check_files(&self) -> Result<(), Failure> {
        let curves = self.learner.curves.iter();
        let curves = curves.flat_map(|path| CURVES.map(|suffix| beside(path, suffix)));
        let others = [&self.out, &self.learner.checkpoint].into_iter().flatten();
        for path in others.cloned().chain(curves) {
            check_writable(&path)?;
        }
        Ok(())
    }
}

impl Told {
    /// Options that are settings of some solvers: option, setting and value.
    fn options(&self) -> Vec<(&'static str, &'static str, String)> {
        let number = |option, setting, value: Option<usize>| {
            value.map(|value| (option, setting, value.to_string()))
        };
        let list = |option, setting, value: &Option<Vec<f64>>| {
            value
                .as_ref()
                .map(|value| (option, setting, format!("{value:?}")))
        };
        let memory = self
            .memory
            .map(|mib| ("--memory", "memory", mib.to_string()));
        let effort = self
            .effort
            .map(|factor| ("--effort", "effort", format!("{factor:?}")));
        let decreasing = self
            .decreasing
            .then(|| ("--decreasing", "decreasing", "true".to_owned()));
        let formulas = self.formulas.into_iter().flat_map(Formula::settings);
        [
            number("--grid", "points", self.grid),
            memory,
            number("--first-horizon", "first_horizon", self.first_horizon),
            number("--last-horizon", "last_horizon", self.last_horizon),
            number("--group", "group", self.group),
            effort,
            decreasing,
            list("--state-weights", "state_weights", &self.state_weights),
            list(
                "--control-weights",
                "control_weights",
                &self.control_weights,
            ),
        ]
        .into_iter()
        .flatten()
        .chain(formulas.map(|(setting, word)| ("--formulas", setting, word.to_owned())))
        .collect()
    }

    /// The solver with the settings given, and the episodes to compile with where it does not count its own.
    fn solver(&self, registry: &Registry, entry: &Entry) -> Result<(Solver, usize), Failure> {
        let has =
            |entry: &Entry, setting: &str| entry.settings().iter().any(|info| info.name == setting);
        let mut settings = Vec::new();
        for (option, setting, value) in self.options() {
            if !has(entry, setting) {
                return Err(without(registry, entry, option, setting));
            }
            settings.push((setting.to_owned(), value));
        }
        let mut runs = Request::default().runs;
        match self.runs {
            Some(asked) if has(entry, "runs") => {
                settings.push(("runs".to_owned(), asked.to_string()));
            }
            asked => runs = asked.unwrap_or(runs),
        }
        for (setting, value) in &self.set {
            if setting == "seed" {
                return Err(Failure::Usage("the seed is set by --seed".to_owned()));
            }
            let others = registry.entries();
            if !has(entry, setting) && others.iter().any(|other| has(other, setting)) {
                return Err(without(registry, entry, setting, setting));
            }
            settings.push((setting.clone(), value.clone()));
        }
        let solver = entry.solver(&settings);
        Ok((solver.map_err(|error| self.as_written(error))?, runs))
    }

    /// What is wrong with a setting, said of the option that gave it where one did.
    fn as_written(&self, error: pilotage::Error) -> Failure {
        let (setting, value, wrong) = match &error {
            pilotage::Error::Setting {
                setting,
                value,
                range,
            } => (*setting, value, format!("is out of range: {range}")),
            pilotage::Error::NoValue {
                setting,
                value,
                about,
            } => (
                setting.as_str(),
                value,
                format!("is no value of it: {about}"),
            ),
            _ => return error.into(),
        };
        let by_name = self.set.iter().any(|(name, _)| name == setting);
        let given = self.options().into_iter();
        let mut given = given.filter(|(_, name, _)| *name == setting && !by_name);
        match given.next() {
            Some((option, ..)) => Failure::Usage(format!("{option} {value} {wrong}")),
            None => error.into(),
        }
    }
}

/// Something that another solver can be told, and not this one.
fn without(registry: &Registry, entry: &Entry, what: &str, setting: &str) -> Failure {
    let names = |entry: &Entry| -> Vec<String> {
        let settings = entry.settings().into_iter();
        settings.map(|info| info.name).collect()
    };
    let others = registry.entries().iter();
    let others = others.filter(|other| names(other).iter().any(|name| name == setting));
    let others: Vec<String> = others
        .map(|other| format!("--with {}", other.name()))
        .collect();
    Failure::Usage(format!(
        "{what} is for {}; {} has the settings `{}`",
        others.join(" or "),
        entry.name(),
        names(entry).join("`, `")
    ))
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let registry = Registry::builtin();
    let named = arguments.with.as_deref();
    let named = named.map(|name| registry.find(name)).transpose()?;
    let asked = arguments.policy.as_deref().map(Form::parse).transpose()?;
    if arguments.out.is_some() && asked == Some(Form::Grid) {
        return Err(Failure::Usage(
            "a planner that is not compiled cannot be saved; choose another --policy".to_owned(),
        ));
    }
    let scenario = scenario::find(&arguments.problem)?;
    let entry = match named {
        Some(entry) => entry,
        None => registry.first_for(&scenario.model)?,
    };
    if arguments.learner.is_given() && !entry.learns() {
        return Err(Failure::Usage(format!(
            "{} plans; --checkpoint and --curves are for learners, such as --with kafaq",
            entry.name()
        )));
    }
    let (solver, runs) = arguments.told.solver(&registry, entry)?;
    let solver = &solver;
    let form = asked.unwrap_or_else(|| solver.form());
    if !form.has_size() && (arguments.nodes.is_some() || arguments.loss.is_some()) {
        return Err(Failure::Usage(
            "--nodes and --loss say how small a tree or graph is; choose --policy tree or graph"
                .to_owned(),
        ));
    }
    if arguments.out.is_some() && !solver.makes_automaton(&scenario.model) {
        return Err(Failure::Usage(format!(
            "{} finds a free control for {}, which is no automaton and cannot be saved; leave out --out",
            solver.name(),
            scenario.model.name
        )));
    }
    solver.gives(form, &scenario.model)?;
    let request = Request {
        form,
        seed: arguments.evaluation.seed,
        runs,
        nodes: arguments.nodes,
        loss: arguments.loss,
        checkpoint: arguments.learner.checkpoint.clone(),
    };
    arguments.check_files()?;
    arguments.evaluation.start_threads()?;
    let bars = Bars::new(arguments.json);

    let clock = Instant::now();
    let solution = solve(solver, &scenario, &request, &bars)?;
    let solve_seconds = clock.elapsed().as_secs_f64();
    // What was found is shown all the same where it cannot be kept: it may have taken hours.
    let kept = match (&arguments.out, &solution.policy) {
        (Some(path), Solved::Automaton(automaton)) => automaton.save(path).map(|()| true),
        (Some(path), Solved::Graph(graph)) => graph.save(path).map(|()| true),
        _ => Ok(false),
    };
    let curves = arguments.learner.draw(&solution)?;
    let clock = Instant::now();
    let mut earned = solution.earned(&scenario, arguments.evaluation.options(), &bars)?;
    earned.check()?;
    let seconds = (solve_seconds, clock.elapsed().as_secs_f64());
    let lost = arguments
        .value_lost
        .then(|| value_lost(arguments, solver, &scenario, &request, &solution, &bars))
        .transpose()?;

    let bound = arguments.bound.then(|| {
        let settings = bound::Settings::default();
        bound::bound(&scenario.model, &settings, &bars)
    });
    if let Some(Err(error)) = &bound {
        earned.remarks.push(format!("no upper bound: {error}"));
    }
    let bound = bound.and_then(Result::ok);

    let mut out = std::io::stdout().lock();
    if arguments.json {
        let mut report = report(arguments, &scenario, solver, &solution, &earned, seconds);
        if let Some(bound) = &bound {
            report["upper_bound"] = json!({ "mean": bound.mean, "stderr": bound.stderr });
        }
        if let Some(lost) = lost {
            report["value_lost"] = json!(lost);
        }
        writeln!(out, "{report}")?;
    } else {
        let kept = kept.as_ref().is_ok_and(|kept| *kept);
        let shown = shown(
            arguments, &scenario, solver, &solution, &earned, kept, seconds,
        );
        write!(out, "{shown}")?;
        if let Some(bound) = &bound {
            writeln!(
                out,
                "{}",
                summary::bound(bound, earned.assumed.discounted.mean)
            )?;
        }
        if let Some(lost) = lost {
            writeln!(
                out,
                "  lost in compiling    {} (the planner's return less that of the {}, same episodes)",
                summary::estimate(&lost),
                if solution.graph().is_some() {
                    "graph"
                } else {
                    "automaton"
                }
            )?;
        }
        for file in curves {
            writeln!(out, "  {}", shown_path(&file))?;
        }
    }
    kept?;
    Ok(())
}

/// Solves again without compiling, and compares.
fn value_lost(
    arguments: &Arguments,
    solver: &Solver,
    scenario: &Scenario,
    request: &Request,
    solution: &Solution,
    bars: &Bars,
) -> Result<Estimate, Failure> {
    let uncompiled = Request {
        form: Form::Grid,
        nodes: None,
        loss: None,
        ..request.clone()
    };
    let planner = solve(solver, scenario, &uncompiled, bars)?;
    let options = arguments.evaluation.options();
    solution
        .value_lost(&planner, scenario, options, bars)
        .ok_or_else(|| Failure::Usage("--value-lost compares an automaton or graph with the planner it was made from; choose --policy tree, nearest, segments or graph".to_owned()))
}

/// The form that a policy has.
fn form(solution: &Solution) -> serde_json::Value {
    match &solution.policy {
        Solved::Automaton(automaton) => json!(automaton.matching),
        Solved::Graph(_) => json!(Form::Graph.name()),
        Solved::Control(_) | Solved::Rule { .. } => json!(Form::Grid.name()),
    }
}

fn report(
    arguments: &Arguments,
    scenario: &Scenario,
    solver: &Solver,
    solution: &Solution,
    earned: &Earned,
    (solve, evaluate): (f64, f64),
) -> serde_json::Value {
    json!({
        "pilotage": env!("CARGO_PKG_VERSION"),
        "problem": scenario.model.name,
        "solver": solver.name(),
        "policy": form(solution),
        "seed": arguments.evaluation.seed,
        "converged": solution.converged,
        "policy_convergence_horizon": solution.policy_convergence_horizon,
        "levels": solution.levels,
        "nodes": solution.nodes(),
        "planned_value": solution.planned_value,
        "samples": solution.samples,
        "evaluation_assumed": earned.assumed,
        "evaluation": earned.world,
        "rule_of_thumb": earned.rule,
        "upper_bound": serde_json::Value::Null,
        "remarks": earned.remarks,
        "seconds": { "solve": solve, "evaluate": evaluate },
    })
}

fn shown(
    arguments: &Arguments,
    scenario: &Scenario,
    solver: &Solver,
    solution: &Solution,
    earned: &Earned,
    kept: bool,
    (solve, evaluate): (f64, f64),
) -> String {
    let mut lines = vec![summary::heading(
        &scenario.model.name,
        solver.name(),
        solution.nodes(),
    )];
    lines.extend(solution.automaton().map(summary::nodes));
    lines.extend(solution.graph().map(summary::graph));
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
            learning.found
        ));
    }
    if !solution.converged {
        lines.push("  not converged: the policy still changes with more work; see --help for what can be raised".to_owned());
    }
    lines.push(format!(
        "  {solve:.2} s to solve, {evaluate:.2} s to evaluate, seed {}",
        arguments.evaluation.seed
    ));
    if let (Some(path), true) = (&arguments.out, kept) {
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
