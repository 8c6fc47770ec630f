//! `pilotage check`

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use pilotage::Error;
use pilotage::belief::BeliefMdp;
use pilotage::model::{Model, TrackerKind};
use pilotage::policy;
use pilotage::scenario;
use pilotage::solve::Registry;
use serde_json::json;

use crate::failure::Failure;

#[derive(Args)]
pub struct Arguments {
    /// A model file, or the name of a built-in problem.
    #[arg(required_unless_present_any = ["schema", "policy_schema"])]
    file: Option<PathBuf>,
    /// Print the JSON schema of model files instead.
    #[arg(long, conflicts_with = "file")]
    schema: bool,
    /// Print the JSON schema of policy files instead.
    #[arg(long, conflicts_with_all = ["file", "schema"])]
    policy_schema: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    let Some(file) = &arguments.file else {
        let schema = match arguments.policy_schema {
            true => policy::schema(),
            false => scenario::schema(),
        };
        writeln!(out, "{:#}", schema.as_value())?;
        return Ok(());
    };
    let model = scenario::find(file)?.model;
    let registry = Registry::builtin();
    let levels = Levels::of(&model)?;
    if arguments.json {
        let report = json!({
            "pilotage": env!("CARGO_PKG_VERSION"),
            "problem": model.name,
            "states": model.state.iter().map(|variable| &variable.name).collect::<Vec<_>>(),
            "actions": model.actions.iter().map(|action| &action.name).collect::<Vec<_>>(),
            "modes": model.modes,
            "discount": model.discount,
            "tracker": model.tracker(),
            "levels": levels.as_ref().map(|levels| levels.count),
            "start_deviation": levels.as_ref().map(|levels| &levels.start),
            "steady_deviation": levels.as_ref().and_then(|levels| levels.steady.as_ref()),
            "solvers": registry.entries().iter().filter(|solver| solver.accepts(&model).is_ok()).map(|solver| solver.name()).collect::<Vec<_>>(),
        });
        writeln!(out, "{report}")?;
        return Ok(());
    }
    let names = |names: Vec<&str>| names.join(", ");
    let deviations = |values: &[f64]| {
        values
            .iter()
            .map(|value| format!("{value:.4}"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    writeln!(out, "{}: {}", model.name, model.about)?;
    writeln!(
        out,
        "  states    {}",
        names(
            model
                .state
                .iter()
                .map(|variable| variable.name.as_str())
                .collect()
        )
    )?;
    writeln!(
        out,
        "  actions   {}",
        names(
            model
                .actions
                .iter()
                .map(|action| action.name.as_str())
                .collect()
        )
    )?;
    if model.modes.len() > 1 {
        writeln!(
            out,
            "  modes     {}",
            names(model.modes.iter().map(String::as_str).collect())
        )?;
    }
    writeln!(out, "  discount  {}", model.discount)?;
    let sensors =
        std::iter::once(&model.sensor).chain(model.later.iter().map(|phase| &phase.sensor));
    let present: Vec<f64> = sensors.map(|sensor| sensor.present).collect();
    if present.iter().any(|present| *present < 1.0) {
        let present = present.iter().map(f64::to_string).collect::<Vec<_>>();
        writeln!(
            out,
            "  readings  come with probability {}",
            present.join(", later ")
        )?;
    }
    if model.clock() > 0 {
        writeln!(
            out,
            "  clock     it matters which step of an episode it is, up to step {}",
            model.clock()
        )?;
    }
    writeln!(out, "  belief    {}", belief(&model))?;
    if let Some(levels) = levels {
        let cut = match levels.converged {
            true => "",
            false => " (cut at the limit)",
        };
        writeln!(out, "  levels    {}{cut}", levels.count)?;
        let start = deviations(&levels.start);
        writeln!(out, "  deviation {start} at the start")?;
        if let Some(steady) = levels.steady {
            writeln!(
                out,
                "            {} in the steady state",
                deviations(&steady)
            )?;
        }
    }
    // Solvers that refuse for the same reason are named together.
    let mut refusals: Vec<(Vec<&str>, String)> = Vec::new();
    for solver in registry.entries() {
        let reason = match solver.accepts(&model) {
            Ok(()) => {
                writeln!(out, "  {:<15} can solve it", solver.name())?;
                continue;
            }
            Err(Error::Unsupported { reason, .. }) => reason,
            Err(error) => error.to_string(),
        };
        match refusals.iter_mut().find(|(_, known)| *known == reason) {
            Some((solvers, _)) => solvers.push(solver.name()),
            None => refusals.push((vec![solver.name()], reason)),
        }
    }
    for (solvers, reason) in refusals {
        writeln!(out, "  {:<15} cannot: {reason}", solvers.join(", "))?;
    }
    Ok(())
}

/// Uncertainty levels, and standard deviations at them.
struct Levels {
    count: usize,
    converged: bool,
    start: Vec<f64>,
    steady: Option<Vec<f64>>,
}

impl Levels {
    /// Those of a linear model.
    fn of(model: &Model) -> Result<Option<Self>, Error> {
        if !model.is_linear() {
            return Ok(None);
        }
        let mdp = BeliefMdp::new(model);
        let levels = mdp.levels();
        levels.check(model)?;
        let deviations = |level: usize| -> Vec<f64> {
            let covariance = levels.covariance(level);
            let variances = covariance.diagonal();
            variances.iter().map(|variance| variance.sqrt()).collect()
        };
        let start = levels.starts()[0];
        let steady = levels.steady(start, levels.class_of(0));
        Ok(Some(Self {
            count: levels.len(),
            converged: levels.converged(),
            start: deviations(start),
            steady: steady.map(deviations),
        }))
    }
}

/// What keeps the belief of a model, and why.
fn belief(model: &Model) -> String {
    let lost = model.beyond_levels().join(", ");
    let chosen = match (model.tracker(), model.belief.tracker) {
        (TrackerKind::Linear, _) if lost.is_empty() => "exact".to_owned(),
        (TrackerKind::Linear, _) => format!(
            "which loses something of {lost}; `tracker = \"sum\"` in [belief] keeps it, for codebook"
        ),
        (_, TrackerKind::Auto) => format!("because of {lost}"),
        _ => "as [belief] says".to_owned(),
    };
    let kind = match model.tracker() {
        TrackerKind::Cells => "probabilities of cells",
        TrackerKind::Sum => "a sum of weighted Gaussians",
        TrackerKind::Linear | TrackerKind::Auto => "one Gaussian on uncertainty levels",
    };
    format!("{kind}, {chosen}")
}
