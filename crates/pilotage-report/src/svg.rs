//! A small SVG writer: elements with escaped text, colours by role, numbers of fixed form.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::palette::Paint;

/// Class of the root, so that the style of one drawing does not reach the page it is put in.
const ROOT: &str = "pilotage";
const FONTS: &str = "system-ui, -apple-system, 'Segoe UI', 'Helvetica Neue', Arial, sans-serif";

/// Which part of a shape a colour is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Part {
    Fill,
    Stroke,
}

impl Part {
    fn name(self) -> &'static str {
        match self {
            Self::Fill => "fill",
            Self::Stroke => "stroke",
        }
    }
}

/// An element with its attributes in the order given.
#[derive(Debug, Clone)]
pub struct Element {
    tag: &'static str,
    attributes: Vec<(&'static str, String)>,
    paints: Vec<(Part, Paint)>,
    content: Content,
}

#[derive(Debug, Clone)]
enum Content {
    Elements(Vec<Element>),
    Text(String),
}

/// The value of an attribute.
pub struct Value(String);

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self(number(value))
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self(value.to_owned())
    }
}

impl From<String> for Value {
    fn from(value: String) -> Self {
        Self(value)
    }
}

impl Element {
    /// An element without anything in it.
    pub fn new(tag: &'static str) -> Self {
        Self {
            tag,
            attributes: Vec::new(),
            paints: Vec::new(),
            content: Content::Elements(Vec::new()),
        }
    }

    /// With one attribute more.
    pub fn with(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.attributes.push((name, value.into().0));
        self
    }

    /// Filled with a colour.
    pub fn fill(mut self, paint: Paint) -> Self {
        self.paints.push((Part::Fill, paint));
        self
    }

    /// Drawn round with a colour and width.
    pub fn stroke(mut self, paint: Paint, width: f64) -> Self {
        self.paints.push((Part::Stroke, paint));
        self.with("stroke-width", width)
    }

    /// With one child more.
    pub fn child(mut self, child: Self) -> Self {
        self.extend([child]);
        self
    }

    /// With these children more.
    pub fn children(mut self, children: impl IntoIterator<Item = Self>) -> Self {
        self.extend(children);
        self
    }

    /// With this text, and nothing else, in it.
    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.content = Content::Text(text.into());
        self
    }

    fn extend(&mut self, more: impl IntoIterator<Item = Self>) {
        match &mut self.content {
            Content::Elements(elements) => elements.extend(more),
            Content::Text(_) => self.content = Content::Elements(more.into_iter().collect()),
        }
    }

    fn write(&self, out: &mut String, depth: usize) {
        let indent = " ".repeat(depth);
        let _ = write!(out, "{indent}<{}", self.tag);
        let classes: Vec<String> = self.paints.iter().map(|&paint| class(paint)).collect();
        if !classes.is_empty() {
            let _ = write!(out, " class=\"{}\"", classes.join(" "));
        }
        for (part, paint) in &self.paints {
            let _ = write!(out, " {}=\"{}\"", part.name(), paint.light());
        }
        for (name, value) in &self.attributes {
            let _ = write!(out, " {name}=\"{}\"", escaped(value));
        }
        match &self.content {
            Content::Text(text) => {
                let _ = writeln!(out, ">{}</{}>", escaped(text), self.tag);
            }
            Content::Elements(elements) if elements.is_empty() => out.push_str("/>\n"),
            Content::Elements(elements) => {
                out.push_str(">\n");
                for element in elements {
                    element.write(out, depth + 1);
                }
                let _ = writeln!(out, "{indent}</{}>", self.tag);
            }
        }
    }

    fn collect_paints(&self, found: &mut BTreeSet<(Part, Paint)>) {
        found.extend(&self.paints);
        if let Content::Elements(elements) = &self.content {
            for element in elements {
                element.collect_paints(found);
            }
        }
    }
}

