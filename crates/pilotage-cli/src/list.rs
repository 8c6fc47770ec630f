//! `pilotage list`

use std::io::Write;

use clap::Args;
use comfy_table::presets;
use comfy_table::{ContentArrangement, Table};
use pilotage::scenario;
use pilotage::solve::SolverKind;
use serde_json::json;

use crate::failure::Failure;

#[derive(Args)]
pub struct Arguments {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let models = scenario::names()
        .map(|name| scenario::find(name).map(|scenario| scenario.model))
        .collect::<Result<Vec<_>, _>>()?;
    let mut out = std::io::stdout().lock();
    if arguments.json {
        let problems: Vec<_> = models
            .iter()
            .map(|model| {
                let accepted: Vec<_> = SolverKind::ALL.iter().filter(|solver| solver.accepts(model).is_ok()).map(|solver| solver.name()).collect();
                json!({ "name": model.name, "about": model.about, "states": model.state_dim(), "actions": model.actions.len(), "solvers": accepted })
            })
            .collect();
        writeln!(
            out,
            "{}",
            json!({ "pilotage": env!("CARGO_PKG_VERSION"), "problems": problems })
        )?;
        return Ok(());
    }
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Dynamic);
    table.set_header(["problem", "states", "actions", "what it is"]);
    for model in &models {
        table.add_row([
            model.name.clone(),
            model.state_dim().to_string(),
            model.actions.len().to_string(),
            model.about.clone(),
        ]);
    }
    writeln!(out, "{}\n", table.trim_fmt())?;
    let solvers: Vec<_> = SolverKind::ALL.iter().map(|solver| solver.name()).collect();
    writeln!(out, "solvers: {}", solvers.join(", "))?;
    Ok(())
}
