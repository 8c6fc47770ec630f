//! Linear coordinates of a mean, in which the places of an automaton may be stated.

/// Most coordinates, so that a controller can keep them without allocating.
pub const MOST_COORDINATES: usize = 8;

/// Coordinates `w_1 . m, ..., w_k . m` of a mean `m`.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinates {
    /// What each is called.
    pub names: Vec<String>,
    /// The vectors `w_i`, each of length `n`; at least one, at most [`MOST_COORDINATES`].
    pub rows: Vec<Vec<f64>>,
}

impl Coordinates {
    /// Number of coordinates.
    pub(crate) fn count(&self) -> usize {
        self.rows.len()
    }

    /// Writes the coordinates of a mean (length `n`) to `target`, which is at least as long as there are coordinates.
    pub(crate) fn write(&self, mean: &[f64], target: &mut [f64]) {
        for (row, value) in self.rows.iter().zip(target) {
            *value = row.iter().zip(mean).map(|(w, m)| w * m).sum();
        }
    }

    /// The coordinates of a mean.
    pub(crate) fn of(&self, mean: &[f64]) -> Vec<f64> {
        let mut place = vec![0.0; self.count()];
        self.write(mean, &mut place);
        place
    }
}
