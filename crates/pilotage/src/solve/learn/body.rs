//! What a learner believes by what it knows of itself: no more of a model than its [body](Model::body).

use std::sync::Arc;

use crate::belief::{
    BeliefMdp, BeliefSpace, CellsKeeping, Codebook, Coded, CodedSpace, Keeping, Moments,
    SumKeeping, Updater,
};
use crate::error::Result;
use crate::model::{Interval, Model, TrackerKind};
use crate::solve::codebook::{Walk, meet};
use crate::solve::settings::{KEPT, ensure_count};

/// Strata are at least so far apart, in units of the logarithm of a standard deviation.
const APART: f64 = 0.12;

/// Most strata that a learner may be told to use.
const MOST_STRATA: (usize, &str) = (1_000, "1 to 1000");

/// How beliefs in full are read by a learner.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strata {
    /// Most of them.
    pub most: usize,
    /// Episodes of acting at random, in thought, among whose beliefs they are chosen.
    pub walks: usize,
    /// Seed of these.
    pub seed: u64,
}

impl Strata {
    /// # Errors
    /// [`crate::Error::Setting`] for numbers out of range.
    pub(crate) fn validate(&self) -> Result<()> {
        ensure_count("strata", self.most, 1, MOST_STRATA)?;
        ensure_count("walks", self.walks, 1, KEPT)
    }
}

/// The beliefs of a body: on uncertainty levels where these follow it, whatever tracker a model asks for that has more to it. Else in full,
/// and read as strata that are found by acting in thought.
///
/// # Errors
/// As [`BeliefMdp::check`] and [`CellsKeeping::new`].
pub(crate) fn beliefs(body: &Model, strata: Strata) -> Result<Box<dyn BeliefSpace>> {
    if body.is_linear() {
        let mdp = BeliefMdp::new(body);
        mdp.check()?;
        return Ok(Box::new(mdp));
    }
    Ok(Box::new(match body.tracker() {
        TrackerKind::Cells => {
            let keeping = Arc::new(CellsKeeping::new(body)?);
            in_full(body, keeping, Updater::Cells, strata)
        }
        _ => {
            let keeping = Arc::new(SumKeeping::new(body));
            in_full(body, keeping, Updater::Sum, strata)
        }
    }))
}

fn in_full<K: Keeping>(
    body: &Model,
    keeping: Arc<K>,
    updater: fn(Coded<K>) -> Updater,
    strata: Strata,
) -> CodedSpace {
    let (walk, walks) = (Walk::Blind, strata.walks);
    let met = meet(body, keeping.as_ref(), walk, walks, strata.seed);
    let moments: Vec<Moments> = met.into_iter().map(|met| met.moments).collect();
    let mut codebook = Codebook::new(body);
    codebook.represent(&moments, APART, strata.most);
    codebook.sort();
    let codebook = Arc::new(codebook);
    let updater = updater(Coded::new(body, keeping, Arc::clone(&codebook)));
    CodedSpace::new(body, updater, &codebook)
}

/// The variable that has no bounds, if there is one: learners measure by them.
pub(crate) fn unbounded(model: &Model) -> Option<&str> {
    let finite = |bounds: &Interval| bounds.width().is_finite();
    let unbounded = model
        .state
        .iter()
        .find(|variable| !finite(&variable.bounds));
    unbounded.map(|variable| variable.name.as_str())
}
