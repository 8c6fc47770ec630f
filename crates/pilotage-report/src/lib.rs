//! Pictures of policies and results, as SVG: automata, maps of the belief space, curves; recorded episodes; and reports made of
//! them, as a page, as Markdown and as data.
//!
//! Every function here that draws turns data into the text of one self-contained SVG file. The same data always gives the same text.
//! Colours are told apart by colour-blind readers and follow the reader's light or dark scheme; converters that know
//! nothing of schemes draw the light one.
//!
//! ```
//! use pilotage::{progress::Silent, scenario};
//! use pilotage::solve::{Request, ValueIteration, plan};
//! use pilotage_report::automaton_svg;
//!
//! let corridor = scenario::find("corridor-unbounded")?;
//! let solution = plan(&ValueIteration::default(), &corridor.model, &Request::default(), &Silent)?;
//! let automaton = solution.automaton().expect("the default form is an automaton");
//! assert!(automaton_svg(automaton)?.contains("EAST"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod automaton;
mod axes;
mod belief_map;
mod curve;
mod finding;
mod graph;
mod layout;
mod learning;
mod page;
mod palette;
mod plot;
mod record;
mod sheet;
mod svg;

#[cfg(test)]
mod tests;

pub use automaton::automaton_svg;
pub use belief_map::belief_map_svg;
pub use curve::{Series, curves_svg};
pub use finding::{
    Algorithm, Figure, Finding, Frame, Hypothesis, Recording, Report, Table, Verdict,
};
pub use graph::graph_svg;
pub use learning::{returns_svg, values_svg};
pub use page::{page_html, page_markdown, tables_csv};
pub use record::{Take, record};

use pilotage::policy::Place;

/// Whether a place has one number for each state variable. Segments may reach to infinity.
fn is_sound(place: &Place, states: usize) -> bool {
    match place {
        Place::Point(point) => point.len() == states && point.iter().all(|x| x.is_finite()),
        Place::Segment { lower, upper, .. } => {
            (lower.len(), upper.len()) == (states, states)
                && lower.iter().chain(upper).all(|x| !x.is_nan())
        }
    }
}
