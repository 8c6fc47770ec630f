//! `pilotage reproduce`: every table and figure of the thesis, made again.

mod chapter4;
mod chapter5;
mod chapter6;
mod context;
mod learning;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use pilotage::model::suggest;
use pilotage::policy::write_whole;
use pilotage::report::Finding;
use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::progress::Bars;
use context::Context;

#[derive(Args)]
pub struct Arguments {
    /// Make only these, by name, such as table-4.1; comma-separated. `--list` names them.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    only: Vec<String>,
    /// Fewer seeds and episodes: under a minute.
    #[arg(long)]
    quick: bool,
    /// Folder to write to.
    #[arg(long, value_name = "FOLDER", default_value = "reproduction")]
    out: PathBuf,
    /// Seed of every random number: the same seed gives the same report.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Threads to use; the numbers do not depend on it. 0 uses every core.
    #[arg(long, default_value_t = 0)]
    threads: usize,
    /// Name what can be made, and stop.
    #[arg(long)]
    list: bool,
}

/// A table or figure, and how to make it again.
struct Experiment {
    id: &'static str,
    about: &'static str,
    make: fn(&Context<'_>) -> Result<Finding, Failure>,
}

const EXPERIMENTS: &[Experiment] = &[
    Experiment {
        id: "table-4.1",
        about: "uncertainty levels",
        make: chapter4::table_4_1,
    },
    Experiment {
        id: "figure-4.8",
        about: "KAFAQ in the basic world (and 4.9)",
        make: learning::figure_4_8,
    },
    Experiment {
        id: "figure-4.10",
        about: "KAFAQ in the 4x4 maze (and 4.11)",
        make: learning::figure_4_10,
    },
    Experiment {
        id: "figure-4.12",
        about: "KAFAQ and the hidden load (and 4.13)",
        make: learning::figure_4_12,
    },
    Experiment {
        id: "figure-4.14",
        about: "KAFAQ and the four stations (and 4.15)",
        make: learning::figure_4_14,
    },
    Experiment {
        id: "figure-4.16",
        about: "KAFAQ and the shuttle (and 4.17)",
        make: learning::figure_4_16,
    },
    Experiment {
        id: "section-4.3.6",
        about: "KAFAQ balances the pole",
        make: learning::section_4_3_6,
    },
    Experiment {
        id: "figure-5.2",
        about: "reward at a belief",
        make: chapter5::figure_5_2,
    },
    Experiment {
        id: "figure-5.4",
        about: "beliefs reachable in one step (and 5.3)",
        make: chapter5::figures_5_3_and_5_4,
    },
    Experiment {
        id: "figure-5.6",
        about: "levels of the one-dimensional maze",
        make: chapter5::figure_5_6,
    },
    Experiment {
        id: "figure-5.10",
        about: "the tiger (and 5.9)",
        make: chapter5::figures_5_9_and_5_10,
    },
    Experiment {
        id: "figure-5.13",
        about: "the one-dimensional maze (and 5.11, 5.12)",
        make: chapter5::figures_5_11_to_5_13,
    },
    Experiment {
        id: "convergence",
        about: "policy convergence horizons",
        make: chapter5::convergence,
    },
    Experiment {
        id: "section-5.5.3",
        about: "the two-dimensional maze",
        make: chapter5::section_5_5_3,
    },
    Experiment {
        id: "figure-5.14",
        about: "the hidden load (and 2.10, 2.11)",
        make: chapter5::figure_5_14,
    },
    Experiment {
        id: "section-5.5.5",
        about: "the inverted pendulum",
        make: chapter5::section_5_5_5,
    },
    Experiment {
        id: "table-5.1",
        about: "policy of the U-shaped maze",
        make: chapter5::table_5_1,
    },
    Experiment {
        id: "figure-5.17",
        about: "waking up lost (and 5.16)",
        make: chapter5::figures_5_16_and_5_17,
    },
    Experiment {
        id: "declare",
        about: "a maze in which looking pays",
        make: chapter5::declare,
    },
    Experiment {
        id: "table-6.1",
        about: "segments and nearest neighbours",
        make: chapter6::table_6_1,
    },
    Experiment {
        id: "table-a.1",
        about: "Q-values of the pole",
        make: chapter4::table_a_1,
    },
];

/// A finding as it is kept between runs, with what it depends on.
#[derive(Serialize, Deserialize)]
struct Kept {
    version: String,
    seed: u64,
    quick: bool,
    finding: Finding,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.list {
        let mut out = std::io::stdout().lock();
        for experiment in EXPERIMENTS {
            writeln!(out, "{:<14} {}", experiment.id, experiment.about)?;
        }
        return Ok(());
    }
    let chosen = chosen(&arguments.only)?;
    crate::options::start_threads(arguments.threads)?;
    let bars = Bars::new(false);
    let context = Context {
        seed: arguments.seed,
        quick: arguments.quick,
        observer: &bars,
    };
    let data = arguments.out.join("data");
    std::fs::create_dir_all(&data).map_err(|source| pilotage::Error::Io {
        path: data.clone(),
        source,
    })?;
    let mut findings = Vec::new();
    for (done, experiment) in chosen.iter().enumerate() {
        bars.chapter(experiment.id, done, chosen.len());
        let file = data.join(format!("{}.json", experiment.id));
        let finding = match kept(&file, arguments) {
            Some(finding) => finding,
            None => {
                let mut finding = (experiment.make)(&context)?;
                experiment.id.clone_into(&mut finding.id);
                keep(&file, arguments, &finding)?;
                finding
            }
        };
        findings.push(finding);
    }
    Ok(())
}

/// The experiments asked for, in the order of the thesis; all without a choice.
fn chosen(only: &[String]) -> Result<Vec<&'static Experiment>, Failure> {
    for name in only {
        if !EXPERIMENTS.iter().any(|experiment| experiment.id == name) {
            return Err(pilotage::Error::Unknown {
                what: "table or figure",
                name: name.clone(),
                hint: suggest(name, EXPERIMENTS.iter().map(|experiment| experiment.id)),
            }
            .into());
        }
    }
    let wanted = |id: &str| only.is_empty() || only.iter().any(|name| name == id);
    Ok(EXPERIMENTS
        .iter()
        .filter(|experiment| wanted(experiment.id))
        .collect())
}

/// What an earlier, interrupted run of the same settings has made already.
fn kept(file: &Path, arguments: &Arguments) -> Option<Finding> {
    let text = std::fs::read_to_string(file).ok()?;
    let kept: Kept = serde_json::from_str(&text).ok()?;
    let same = kept.version == env!("CARGO_PKG_VERSION")
        && kept.seed == arguments.seed
        && kept.quick == arguments.quick;
    same.then_some(kept.finding)
}

fn keep(file: &Path, arguments: &Arguments, finding: &Finding) -> Result<(), Failure> {
    let kept = Kept {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: arguments.seed,
        quick: arguments.quick,
        finding: finding.clone(),
    };
    let text =
        serde_json::to_string_pretty(&kept).map_err(|error| Failure::Output(error.into()))?;
    Ok(write_whole(file, text.as_bytes())?)
}