/// The text of a file with a drawing of that size on paper of its own.
pub fn document(
    (width, height): (f64, f64),
    title: &str,
    description: &str,
    body: Vec<Element>,
) -> String {
    let paper = rect((0.0, 0.0), (width, height)).fill(Paint::Paper);
    let mut paints = BTreeSet::from([(Part::Fill, Paint::Paper)]);
    for element in &body {
        element.collect_paints(&mut paints);
    }
    let root = Element::new("svg")
        .with("xmlns", "http://www.w3.org/2000/svg")
        .with("class", ROOT)
        .with("role", "img")
        .with("width", width)
        .with("height", height)
        .with(
            "viewBox",
            format!("0 0 {} {}", number(width), number(height)),
        )
        .with("font-family", FONTS)
        .child(Element::new("title").text(title))
        .child(Element::new("desc").text(description))
        .child(Element::new("style").text(dark_style(&paints)))
        .child(paper)
        .children(body);
    let mut out = String::new();
    root.write(&mut out, 0);
    out
}

/// Attributes give the light colours and everyone understands them; this rule overrides them where a dark scheme is known.
fn dark_style(paints: &BTreeSet<(Part, Paint)>) -> String {
    let mut style = "@media (prefers-color-scheme: dark) {".to_owned();
    for &(part, paint) in paints {
        if paint.light() != paint.dark() {
            let class = class((part, paint));
            let _ = write!(
                style,
                " .{ROOT} .{class} {{ {}: {} }}",
                part.name(),
                paint.dark()
            );
        }
    }
    style + " }"
}

fn class((part, paint): (Part, Paint)) -> String {
    let prefix = match part {
        Part::Fill => "f",
        Part::Stroke => "s",
    };
    format!("{prefix}-{}", paint.name())
}

/// A number with at most two decimals; one that is not finite, which no caller should have, as 0.
pub fn number(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0;
    if rounded == 0.0 || !rounded.is_finite() {
        return "0".to_owned();
    }
    let text = format!("{rounded:.2}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Text as XML has it; characters that XML 1.0 forbids become the replacement character.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\t' | '\n' | '\r' => out.push(' '),
            '\0'..='\x1f' | '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

/// A rectangle by its upper left corner and size.
pub fn rect((x, y): (f64, f64), (width, height): (f64, f64)) -> Element {
    Element::new("rect")
        .with("x", x)
        .with("y", y)
        .with("width", width)
        .with("height", height)
}

/// A straight line.
pub fn line((x1, y1): (f64, f64), (x2, y2): (f64, f64)) -> Element {
    Element::new("line")
        .with("x1", x1)
        .with("y1", y1)
        .with("x2", x2)
        .with("y2", y2)
}

/// A circle.
pub fn circle((x, y): (f64, f64), radius: f64) -> Element {
    Element::new("circle")
        .with("cx", x)
        .with("cy", y)
        .with("r", radius)
}

/// A path or polygon through points, closed on request.
pub fn through(points: &[(f64, f64)], closed: bool) -> Element {
    let mut d = String::new();
    for (k, &(x, y)) in points.iter().enumerate() {
        let command = if k == 0 { 'M' } else { 'L' };
        let _ = write!(d, "{command}{} {}", number(x), number(y));
    }
    if closed {
        d.push('Z');
    }
    Element::new("path").with("d", d)
}

/// Which point of a text its position is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

/// A line of text; `y` is its baseline.
pub fn label((x, y): (f64, f64), size: f64, anchor: Anchor, text: impl Into<String>) -> Element {
    let element = Element::new("text")
        .with("x", x)
        .with("y", y)
        .with("font-size", size);
    let element = match anchor {
        Anchor::Start => element,
        Anchor::Middle => element.with("text-anchor", "middle"),
        Anchor::End => element.with("text-anchor", "end"),
    };
    element.text(text)
}

/// Width of a text in a wide sans-serif face, so that in any other it takes no more room. Bold takes a tenth more.
pub fn text_width(text: &str, size: f64) -> f64 {
    let ems: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '\'' | '|' => 0.28,
            ' ' | '.' | ',' | ':' | ';' | 'f' | 't' | 'r' | 'I' | 'J' | '·' | '!' | '/' | '-'
            | '(' | ')' | '[' | ']' => 0.4,
            'm' | 'W' | '%' | '@' | '…' | '—' => 1.0,
            'M' | 'w' | '+' | '=' | '<' | '>' | '±' | '−' | '≤' | '≥' | '→' | '×' | 'O' | 'Q'
            | 'G' | 'D' | 'H' | 'N' | '_' | '~' => 0.84,
            'a'..='z' | '0'..='9' | 'σ' | '–' | '?' | '"' => 0.64,
            c if c.is_ascii() => 0.74,
            c if c < '\u{1100}' => 0.8,
            _ => 1.1,
        })
        .sum();
    ems * size
}
