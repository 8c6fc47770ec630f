//! The frame of an episode to be played; the script draws in it what the recording beside it says.

use maud::{Markup, PreEscaped, html};

use super::super::finding::Recording;

/// An episode with its controls.
pub fn player(recording: &Recording) -> Markup {
    let id = format!("episode-{}", recording.id);
    let last = recording.frames.len().saturating_sub(1);
    let plane = recording.bounds.len() > 1;
    let modes = recording.frames.iter().any(|frame| !frame.mode.is_empty());
    html! {
        article.episode #(id) aria-labelledby={ (id) "-title" } {
            h3 id={ (id) "-title" } { (recording.title) }
            p { (recording.about) }
            div.stage {}
            ul.key {
                li { (sign(html! { circle.true cx="10" cy="8" r="6" {} })) "true state" }
                @if plane {
                    li { (sign(html! { ellipse.belief cx="10" cy="8" rx="9" ry="6" {} })) "belief: two standard deviations around a mean" }
                    li { (sign(html! { path.path d="M1 13 L8 4 L19 8" {} })) "path so far" }
                } @else {
                    li { (sign(html! { path.belief d="M0 15 C6 15 6 2 10 2 S14 15 20 15 Z" {} })) "belief" }
                }
                li { (sign(html! { rect.place x="2" y="1" width="16" height="14" {} })) "place that pays" }
                @if !recording.blocked.is_empty() {
                    li { (sign(html! { rect.blocked x="2" y="1" width="16" height="14" {} })) "wall" }
                }
            }
            div.controls {
                button type="button" data-do="play" { "Play" }
                button type="button" data-do="back" { "Step back" }
                button type="button" data-do="forward" { "Step" }
                input type="range" min="0" max=(last) value="0" step="1" aria-label={ "Step of the episode, from 0 to " (last) };
            }
            dl.now aria-live="polite" {
                div { dt { "step" } dd data-show="step" {} }
                div { dt { "action" } dd data-show="action" {} }
                div { dt { "pays" } dd data-show="reward" {} }
                div { dt { "paid so far" } dd data-show="sum" {} }
                @if modes { div { dt { "truly" } dd data-show="mode" {} } div { dt { "believed" } dd data-show="believed" {} } }
            }
            p.nodes-head id={ (id) "-nodes" } { "The automaton's nodes, with the action of each:" }
            ol.nodes tabindex="0" aria-labelledby={ (id) "-nodes" } {
                @for node in &recording.nodes { li { (node) } }
            }
            script type="application/json" { (PreEscaped(json(recording))) }
        }
    }
}

fn sign(shape: Markup) -> Markup {
    html! { svg aria-hidden="true" width="20" height="16" viewBox="0 0 20 16" { (shape) } }
}

/// A recording as JSON that no HTML parser takes for markup: in JSON `<` stands in strings only, where it may be written so.
fn json(recording: &Recording) -> String {
    let json = serde_json::to_string(recording).unwrap_or_default();
    json.replace('<', "\\u003c")
}
