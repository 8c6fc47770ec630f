//! The page's colours, those of all drawings, as CSS variables.

use std::fmt::Write;

use super::super::palette::Paint;

/// Variable of the page, and what it paints on light and on dark paper. What belongs to beliefs also serves as text, which on
/// dark paper needs a lighter blue than lines do.
const VARIABLES: [(&str, Paint, Paint); 8] = [
    ("paper", Paint::Paper, Paint::Paper),
    ("ink", Paint::Ink, Paint::Ink),
    ("muted", Paint::Muted, Paint::Muted),
    ("grid", Paint::Grid, Paint::Grid),
    ("belief", Paint::LineHue(0), Paint::LineHue(4)),
    ("place", Paint::LineHue(1), Paint::LineHue(1)),
    ("good", Paint::LineHue(2), Paint::LineHue(2)),
    ("bad", Paint::LineHue(3), Paint::LineHue(3)),
];

/// The rules that define them, light and dark.
pub fn css() -> String {
    let mut css = ":root {".to_owned();
    for (name, paint, _) in VARIABLES {
        let _ = write!(css, " --{name}: {};", paint.light());
    }
    css.push_str(" }\n@media (prefers-color-scheme: dark) { :root {");
    for (name, _, paint) in VARIABLES {
        let _ = write!(css, " --{name}: {};", paint.dark());
    }
    css + " } }\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_can_be_read() {
        let (_, light, dark) = VARIABLES[4];
        assert!(light.light().contrast(Paint::Paper.light()) >= 4.5);
        assert!(dark.dark().contrast(Paint::Paper.dark()) >= 4.5);
    }
}
