//! The page's colours, those of all drawings, as CSS variables.

use std::fmt::Write;

use super::super::palette::Paint;

/// Variable of the page and what it paints.
const VARIABLES: [(&str, Paint); 8] = [
    ("paper", Paint::Paper),
    ("ink", Paint::Ink),
    ("muted", Paint::Muted),
    ("grid", Paint::Grid),
    ("belief", Paint::LineHue(0)),
    ("place", Paint::LineHue(1)),
    ("good", Paint::LineHue(2)),
    ("bad", Paint::LineHue(3)),
];

/// The rules that define them, light and dark.
pub fn css() -> String {
    let mut css = ":root {".to_owned();
    for (name, paint) in VARIABLES {
        let _ = write!(css, " --{name}: {};", paint.light());
    }
    css.push_str(" }\n@media (prefers-color-scheme: dark) { :root {");
    for (name, paint) in VARIABLES {
        let _ = write!(css, " --{name}: {};", paint.dark());
    }
    css + " } }\n"
}
