//! Options that several commands share.

use std::path::{Path, PathBuf};

use clap::Args;
use pilotage::error::visible;
use pilotage::policy::Saved;
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
    #[arg(long, default_value_t = 0, value_parser = threads)]
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

/// A number of threads: what a machine may have, and not so many that it is busy with nothing but starting them.
pub fn threads(text: &str) -> Result<usize, String> {
    const MOST: usize = 1024;
    match text.parse() {
        Ok(number) if number <= MOST => Ok(number),
        Ok(_) => Err(format!("must be at most {MOST}; 0 uses every core")),
        Err(error) => Err(format!("{error}")),
    }
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
    problem: Option<&Path>,
) -> Result<(Saved, Scenario), Failure> {
    let saved = Saved::load(policy)?;
    let origin = shown(policy);
    let scenario = match problem {
        Some(problem) => scenario::find(problem)?,
        // A file says whose policy it is, not which other files are read.
        None => match scenario::find_builtin(saved.problem()) {
            Some(scenario) => scenario?,
            None => {
                return Err(Failure::Usage(format!(
                    "{origin}: this policy is for {}, which is not built in; give its model file with --problem",
                    saved.problem()
                )));
            }
        },
    };
    saved.check_problem(&scenario.model, &origin)?;
    Ok((saved, scenario))
}

/// A file name as it is typed in a shell: in quotes where it needs them, and never taken for an option.
pub fn quoted(path: &Path) -> String {
    let plain =
        |c: char| c.is_alphanumeric() || "_./-+=:,@%".contains(c) || (cfg!(windows) && c == '\\');
    let shown = shown(path);
    let argument = if shown.starts_with('-') {
        format!("./{shown}")
    } else {
        shown
    };
    if !argument.is_empty() && argument.chars().all(plain) {
        argument
    } else if argument.contains(['"', '$', '`', '\\', '!']) {
        format!("'{}'", argument.replace('\'', r"'\''"))
    } else {
        format!("\"{argument}\"")
    }
}

/// A file name as it can be shown anywhere.
pub fn shown(path: &Path) -> String {
    visible(&path.display().to_string()).into_owned()
}

/// A file name beside `path`: its stem, a dash, and `suffix`.
pub fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.file_stem().unwrap_or("policy".as_ref()).to_owned();
    name.push(format!("-{suffix}"));
    path.with_file_name(name)
}
