//! Beliefs met by acting.

use super::backup::Backup;
use super::point::{Point, VectorSet};
use crate::belief::{Cells, Keeping};
use crate::model::ActionId;
use crate::parallel;
use crate::random::{Rng, Role, stream, uniform};

/// Walks made at once. Their number tells which beliefs are found, so it does not depend on the threads there are.
const TOGETHER: usize = 32;

/// Evenly spread readings of which one is drawn.
const READINGS: usize = 64;

/// An action that was drawn is repeated with this probability, so that walks lead somewhere.
const AGAIN: f64 = 0.7;

/// A walk ends when what is still to come weighs less than this.
const SETTLED: f64 = 1e-3;

/// Walks that find nothing new for so many rounds of [`TOGETHER`] are given up.
const PATIENCE: usize = 4;

/// The beliefs that were met, kept apart from each other.
#[derive(Debug, Clone)]
pub(super) struct Met {
    pub(super) points: Vec<Point>,
    /// Least distance of two of them.
    apart: f64,
    /// Walks made so far.
    walks: u64,
}

impl Met {
    pub(super) fn new(start: Point, apart: f64) -> Self {
        Self {
            points: vec![start],
            apart,
            walks: 0,
        }
    }

    /// Walks until there are `most` beliefs, or nothing new is found.
    pub(super) fn collect(&mut self, walker: &Walker<'_>, most: usize) {
        let mut idle = 0;
        while self.points.len() < most && idle < PATIENCE {
            let first = self.walks;
            self.walks += TOGETHER as u64;
            let found = parallel::map(TOGETHER, |walk| walker.walk(first + walk as u64));
            let before = self.points.len();
            for belief in found.iter().flat_map(|walk| &walk.met) {
                if self.points.len() < most && self.is_new(belief) {
                    self.points.push(Point::new(belief.probabilities()));
                }
            }
            idle = if self.points.len() == before {
                idle + 1
            } else {
                0
            };
        }
    }

    fn is_new(&self, belief: &Cells) -> bool {
        let mut known = self.points.iter();
        known.all(|point| point.apart(belief) > self.apart)
    }
}

/// Acts in the model.
pub(super) struct Walker<'a> {
    pub(super) backup: &'a Backup,
    /// What to follow; nothing, for actions drawn at random.
    pub(super) vectors: Option<&'a VectorSet>,
    /// Probability of another action than the best.
    pub(super) exploration: f64,
    /// Steps of an episode.
    pub(super) length: usize,
    pub(super) seed: u64,
}

/// The beliefs of a walk.
struct Walk {
    met: Vec<Cells>,
    /// Whether it went on to the last step of an episode.
    lasts: bool,
}

impl Walker<'_> {
    /// What is expected after an episode of what it begins with, by so many walks; nothing if that is little.
    pub(super) fn beyond(&self, vectors: &VectorSet, walks: usize) -> f64 {
        let weight = self.backup.discount.powi(self.length as i32);
        if weight < SETTLED {
            return 0.0;
        }
        let left = parallel::map(walks, |number| {
            let walk = self.walk(number as u64);
            let last = walk.met.last().filter(|_| walk.lasts);
            last.map_or(0.0, |last| {
                vectors.best(&Point::new(last.probabilities())).1
            })
        });
        weight * left.iter().sum::<f64>() / walks as f64
    }

    /// One walk from the start.
    fn walk(&self, number: u64) -> Walk {
        let keeping = &*self.backup.keeping;
        let mut rng = stream(self.seed, number, Role::Planner);
        let mut full = keeping.start();
        let (mut met, mut lasts) = (Vec::new(), true);
        let (mut weight, mut drawn) = (1.0, None);
        for _ in 0..self.length {
            let action = self.action(&full, &mut drawn, &mut rng);
            let acted = keeping.act(&mut full, action, 0);
            weight *= self.backup.discount;
            let chance = uniform(&mut rng);
            if chance < acted.ended || weight < SETTLED {
                lasts = false;
                break;
            }
            if chance < acted.ended + acted.restarted {
                full = keeping.start();
                met.push(full.clone());
                continue;
            }
            self.sense(&mut full, action, &mut rng);
            met.push(full.clone());
        }
        Walk { met, lasts }
    }

    fn action(&self, full: &Cells, drawn: &mut Option<ActionId>, rng: &mut Rng) -> ActionId {
        let best = self.vectors.filter(|_| uniform(rng) >= self.exploration);
        if let Some(set) = best {
            let point = Point::new(full.probabilities());
            return set.vectors[set.best(&point).0].action;
        }
        let again = drawn.filter(|_| uniform(rng) < AGAIN);
        let actions = self.backup.keeping.actions();
        let action = again.unwrap_or_else(|| (uniform(rng) * actions as f64) as usize);
        *drawn = Some(action);
        action
    }

    fn sense(&self, full: &mut Cells, action: ActionId, rng: &mut Rng) {
        let keeping = &*self.backup.keeping;
        let readings = keeping.readings(full, action, 0, READINGS);
        let mut chance = uniform(rng);
        let heard = readings.iter().find(|(likely, _)| {
            chance -= likely;
            chance < 0.0
        });
        if let Some((_, sensed)) = heard.or(readings.last()) {
            keeping.sense(full, action, 0, sensed.reading());
        }
    }
}
