//! Options that several commands share.

use std::path::{Path, PathBuf};

use clap::Args;
use pilotage::policy::Automaton;
use pilotage::scenario::{self, Scenario};
use pilotage::simulate;

use crate::failure::Failure;

/// How to evaluate a policy.
#[derive(Args)]
pub struct Evaluation {
    /// Episodes to run for the evaluation.
    #[arg(long, default_value_t = 10_000, value_parser = at_least_one)]
    pub episodes: usize,
    /// Seed of every random number: the same seed gives the same result.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Threads to use; the numbers do not depend on it. 0 uses every core.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

impl Evaluation {
    /// As the library wants it.
    pub fn options(&self) -> simulate::Options {
        simulate::Options {
            episodes: self.episodes,
            seed: self.seed,
        }
    }

    /// Limits the threads of everything that follows.
    pub fn start_threads(&self) -> Result<(), Failure> {
        start_threads(self.threads)
    }
}

/// Limits the threads of everything that follows; 0 uses every core.
pub fn start_threads(threads: usize) -> Result<(), Failure> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|error| Failure::Usage(format!("cannot start {threads} threads: {error}")))
}

/// A whole number above 0.
pub fn at_least_one(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be at least 1".to_owned()),
        Ok(number) => Ok(number),
        Err(error) => Err(format!("{error}")),
    }
}

/// Reads a policy file together with the problem it belongs to: the one given, or the built-in one it names.
pub fn policy_and_problem(
    policy: &Path,
    problem: Option<&str>,
) -> Result<(Automaton, Scenario), Failure> {
    let automaton = Automaton::load(policy)?;
    let scenario = scenario::find(problem.unwrap_or(&automaton.problem))?;
    automaton.check_problem(&scenario.model, &policy.display().to_string())?;
    Ok((automaton, scenario))
}

/// A file name beside `path`: its stem, a dash, and `suffix`.
pub fn beside(path: &Path, suffix: &str) -> PathBuf {
    let stem = path.file_stem().map_or_else(
        || "policy".to_owned(),
        |stem| stem.to_string_lossy().into_owned(),
    );
    path.with_file_name(format!("{stem}-{suffix}"))
}
