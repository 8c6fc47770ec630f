//! What can go wrong in a command, and how it is shown.

use std::fmt::Write as _;
use std::io::Write as _;

use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource};
use pilotage::error::visible;
use pilotage::model::ModelError;

/// Why a command did not succeed.
pub enum Failure {
    /// A model file is missing or wrong.
    Model(Box<ModelError>),
    /// Planning, learning or running failed.
    Library(pilotage::Error),
    /// The command line asks for something that cannot be.
    Usage(String),
    /// Whoever read the output has gone.
    Closed,
    /// The output could not be written.
    Output(std::io::Error),
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        Self::Model(Box::new(error))
    }
}

impl From<pilotage::Error> for Failure {
    fn from(error: pilotage::Error) -> Self {
        Self::Library(error)
    }
}

impl From<pilotage_thesis::Error> for Failure {
    fn from(error: pilotage_thesis::Error) -> Self {
        match error {
            pilotage_thesis::Error::Model(error) => Self::Model(error),
            pilotage_thesis::Error::Library(error) => Self::Library(error),
            other => Self::Usage(other.to_string()),
        }
    }
}

impl From<std::io::Error> for Failure {
    fn from(error: std::io::Error) -> Self {
        if error.kind() == std::io::ErrorKind::BrokenPipe {
            Self::Closed
        } else {
            Self::Output(error)
        }
    }
}

impl Failure {
    /// The message for people, with the place in the file where there is one.
    pub fn render(&self) -> String {
        match self {
            Self::Model(error) => render_model(error),
            Self::Library(error) => format!("error: {}", visible(&error.to_string())),
            Self::Usage(message) => format!("error: {}", visible(message)),
            Self::Output(error) => format!("error: cannot write the output: {error}"),
            Self::Closed => String::new(),
        }
    }
}

fn render_model(error: &ModelError) -> String {
    let Some(place) = &error.place else {
        return format!("error: {}", visible(&error.to_string()));
    };
    let label = LabeledSpan::at(place.span.clone(), "here");
    let diagnostic = MietteDiagnostic::new(visible(&error.message))
        .with_help(visible(&error.hint))
        .with_label(label);
    let source = NamedSource::new(visible(&error.origin), masked(&error.text));
    let report = miette::Report::new(diagnostic).with_source_code(source);
    let terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
    let theme = if terminal {
        GraphicalTheme::unicode()
    } else {
        GraphicalTheme::unicode_nocolor()
    };
    let mut text = format!(
        "error: {}:{}:{}\n",
        visible(&error.origin),
        place.line,
        place.column
    );
    let drawn = GraphicalReportHandler::new_themed(theme)
        .with_links(false)
        .render_report(&mut text, report.as_ref());
    if drawn.is_err() {
        text.clear();
        let _ = write!(text, "error: {}", visible(&error.to_string()));
    }
    text
}

/// A text as it can be shown, byte for byte as long as it is, so that places in it stay where they are.
fn masked(text: &str) -> String {
    let mask = |character: char| {
        let mut one = [0; 4];
        let shown = visible(character.encode_utf8(&mut one)).len() == character.len_utf8();
        match character.len_utf8() {
            _ if shown => character,
            1 => '?',
            2 => '·',
            _ => '\u{fffd}',
        }
    };
    text.replace("\r\n", " \n").chars().map(mask).collect()
}

/// Prints a line on standard error. Where that cannot be written there is nobody left to tell.
pub fn say(line: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}
