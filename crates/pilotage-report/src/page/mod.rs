//! A report as one page that works offline, as Markdown with its figures beside it, and as data.

mod data;
mod html;
mod markdown;
mod player;
mod theme;

#[cfg(test)]
mod tests;

pub use data::tables_csv;
pub use html::page_html;
pub use markdown::page_markdown;

use super::finding::{Finding, Report, Verdict};

/// What every form of a report is headed by.
const TITLE: &str = "pilotage: the thesis made again";
const WHAT_IT_IS: &str = "pilotage turns what an agent assumes about a noisy world into a small finite automaton that says what to do, from a belief that a Kalman filter keeps.";

/// Findings with each verdict, in the order of [`Verdict::ALL`].
fn by_verdict(report: &Report) -> impl Iterator<Item = (Verdict, Vec<&Finding>)> {
    Verdict::ALL.into_iter().map(|verdict| {
        let findings = report.findings.iter();
        let with = findings.filter(|finding| finding.verdict == verdict);
        (verdict, with.collect())
    })
}

/// How the report was made, in a sentence.
fn made(report: &Report) -> String {
    let how = if report.quick {
        "quick, with fewer seeds and episodes than the full report"
    } else {
        "full"
    };
    format!(
        "Made by pilotage {} with seed {}; {how}.",
        report.version, report.seed
    )
}
