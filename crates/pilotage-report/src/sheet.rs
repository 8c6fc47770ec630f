//! A drawing as a sheet: heading, pictures, legend and notes, one below the other.

use super::palette::Paint;
use super::svg::{self, Anchor, Element, label, text_width};

/// Space kept free at the edges.
pub const MARGIN: f64 = 20.0;
/// How strongly the areas of a map are coloured, so that what lies on them stays visible.
pub const TINT: f64 = 0.7;
/// Least width of what is drawn: legends and notes need some.
const LEAST: f64 = 460.0;
const TITLE: f64 = 17.0;
const TEXT: f64 = 12.0;
/// From one line of text to the next.
const LEADING: f64 = 18.0;

/// The sign before an entry of a legend.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sign {
    /// A filled square.
    Area(Paint),
    /// A square filled as faintly as the areas of a map.
    Tint(Paint),
    /// A piece of a line with its dashes.
    Line(Paint, &'static str),
    /// A square that is only framed.
    Frame(Paint),
    /// A filled disc.
    Disc(Paint),
    /// A bar along an axis.
    Bar(Paint),
    /// A diamond, as at the start belief.
    Diamond,
}

/// A sheet of known width that grows downwards.
#[derive(Debug)]
pub struct Sheet {
    title: String,
    description: String,
    width: f64,
    /// Where the next thing goes.
    y: f64,
    body: Vec<Element>,
}

impl Sheet {
    /// A sheet with its heading and a line below it. `width` is that of what is to be drawn, without margins.
    pub fn new(title: &str, subtitle: &str, description: &str, width: f64) -> Self {
        let mut sheet = Self {
            title: title.to_owned(),
            description: description.to_owned(),
            width: width.max(LEAST) + 2.0 * MARGIN,
            y: MARGIN + TITLE,
            body: Vec::new(),
        };
        for line in wrapped(title, TITLE * 1.1, width) {
            let heading = label((MARGIN, sheet.y), TITLE, Anchor::Start, line)
                .with("font-weight", "600")
                .fill(Paint::Ink);
            sheet.body.push(heading);
            sheet.y += TITLE + 6.0;
        }
        if subtitle.is_empty() {
            sheet.y += 4.0;
        } else {
            sheet.note(subtitle);
        }
        sheet
    }

    /// Where the next thing goes.
    pub fn y(&self) -> f64 {
        self.y
    }

    /// Adds what is drawn from [`Sheet::y`] downwards, with its height.
    pub fn draw(&mut self, elements: impl IntoIterator<Item = Element>, height: f64) {
        self.body.extend(elements);
        self.y += height;
    }

    /// Adds a legend, in as many lines as it needs.
    pub fn legend(&mut self, entries: &[(Sign, String)]) {
        const GAP: f64 = 20.0;
        let mut x = MARGIN;
        self.y += LEADING;
        for (sign, text) in entries {
            let before = if matches!(sign, Sign::Line(..)) {
                36.0
            } else {
                18.0
            };
            let width = before + text_width(text, TEXT);
            if x > MARGIN && x + width > self.width - MARGIN {
                x = MARGIN;
                self.y += LEADING;
            }
            self.body.push(drawn(*sign, (x + 6.0, self.y - 4.0)));
            self.body
                .push(label((x + before, self.y), TEXT, Anchor::Start, text).fill(Paint::Ink));
            x += width + GAP;
        }
        self.y += 8.0;
    }

    /// Adds a paragraph.
    pub fn note(&mut self, text: &str) {
        for line in wrapped(text, TEXT, self.width - 2.0 * MARGIN) {
            self.body
                .push(label((MARGIN, self.y), TEXT, Anchor::Start, line).fill(Paint::Muted));
            self.y += LEADING;
        }
    }

    /// The text of the file.
    pub fn finish(self) -> String {
        let size = (self.width, self.y + MARGIN - 6.0);
        svg::document(size, &self.title, &self.description, self.body)
    }
}

fn drawn(sign: Sign, (x, y): (f64, f64)) -> Element {
    match sign {
        Sign::Area(paint) => svg::rect((x - 6.0, y - 6.0), (12.0, 12.0))
            .with("rx", 2.0)
            .fill(paint),
        Sign::Tint(paint) => drawn(Sign::Area(paint), (x, y)).with("fill-opacity", TINT),
        Sign::Line(paint, dashes) => {
            let line = svg::line((x - 6.0, y), (x + 22.0, y)).stroke(paint, 2.0);
            match dashes {
                "" => line,
                dashes => line.with("stroke-dasharray", dashes),
            }
        }
        Sign::Frame(paint) => svg::rect((x - 5.0, y - 5.0), (10.0, 10.0))
            .with("rx", 2.0)
            .with("fill", "none")
            .stroke(paint, 2.0),
        Sign::Disc(paint) => svg::circle((x, y), 5.0).fill(paint),
        Sign::Bar(paint) => svg::rect((x - 6.0, y - 2.0), (12.0, 4.0)).fill(paint),
        Sign::Diamond => diamond((x, y)),
    }
}

/// The mark of the start belief.
pub fn diamond((x, y): (f64, f64)) -> Element {
    const REACH: f64 = 6.0;
    let corners = [
        (x, y - REACH),
        (x + REACH, y),
        (x, y + REACH),
        (x - REACH, y),
    ];
    svg::through(&corners, true)
        .fill(Paint::Ink)
        .stroke(Paint::Paper, 1.5)
}

/// Lines of a text none of which, but for single long words, is wider than allowed.
fn wrapped(text: &str, size: f64, width: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line)
                if text_width(line, size) + text_width(" ", size) + text_width(word, size)
                    <= width =>
            {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}
