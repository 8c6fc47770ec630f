//! What can go wrong in a command, and how it is shown.

use std::fmt::Write as _;

use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource};
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
            Self::Library(error) => format!("error: {error}"),
            Self::Usage(message) => format!("error: {message}"),
            Self::Output(error) => format!("error: cannot write the output: {error}"),
            Self::Closed => String::new(),
        }
    }
}

fn render_model(error: &ModelError) -> String {
    let Some(place) = &error.place else {
        return format!("error: {error}");
    };
    let label = LabeledSpan::at(place.span.clone(), "here");
    let diagnostic = MietteDiagnostic::new(error.message.clone())
        .with_help(error.hint.clone())
        .with_label(label);
    let source = NamedSource::new(&*error.origin, error.text.to_string());
    let report = miette::Report::new(diagnostic).with_source_code(source);
    let terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
    let theme = if terminal {
        GraphicalTheme::unicode()
    } else {
        GraphicalTheme::unicode_nocolor()
    };
    let mut text = format!("error: {}:{}:{}\n", error.origin, place.line, place.column);
    let drawn = GraphicalReportHandler::new_themed(theme)
        .with_links(false)
        .render_report(&mut text, report.as_ref());
    if drawn.is_err() {
        text.clear();
        let _ = write!(text, "error: {error}");
    }
    text
}
