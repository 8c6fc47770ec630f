//! `pilotage`: plan, learn, simulate and draw policies under uncertainty, from the command line.

mod check;
mod draw;
mod failure;
mod kept;
mod list;
mod options;
mod progress;
mod reproduce;
mod settings_help;
mod simulate;
mod solve;
mod summary;

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use pilotage::error::visible;

use failure::Failure;

/// Turn a noisy, partly observable world into a small finite automaton that says what to do.
#[derive(Parser)]
#[command(
    version,
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
    /// Draw a saved policy, its automaton and its map of beliefs, or its graph, as SVG.
    Draw(draw::Arguments),
    /// Make every table and figure of the thesis again, with a verdict on each.
    Reproduce(reproduce::Arguments),
}

fn main() -> ExitCode {
    let verb = match Cli::try_parse() {
        Ok(cli) => cli.verb,
        Err(message) => return not_parsed(&message),
    };
    let outcome = match verb {
        Verb::List(arguments) => list::run(&arguments),
        Verb::Check(arguments) => check::run(&arguments),
        Verb::Solve(arguments) => solve::run(&arguments),
        Verb::Simulate(arguments) => simulate::run(&arguments),
        Verb::Draw(arguments) => draw::run(&arguments),
        Verb::Reproduce(arguments) => reproduce::run(&arguments),
    };
    match outcome {
        Ok(()) | Err(Failure::Closed) => ExitCode::SUCCESS,
        Err(failure) => {
            failure::say(&failure.render());
            ExitCode::FAILURE
        }
    }
}

/// Shows help, the version, or what is wrong with the command line.
fn not_parsed(message: &clap::Error) -> ExitCode {
    let hidden = |argument: std::ffi::OsString| {
        let argument = argument.to_string_lossy();
        visible(&argument) != argument
    };
    // Colours are those of the parser, unless the command line has some of its own.
    let printed = if std::env::args_os().any(hidden) {
        failure::say(&visible(&message.to_string()));
        Ok(())
    } else {
        message.print()
    };
    match printed.map_err(Failure::from) {
        Ok(()) | Err(Failure::Closed) => ExitCode::from(message.exit_code() as u8),
        Err(failure) => {
            failure::say(&failure.render());
            ExitCode::FAILURE
        }
    }
}
