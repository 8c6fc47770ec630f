//! Every solver on the problems of one and two dimensions, as Markdown tables: `cargo run --release --example results > docs/results.md`.
#![allow(clippy::print_stdout)]

use pilotage::model::{self, Model};
use pilotage::observe::Silent;
use pilotage::simulate::{Estimate, Options};
use pilotage::solve::kbvi::formulas::{Formulas, IntegralFormula, RewardFormula, SpreadFormula};
use pilotage::solve::{Form, SolveSettings, SolverKind, solve};

const SEED: u64 = 1;
const EPISODES: usize = 100_000;
const PROBLEMS: [&str; 6] = [
    "corridor",
    "corridor-unbounded",
    "corridor-declare",
    "tiger",
    "tiger-sd",
    "load-unload",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("# Results\n");
    println!(
        "Made by `cargo run --release -p pilotage --example results`, pilotage {}, seed {SEED}, {EPISODES} episodes a row (2,000 for",
        env!("CARGO_PKG_VERSION")
    );
    println!(
        "policies asked anew at every belief), mean ± standard error. *Horizon* is the policy convergence horizon."
    );
    for name in PROBLEMS {
        let model = model::find(name)?;
        println!("\n## {name}\n\n{}\n", model.about);
        println!(
            "| solver | formulas | policy | nodes | horizon | planned | discounted | undiscounted | steps |"
        );
        println!("|---|---|---|--:|--:|--:|--:|--:|--:|");
        for solver in SolverKind::ALL {
            for (label, formulas) in formula_sets(solver) {
                for form in Form::ALL {
                    row(&model, solver, label, formulas, form)?;
                }
            }
        }
    }
    Ok(())
}

/// Only the thesis' branches have formulas to choose from.
fn formula_sets(solver: SolverKind) -> Vec<(&'static str, Formulas)> {
    let ramp = Formulas {
        reward: RewardFormula::Ramp,
        ..Formulas::default()
    };
    let printed = Formulas {
        spread: SpreadFormula::Printed,
        ..ramp
    };
    let all_printed = Formulas {
        integral: IntegralFormula::Printed,
        ..printed
    };
    match solver {
        SolverKind::Kbvi => vec![
            ("exact", Formulas::default()),
            ("ramp", ramp),
            ("ramp, printed 5.6", printed),
            ("ramp, printed 5.6 and 5.14", all_printed),
        ],
        _ => vec![("", Formulas::default())],
    }
}

fn row(
    model: &Model,
    solver: SolverKind,
    label: &str,
    formulas: Formulas,
    form: Form,
) -> Result<(), Box<dyn std::error::Error>> {
    let slow = solver == SolverKind::Kbvi && form == Form::Grid;
    if slow || solver.accepts(model).is_err() {
        return Ok(());
    }
    let settings = SolveSettings {
        form,
        seed: SEED,
        formulas,
        ..SolveSettings::default()
    };
    let solution = solve(solver, model, &settings, &Silent)?;
    let episodes = if form == Form::Grid { 2_000 } else { EPISODES };
    let options = Options {
        episodes,
        seed: SEED,
    };
    let earned = solution.evaluate(model, options, &Silent);
    let shown = |estimate: Estimate| format!("{:.4} ± {:.4}", estimate.mean, estimate.stderr);
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "–".to_owned());
    println!(
        "| {} | {label} | {} | {} | {} | {} | {} | {} | {:.2} |",
        solver.name(),
        form.name(),
        or_dash(
            solution
                .automaton()
                .map(|automaton| automaton.nodes.len().to_string())
        ),
        or_dash(
            solution
                .policy_convergence_horizon
                .map(|horizon| horizon.to_string())
        ),
        or_dash(solution.planned_value.map(|value| format!("{value:.4}"))),
        shown(earned.discounted),
        shown(earned.undiscounted),
        earned.steps.mean,
    );
    Ok(())
}
