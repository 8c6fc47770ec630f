//! `pilotage reproduce`: every table and figure of the thesis, made again.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use pilotage::model::suggest;
use pilotage::policy::write_whole;
use pilotage_report::{Report, Verdict, page_html, page_markdown, tables_csv};
use pilotage_thesis::{Context, EXPERIMENTS, Experiment, algorithms, episodes};

use crate::failure::Failure;
use crate::kept::Maker;
use crate::progress::Bars;

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
    #[arg(long, default_value_t = 0, value_parser = crate::options::threads)]
    threads: usize,
    /// Name what can be made, and stop.
    #[arg(long)]
    list: bool,
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
    let maker = Maker::new(arguments.seed, arguments.quick);
    let data = folder(&arguments.out.join("data"))?;
    let clock = Instant::now();
    let cost = |experiment: &Experiment| {
        if arguments.quick {
            experiment.cost.1
        } else {
            experiment.cost.0
        }
    };
    let (mut findings, mut paid) = (Vec::new(), 0.0);
    for (done, experiment) in chosen.iter().enumerate() {
        let file = data.join(format!("{}.json", experiment.id));
        let finding = match maker.find(&file, experiment.id) {
            Some(finding) => finding,
            None => {
                let left: f64 = chosen[done..].iter().map(|one| cost(one)).sum();
                bars.chapter(
                    experiment.id,
                    (done, chosen.len()),
                    foretold(clock, paid, left),
                );
                let mut finding = (experiment.make)(&context)?;
                experiment.id.clone_into(&mut finding.id);
                maker.keep(&file, &finding)?;
                paid += cost(experiment);
                finding
            }
        };
        findings.push(finding);
    }
    let report = Report {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: arguments.seed,
        quick: arguments.quick,
        recordings: episodes(arguments.seed, &bars)?,
        algorithms: algorithms(&findings),
        findings,
    };
    write(&report, &arguments.out)
}

/// Seconds left, once enough has been made to tell.
fn foretold(clock: Instant, paid: f64, left: f64) -> Option<f64> {
    (paid > 0.0).then(|| clock.elapsed().as_secs_f64() / paid * left)
}

/// Writes the page, the Markdown with its figures, and the tables.
fn write(report: &Report, out: &Path) -> Result<(), Failure> {
    const FIGURES: &str = "figures";
    let mut printed = std::io::stdout().lock();
    let (markdown, pictures) = page_markdown(report, FIGURES);
    let figures = folder(&out.join(FIGURES))?;
    for (name, svg) in pictures {
        write_whole(&figures.join(name), svg.as_bytes())?;
    }
    let data = folder(&out.join("data"))?;
    for (name, csv) in report.findings.iter().flat_map(tables_csv) {
        write_whole(&data.join(name), csv.as_bytes())?;
    }
    for (name, text) in [("report.md", markdown), ("report.html", page_html(report))] {
        let path = out.join(name);
        write_whole(&path, text.as_bytes())?;
        writeln!(printed, "{}", crate::options::shown(&path))?;
    }
    for verdict in Verdict::ALL {
        let count = report
            .findings
            .iter()
            .filter(|finding| finding.verdict == verdict)
            .count();
        writeln!(printed, "  {count:>3} {}", verdict.name())?;
    }
    Ok(())
}

/// A folder, made where it is missing.
fn folder(path: &Path) -> Result<PathBuf, Failure> {
    std::fs::create_dir_all(path).map_err(|source| pilotage::Error::Io {
        path: path.to_owned(),
        source,
    })?;
    Ok(path.to_owned())
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
