//! The report as one HTML file: style, script, figures and data are all in it.

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::super::finding::{Algorithm, Figure, Finding, Report, Table, Verdict};
use super::player::player;
use super::{TITLE, WHAT_IT_IS, by_verdict, made, theme};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// Nothing is loaded from anywhere, whatever a text or picture may ask for.
const POLICY: &str =
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// The whole report as one self-contained page.
pub fn page_html(report: &Report) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (TITLE) }
                link rel="icon" href="data:,";
                style { (PreEscaped(theme::css())) (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (TITLE) }
                    p.lead { (WHAT_IT_IS) }
                }
                main {
                    (episodes(report))
                    section aria-labelledby="how-to-read" {
                        h2 #how-to-read { "How to read this" }
                        p { "Each finding below takes a table or figure of the thesis, says what the thesis prints, and shows what comes out here, with the standard error wherever something was sampled. The verdict compares the two, and the sentence after it says why." }
                    }
                    @if !report.algorithms.is_empty() { (algorithms(&report.algorithms)) }
                    (summary(report))
                    @for finding in &report.findings { (section(finding)) }
                }
                footer { p { (made(report)) } }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

fn episodes(report: &Report) -> Markup {
    let recordings = report.recordings.iter();
    let played: Vec<_> = recordings
        .filter(|recording| !recording.frames.is_empty())
        .collect();
    html! {
        @if !played.is_empty() {
            section aria-labelledby="episodes" {
                h2 #episodes { "What it does, step by step" }
                p { "Recorded runs of automata that pilotage found. An agent never sees its true state: it senses something noisy, keeps a belief, finds the node of its automaton that fits, and does what that node says." }
                noscript { p { "The runs are drawn by a script, which this browser does not run." } }
                @for recording in played { (player(recording)) }
            }
        }
    }
}

fn algorithms(algorithms: &[Algorithm]) -> Markup {
    html! {
        section aria-labelledby="algorithms" {
            h2 #algorithms { "The algorithms" }
            div.scroll tabindex="0" role="region" aria-labelledby="algorithms" {
                table.words {
                    thead { tr {
                        @for head in ["algorithm", "needs", "gives", "choose it when", "how far from the best known"] {
                            th scope="col" { (head) }
                        }
                    } }
                    tbody {
                        @for algorithm in algorithms {
                            tr {
                                th scope="row" { (algorithm.name) }
                                td { (algorithm.needs) }
                                td { (algorithm.gives) }
                                td { (algorithm.choose) }
                                td { (algorithm.gap) }
                            }
                        }
                    }
                }
            }
        }
    }
}

fn summary(report: &Report) -> Markup {
    html! {
        section aria-labelledby="summary" {
            h2 #summary { "What came out" }
            ul.counts {
                @for (verdict, findings) in by_verdict(report) {
                    li { strong { (findings.len()) } " " (badge(verdict)) }
                }
            }
            ol.contents {
                @for finding in &report.findings {
                    li { a href={ "#" (anchor(finding)) } { (finding.title) } " " (badge(finding.verdict)) }
                }
            }
        }
    }
}

fn section(finding: &Finding) -> Markup {
    html! {
        section.finding #(anchor(finding)) {
            h2 { (finding.title) }
            p { b { "The thesis: " } (finding.thesis) }
            p.verdict { (badge(finding.verdict)) " " (finding.why) }
            @for table in &finding.tables { (drawn(table)) }
            @for figure in &finding.figures { (pictured(figure)) }
            p.back { a href="#summary" { "All findings" } }
        }
    }
}

/// Findings share the page with ids of its own.
fn anchor(finding: &Finding) -> String {
    format!("finding-{}", finding.id)
}

/// A verdict as a word, and as a shape for those who skim.
fn badge(verdict: Verdict) -> Markup {
    let (class, shape) = match verdict {
        Verdict::Reproduced => ("good", "●"),
        Verdict::UnderReading => ("reading", "◐"),
        Verdict::Contradicted => ("bad", "✕"),
        Verdict::NotDecidable => ("open", "○"),
    };
    html! {
        span class={ "badge " (class) } { span.shape aria-hidden="true" { (shape) } " " (verdict.name()) }
    }
}

fn drawn(table: &Table) -> Markup {
    let is_number = |column: usize| {
        let cells = table.rows.iter().filter_map(|row| row.get(column));
        let mut written = cells
            .map(|cell| cell.trim())
            .filter(|cell| !cell.is_empty());
        let signs = ['-', '−', '+', '<', '>', '≤', '≥', ' '];
        let starts_with_digit = |cell: &str| {
            cell.trim_start_matches(signs)
                .starts_with(|c: char| c.is_ascii_digit())
        };
        written.clone().count() > 0 && written.all(starts_with_digit)
    };
    let classes: Vec<Option<&str>> = (0..table.columns.len())
        .map(|column| is_number(column).then_some("number"))
        .collect();
    html! {
        div.scroll tabindex="0" role="region" aria-label=(table.caption) {
            table {
                caption { (table.caption) }
                thead { tr {
                    @for (head, class) in table.columns.iter().zip(&classes) {
                        th scope="col" class=[class] { (head) }
                    }
                } }
                tbody {
                    @for row in &table.rows {
                        tr { @for (cell, class) in row.iter().zip(&classes) { td class=[class] { (cell) } } }
                    }
                }
            }
        }
    }
}

/// An image of its own, so that neither styles nor ids of a drawing meet those of another.
fn pictured(figure: &Figure) -> Markup {
    let source = format!("data:image/svg+xml;base64,{}", BASE64.encode(&figure.svg));
    html! {
        figure {
            div.scroll tabindex="0" role="region" aria-label=(figure.caption) {
                img src=(source) alt=(figure.caption);
            }
            figcaption { (figure.caption) }
        }
    }
}
