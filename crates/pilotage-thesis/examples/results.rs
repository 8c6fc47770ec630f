//! Every planner on the problems of one and two dimensions, as Markdown tables: `cargo run --release -p pilotage-thesis --example results > docs/results.md`.
#![allow(clippy::print_stdout)]

use pilotage::progress::Silent;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate::{Estimate, Evaluation, Options};
use pilotage::solve::kbvi::formulas::{Formulas, IntegralFormula, RewardFormula, SpreadFormula};
use pilotage::solve::{Form, Kbvi, Registry, Request, Solver, solve};

const SEED: u64 = 1;
const EPISODES: usize = 100_000;
const PROBLEMS: [&str; 6] = [
    "corridor-blind",
    "corridor-unbounded",
    "corridor-declare",
    "tiger",
    "tiger-sd",
    "load-unload",
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("# Results\n");
    println!(
        "Made by `cargo run --release -p pilotage-thesis --example results`, pilotage {}, seed {SEED}, {EPISODES} episodes a row (2,000 for",
        env!("CARGO_PKG_VERSION")
    );
    println!(
        "policies asked anew at every belief), mean ± standard error. *Horizon* is the policy convergence horizon."
    );
    let mut earned = Vec::new();
    for name in PROBLEMS {
        let scenario = scenario::find(name)?;
        println!("\n## {name}\n\n{}\n", scenario.model.about);
        println!(
            "| solver | formulas | policy | nodes | horizon | planned | discounted | undiscounted | steps |"
        );
        println!("|---|---|---|--:|--:|--:|--:|--:|--:|");
        for (label, solver) in planners()? {
            let given = |form: &Form| solver.gives(*form, &scenario.model).is_ok();
            for form in Form::ALL.into_iter().filter(given) {
                if let Some(evaluation) = row(&scenario, &solver, label, form)? {
                    earned.push(((name, solver.name(), label, form), evaluation));
                }
            }
        }
    }
    beside_table_6_1(&earned);
    Ok(())
}

type Row = ((&'static str, &'static str, &'static str, Form), Evaluation);

/// The thesis' comparison of its two policy forms, and what they earn here. It does not say what its numbers are of.
fn beside_table_6_1(earned: &[Row]) {
    println!("\n## Beside Table 6.1\n");
    println!(
        "The thesis calls its numbers discounted. With a discount of 0.75 and at least one LISTEN no tiger policy can earn more than \n-1 + 0.75 * 10 = 6.5, so its 6.92 must be undiscounted; both are given."
    );
    println!(
        "\n| problem | policy | thesis | reading | formulas | discounted | undiscounted | undiscounted, a step |"
    );
    println!("|---|---|--:|---|---|--:|--:|--:|");
    let cells = [
        (
            "Tiger",
            Form::Segments,
            6.92,
            [
                ("tiger", "0.625 is a variance"),
                ("tiger-sd", "0.625 is a standard deviation"),
            ],
        ),
        (
            "Tiger",
            Form::Nearest,
            5.89,
            [
                ("tiger", "0.625 is a variance"),
                ("tiger-sd", "0.625 is a standard deviation"),
            ],
        ),
        (
            "1D maze",
            Form::Segments,
            0.93,
            [
                ("corridor-blind", "walls stop the robot"),
                ("corridor-unbounded", "no walls"),
            ],
        ),
        (
            "1D maze",
            Form::Nearest,
            0.47,
            [
                ("corridor-blind", "walls stop the robot"),
                ("corridor-unbounded", "no walls"),
            ],
        ),
    ];
    for (problem, form, thesis, readings) in cells {
        for (name, reading) in readings {
            for ((_, _, label, _), evaluation) in
                earned.iter().filter(|((model, solver, _, of), _)| {
                    *model == name && *solver == "kbvi" && *of == form
                })
            {
                println!(
                    "| {problem} | {} | {thesis} | {reading} | {label} | {} | {} | {:.3} |",
                    form.name(),
                    shown(evaluation.discounted),
                    shown(evaluation.undiscounted),
                    evaluation.undiscounted.mean / evaluation.steps.mean,
                );
            }
        }
    }
    println!(
        "\nWhat differs, and why:\n\n\
         - *Tiger, segments.* The thesis' 13 listens before a door fit 0.625 read as a standard deviation, and read so the ramp formula comes within 0.04 of its 6.92, undiscounted.\n\
         - *Tiger, 1-NN.* The thesis finds segments clearly better than 1-NN (6.92 to 5.89). Here the two forms of one plan differ by no more than 0.1, and 1-NN is never the worse one by more than its error: a gap of 1 must come from elsewhere.\n\
         - *1D maze, segments.* A reward of 0.93 a step is only earned by pushing EAST against the wall; discounted, the maze is worth 0.83 without walls. The thesis does not say which it counted.\n\
         - *1D maze, 1-NN.* 0.47 is what a step earns without walls, with either form.\n\
         - *Printed 5.14* divides a term by sqrt(2 pi V) that should stand alone; plans made with it earn least, but for the corridor with walls, where its mistake pushes the robot against the paying wall."
    );
}

/// The planners, with the formulas of the thesis' branches, of which alone there are some to choose from.
fn planners() -> pilotage::Result<Vec<(&'static str, Solver)>> {
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
    let formulas = [
        ("exact", Formulas::default()),
        ("ramp", ramp),
        ("ramp, printed 5.6", printed),
        ("ramp, printed 5.6 and 5.14", all_printed),
    ];
    let mut planners = Vec::new();
    for entry in Registry::builtin().entries() {
        if entry.name() == "kbvi" {
            planners.extend(formulas.map(|(label, formulas)| {
                let branches = Kbvi {
                    formulas,
                    ..Kbvi::default()
                };
                (label, Solver::planner(branches))
            }));
        } else if !entry.learns() {
            planners.push(("", entry.solver(&[])?));
        }
    }
    Ok(planners)
}

fn row(
    scenario: &Scenario,
    solver: &Solver,
    label: &str,
    form: Form,
) -> Result<Option<Evaluation>, Box<dyn std::error::Error>> {
    let slow = solver.name() == "kbvi" && form == Form::Grid;
    if slow || solver.accepts(&scenario.model).is_err() {
        return Ok(None);
    }
    let request = Request {
        seed: SEED,
        ..Request::form(form)
    };
    let solution = solve(solver, scenario, &request, &Silent)?;
    let episodes = if form == Form::Grid { 2_000 } else { EPISODES };
    let options = Options {
        episodes,
        seed: SEED,
    };
    let earned = solution.evaluate(scenario, options, &Silent)?;
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
    Ok(Some(earned))
}

fn shown(estimate: Estimate) -> String {
    format!("{:.4} ± {:.4}", estimate.mean, estimate.stderr)
}
