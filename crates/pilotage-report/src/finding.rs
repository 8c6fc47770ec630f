//! What a reproduction found: for each table and figure of the thesis what it says, what came out, and what to make of it.

use serde::{Deserialize, Serialize};

/// A report of many findings, ready to be rendered as a page or as Markdown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Version of pilotage that made it.
    pub version: String,
    /// Seed of every random number in it.
    pub seed: u64,
    /// Whether it was made with fewer seeds and episodes.
    pub quick: bool,
    /// Episodes to play, at the top of the page.
    pub recordings: Vec<Recording>,
    /// The algorithms, for a reader who has to choose one.
    pub algorithms: Vec<Algorithm>,
    /// The findings, in the order of the thesis.
    pub findings: Vec<Finding>,
}

/// An algorithm in a few words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Algorithm {
    /// Name.
    pub name: String,
    /// What it has to be told.
    pub needs: String,
    /// What it hands over.
    pub gives: String,
    /// When to choose it.
    pub choose: String,
    /// How far from the best known it is, from the findings of this report.
    pub gap: String,
}

/// A table or figure of the thesis, made again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What it is called on the command line and in links, such as `table-4.1`; lower case, no spaces.
    pub id: String,
    /// What it is, such as `Table 4.1: regions in each uncertainty level`.
    pub title: String,
    /// What the thesis says, in our words.
    pub thesis: String,
    /// Tables of what came out.
    pub tables: Vec<Table>,
    /// Pictures of what came out.
    pub figures: Vec<Figure>,
    /// What to make of it.
    pub verdict: Verdict,
    /// Why, in a sentence.
    pub why: String,
}

/// A table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<String>>,
}

/// A picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Figure {
    /// What it shows; it also describes the picture to those who cannot see it.
    pub caption: String,
    /// Its SVG.
    pub svg: String,
}

/// What to make of a number or picture of the thesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// It comes out as printed.
    Reproduced,
    /// It comes out if the text is read in one of several possible ways.
    UnderReading,
    /// It comes out otherwise.
    Contradicted,
    /// The text leaves out what would be needed to tell.
    NotDecidable,
}

impl Verdict {
    /// All verdicts.
    pub const ALL: [Self; 4] = [
        Self::Reproduced,
        Self::UnderReading,
        Self::Contradicted,
        Self::NotDecidable,
    ];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reproduced => "reproduced",
            Self::UnderReading => "reproduced under a stated reading",
            Self::Contradicted => "contradicted",
            Self::NotDecidable => "not decidable from the text",
        }
    }
}

/// An episode as it went, step by step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Recording {
    /// What it is called in links; lower case, no spaces.
    pub id: String,
    /// What it shows.
    pub title: String,
    /// What there is to see, in a sentence or two.
    pub about: String,
    /// Names of the state variables; one or two are drawn.
    pub states: Vec<String>,
    /// Least and greatest value of each variable to draw.
    pub bounds: Vec<(f64, f64)>,
    /// Places that pay: lower and upper corner, and what they are called.
    pub places: Vec<(Vec<f64>, Vec<f64>, String)>,
    /// Places no state can be in: lower and upper corner.
    pub blocked: Vec<(Vec<f64>, Vec<f64>)>,
    /// Walls as segments `((x1, y1), (x2, y2))`; of a single variable only `x1` counts.
    pub walls: Vec<((f64, f64), (f64, f64))>,
    /// The automaton's nodes by label, such as `EAST`, with its number first: `2 EAST`.
    pub nodes: Vec<String>,
    /// The steps, the first before anything was done.
    pub frames: Vec<Frame>,
}

/// A step of an episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Frame {
    /// The true state.
    pub state: Vec<f64>,
    /// The true hidden mode by name, or empty where there is only one.
    pub mode: String,
    /// What the agent believes: hypotheses, the likeliest first.
    pub hypotheses: Vec<Hypothesis>,
    /// Which of the hypotheses it acts on.
    pub valid: usize,
    /// Node the automaton is in.
    pub node: usize,
    /// Action it takes there; empty once the episode is over.
    pub action: String,
    /// What that step paid.
    pub reward: f64,
}

/// One Gaussian of a belief.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// Weight, in `[0, 1]`.
    pub weight: f64,
    /// Hidden mode by name, or empty where there is only one.
    pub mode: String,
    /// Mean.
    pub mean: Vec<f64>,
    /// Covariance, row by row.
    pub covariance: Vec<f64>,
}
