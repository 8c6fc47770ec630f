//! `pilotage`: plan, learn, simulate and draw policies under uncertainty, from the command line.

mod check;
mod draw;
mod failure;
mod list;
mod options;
mod progress;
mod reproduce;
mod settings_help;
mod simulate;
mod solve;
mod summary;

use clap::{Parser, Subcommand};

use failure::Failure;

/// Turn a noisy, partly observable world into a small finite automaton that says what to do.
#[derive(Parser)]
#[command(
    version,
    about,
    max_term_width = 100,
    arg_required_else_help = true,
    after_help = "`pilotage solve --help` lists the settings of every solver."
)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Subcommand)]
enum Verb {
    /// List the built-in problems and the solvers.
    List(list::Arguments),
    /// Read a model file and say what it describes, or what is wrong with it and where.
    Check(check::Arguments),
    /// Find a policy for a problem, and measure what it earns.
    Solve(Box<solve::Arguments>),
    /// Run a saved policy and measure what it earns.
    Simulate(simulate::Arguments),
    /// Draw a saved policy: its automaton and its map of beliefs, as SVG.
    Draw(draw::Arguments),
    /// Make every table and figure of the thesis again, with a verdict on each.
    Reproduce(reproduce::Arguments),
}

fn main() -> std::process::ExitCode {
    let outcome = match Cli::parse().verb {
        Verb::List(arguments) => list::run(&arguments),
        Verb::Check(arguments) => check::run(&arguments),
        Verb::Solve(arguments) => solve::run(&arguments),
        Verb::Simulate(arguments) => simulate::run(&arguments),
        Verb::Draw(arguments) => draw::run(&arguments),
        Verb::Reproduce(arguments) => reproduce::run(&arguments),
    };
    match outcome {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(Failure::Closed) => std::process::ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{}", failure.render());
            std::process::ExitCode::FAILURE
        }
    }
}
