//! Rounds of backups, each until the value of every belief that was met is at least what it was.

use std::sync::Arc;

use super::backup::Backup;
use super::point::{Point, ValueVector, VectorSet};
use crate::parallel;
use crate::random::{Rng, uniform};

/// Beliefs backed up at once. Each may spare the next ones, so there are few, and as many whatever the threads.
const TOGETHER: usize = 4;

/// A round ends after so many backups in a row that gained nothing at their own belief.
const PATIENCE: usize = 64;

/// What a round of backups came to.
pub(super) struct Improved {
    pub(super) set: VectorSet,
    /// Largest gain at a belief.
    pub(super) gain: f64,
}

/// One round: M. T. J. Spaan and N. Vlassis, "Perseus: randomized point-based value iteration for POMDPs", 2005. The start is always
/// backed up, the others are drawn of those not yet improved. There only is an improvement where something is gained: on a plateau, where
/// the first backup is as good as what there was everywhere, nothing would ever be found otherwise.
pub(super) fn improve(
    backup: &Backup,
    points: &[Point],
    set: &VectorSet,
    least: f64,
    rng: &mut Rng,
) -> Improved {
    let mut round = Round::new(points, set, least);
    let mut fruitless = 0;
    while !round.left.is_empty() && fruitless < PATIENCE {
        let chosen = round.chosen(rng);
        let made = parallel::map(chosen.len(), |i| {
            let point = &points[chosen[i]];
            let choice = backup.choose(point, set);
            backup.vector(&choice, set)
        });
        for (point, vector) in chosen.into_iter().zip(made) {
            let gains = round.take(point, vector);
            fruitless = if gains { 0 } else { fruitless + 1 };
        }
    }
    round.close(backup, set)
}

/// Values of points in a round.
struct Round<'a> {
    points: &'a [Point],
    /// The best vector of before, and its value.
    old: Vec<(usize, f64)>,
    new: Vec<f64>,
    vectors: Vec<Arc<ValueVector>>,
    /// Points at which nothing has been gained yet.
    left: Vec<usize>,
    /// What counts as a gain.
    least: f64,
}

impl<'a> Round<'a> {
    fn new(points: &'a [Point], set: &VectorSet, least: f64) -> Self {
        Self {
            old: parallel::map(points.len(), |point| set.best(&points[point])),
            new: vec![f64::NEG_INFINITY; points.len()],
            vectors: Vec::new(),
            left: (0..points.len()).collect(),
            least,
            points,
        }
    }

    /// The next points to be backed up.
    fn chosen(&self, rng: &mut Rng) -> Vec<usize> {
        let mut rest = self.left.clone();
        let mut chosen = Vec::with_capacity(TOGETHER);
        while chosen.len() < TOGETHER && !rest.is_empty() {
            // The start comes first as long as there is no vector.
            let next = match self.vectors.is_empty() && chosen.is_empty() {
                true => 0,
                false => (uniform(rng) * rest.len() as f64) as usize,
            };
            chosen.push(rest.swap_remove(next));
        }
        chosen
    }

    /// Takes in the backup of a point; whether it gains there.
    fn take(&mut self, point: usize, vector: ValueVector) -> bool {
        let value = self.points[point].expected(&vector.values);
        let gains = value > self.old[point].1 + self.least;
        let needed = self.new[point] < self.old[point].1 + self.least;
        self.left.retain(|left| *left != point);
        if gains && needed {
            self.add(Arc::new(vector));
        }
        gains
    }

    fn add(&mut self, vector: Arc<ValueVector>) {
        let values = parallel::map(self.points.len(), |point| {
            self.points[point].expected(&vector.values)
        });
        for (new, value) in self.new.iter_mut().zip(values) {
            *new = new.max(value);
        }
        let (new, old, least) = (&self.new, &self.old, self.least);
        self.left
            .retain(|point| new[*point] <= old[*point].1 + least);
        self.vectors.push(vector);
    }

    /// Points that are worth less than before keep the vector that they had.
    fn close(mut self, backup: &Backup, set: &VectorSet) -> Improved {
        for point in 0..self.points.len() {
            if self.new[point] < self.old[point].1 {
                self.add(set.vectors[self.old[point].0].clone());
            }
        }
        let gains = self.new.iter().zip(&self.old);
        Improved {
            gain: gains.map(|(new, (_, old))| new - old).fold(0.0, f64::max),
            set: VectorSet::new(self.vectors, &backup.start),
        }
    }
}
