//! The report as Markdown (CommonMark with tables), with its figures as files beside it.

use std::fmt::Write;

use super::super::finding::{Algorithm, Finding, Report, Table};
use super::data::numbered;
use super::{TITLE, WHAT_IT_IS, by_verdict, made};

/// The report's Markdown, and name and text of each figure; it expects them in the folder `figures`, relative to itself.
pub fn page_markdown(report: &Report, figures: &str) -> (String, Vec<(String, String)>) {
    let mut out = format!("# {TITLE}\n\n{WHAT_IT_IS}\n\n{}\n", plain(&made(report)));
    if !report.algorithms.is_empty() {
        out += "\n## The algorithms\n\n";
        algorithms(&mut out, &report.algorithms);
    }
    out += "\n## What came out\n\n";
    for (verdict, findings) in by_verdict(report) {
        let _ = writeln!(out, "- {} {}", findings.len(), verdict.name());
    }
    out += "\n| finding | verdict |\n|---|---|\n";
    for finding in &report.findings {
        let _ = writeln!(
            out,
            "| [{}](#{}) | {} |",
            plain(&finding.title),
            plain(&finding.id),
            finding.verdict.name()
        );
    }
    let mut files = Vec::new();
    for finding in &report.findings {
        section(&mut out, finding, figures, &mut files);
    }
    (out, files)
}

fn algorithms(out: &mut String, algorithms: &[Algorithm]) {
    let columns = [
        "algorithm",
        "needs",
        "gives",
        "choose it when",
        "how far from the best known",
    ];
    let rows = algorithms.iter().map(|algorithm| {
        [
            &algorithm.name,
            &algorithm.needs,
            &algorithm.gives,
            &algorithm.choose,
            &algorithm.gap,
        ]
    });
    head(out, &columns);
    rows.for_each(|cells| row(out, &cells));
}

fn section(out: &mut String, finding: &Finding, figures: &str, files: &mut Vec<(String, String)>) {
    let _ = writeln!(
        out,
        "\n<a id=\"{}\"></a>\n\n## {}\n\nThe thesis: {}\n\n**{}**: {}",
        attribute(&finding.id),
        plain(&finding.title),
        plain(&finding.thesis),
        finding.verdict.name(),
        plain(&finding.why)
    );
    for Table {
        caption,
        columns,
        rows,
    } in &finding.tables
    {
        let _ = writeln!(out, "\nTable: {}\n", plain(caption));
        head(out, columns);
        rows.iter().for_each(|cells| row(out, cells));
    }
    let names = numbered(&finding.id, finding.figures.len(), "svg");
    for (name, figure) in names.zip(&finding.figures) {
        let caption = plain(&figure.caption);
        let _ = writeln!(
            out,
            "\n![{caption}](<{figures}/{name}>)\n\nFigure: {caption}"
        );
        files.push((name, figure.svg.clone()));
    }
}

fn head(out: &mut String, columns: &[impl AsRef<str>]) {
    row(out, columns);
    let _ = writeln!(out, "{}|", "|---".repeat(columns.len()));
}

fn row(out: &mut String, cells: &[impl AsRef<str>]) {
    for cell in cells {
        let _ = write!(out, "| {} ", plain(cell.as_ref()));
    }
    out.push_str("|\n");
}

/// Text on one line in which nothing is taken for markup.
fn plain(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
        .chars()
    {
        if "\\`*_[]<>|&~$".contains(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

fn attribute(text: &str) -> String {
    text.replace(['"', '<', '>', '&'], "")
}
