//! The decision process on strata and a grid of means, as sparse rows.

use super::GridValues;
use super::means::Means;
use super::meet::Met;
use crate::belief::{Codebook, Keeping, Moments};
use crate::parallel;
use crate::policy::first_best;

/// What an action is expected to do at a state: a stratum and a point of the grid.
#[derive(Debug, Clone, Default)]
struct Row {
    reward: f64,
    restarted: f64,
    /// Single precision is far finer than the readings are spread, and there are many.
    next: Vec<(u32, f32)>,
}

/// What is known of a state.
enum State {
    /// What each action is expected to do.
    Rows(Vec<Row>),
    /// What each action was worth in an earlier plan, where no belief came near.
    Worth(Vec<f64>),
}

/// What is known of all states.
pub(super) struct Rows {
    pub means: Means,
    /// Steps of an episode.
    length: usize,
    states: Vec<State>,
    actions: usize,
    /// Where an episode starts: states with weights.
    start: Vec<(u32, f32)>,
}

/// Most sweeps of value iteration.
const SWEEPS: usize = 5000;

/// Reads beliefs as states.
struct Reader<'a> {
    codebook: &'a Codebook,
    means: &'a Means,
    /// Steps of an episode.
    length: usize,
}

impl Reader<'_> {
    /// The states that a belief lies between, with weights that sum to 1.
    fn states(&self, moments: &Moments, code: &mut Vec<f64>, to: &mut Vec<(u32, f64)>, share: f64) {
        let points = self.means.len();
        let around = self.means.around(&moments.mean);
        for (stratum, weight) in self.codebook.between(moments, code) {
            for (point, part) in &around {
                to.push(((stratum * points + point) as u32, share * weight * part));
            }
        }
    }

    /// Which states beliefs that were met lie between.
    fn near<F>(&self, met: &[Met<F>]) -> Vec<bool> {
        let mut near = vec![false; self.codebook.len() * self.means.len()];
        let (mut code, mut states) = (Vec::new(), Vec::new());
        for met in met {
            states.clear();
            self.states(&met.moments, &mut code, &mut states, 1.0);
            for (state, _) in &states {
                near[*state as usize] = true;
            }
        }
        near
    }

    /// What an action leads to at a step.
    fn row<K: Keeping>(
        &self,
        keeping: &K,
        (full, step): (&K::Full, usize),
        action: usize,
        readings: usize,
    ) -> Row {
        let mut moved = full.clone();
        let acted = keeping.act(&mut moved, action, step);
        let goes_on = 1.0 - acted.ended - acted.restarted;
        let mut next = Vec::new();
        // Who tells steps apart knows the last one.
        let last = self.codebook.clock() > 0 && step + 1 >= self.length;
        if goes_on > 1e-12 && !last {
            let mut moments = Moments {
                step: step + 1,
                ..Moments::default()
            };
            let mut code = Vec::new();
            for (likely, sensed) in keeping.readings(&moved, action, step, readings) {
                if likely <= 0.0 {
                    continue;
                }
                let mut after = moved.clone();
                keeping.sense(&mut after, action, step, sensed.reading());
                keeping.moments(&after, &mut moments);
                self.states(&moments, &mut code, &mut next, goes_on * likely);
            }
        }
        Row {
            reward: acted.reward,
            restarted: acted.restarted,
            next: merged(next),
        }
    }
}

/// Entries of one state added up, those that do not count left out.
fn merged(mut entries: Vec<(u32, f64)>) -> Vec<(u32, f32)> {
    const NOTHING: f64 = 1e-9;
    entries.sort_by_key(|(state, _)| *state);
    entries.dedup_by(|(state, weight), (kept, sum)| {
        let same = state == kept;
        if same {
            *sum += *weight;
        }
        same
    });
    let kept = entries.iter().filter(|(_, weight)| *weight > NOTHING);
    kept.map(|&(state, weight)| (state, weight as f32))
        .collect()
}

impl Rows {
    /// The rows of a codebook, whose strata have the shapes of beliefs in full, for episodes of so many steps. Once there is a plan, rows are
    /// found only for the states that beliefs that were met lie between: elsewhere it stays as it is. Earlier rows on the same grid are taken
    /// over: strata stay what they are when others join them.
    pub(super) fn new<K: Keeping>(
        (keeping, coarse): (&K, &K),
        (codebook, shapes): (&Codebook, &[K::Full]),
        (means, length): (Means, usize),
        met: &[Met<K::Full>],
        readings: usize,
        (plan, earlier): (Option<&GridValues>, Option<Self>),
    ) -> Self {
        let reader = Reader {
            codebook,
            means: &means,
            length,
        };
        let actions = keeping.actions();
        let points = means.len();
        let states = codebook.len() * points;
        let stands = plan.map(|plan| (plan, reader.near(met)));
        let kept = |state: usize| {
            let known = earlier.as_ref().and_then(|rows| rows.states.get(state));
            matches!(known, Some(State::Rows(_)))
        };
        let of_state = |state: usize| -> Option<State> {
            if kept(state) {
                return None;
            }
            let mean = means.point(state % points);
            let stratum = codebook.stratum(state / points);
            if let Some((plan, near)) = &stands
                && !near[state]
            {
                return Some(State::Worth(plan.values_between(&stratum.at(mean))));
            }
            let full = coarse.moved_to(&shapes[state / points], &mean);
            let of_action =
                |action: usize| reader.row(coarse, (&full, stratum.step), action, readings);
            Some(State::Rows((0..actions).map(of_action).collect()))
        };
        let found = parallel::map(states, of_state);
        let mut earlier = earlier
            .map_or_else(Vec::new, |earlier| earlier.states)
            .into_iter();
        let states = found.into_iter().filter_map(|own| {
            let known = earlier.next();
            own.or(known)
        });
        let states = states.collect();
        let mut moments = Moments::default();
        keeping.moments(&keeping.start(), &mut moments);
        let mut start = Vec::new();
        reader.states(&moments, &mut Vec::new(), &mut start, 1.0);
        Self {
            states,
            actions,
            start: merged(start),
            means,
            length,
        }
    }

    /// Values of all actions in all states.
    pub(super) fn solve(&self, discount: f64, tolerance: f64) -> Vec<f64> {
        let states = self.states.len();
        let mut values = vec![0.0; states];
        for _ in 0..SWEEPS {
            let (mut change, mut largest) = (0.0_f64, 0.0_f64);
            for state in 0..states {
                let value = |action| self.value(&values, state, action, discount);
                let best = best_of((0..self.actions).map(value));
                change = change.max((best - values[state]).abs());
                largest = largest.max(best.abs());
                values[state] = best;
            }
            if change <= tolerance * largest {
                break;
            }
        }
        let all =
            (0..states).flat_map(|state| (0..self.actions).map(move |action| (state, action)));
        all.map(|(state, action)| self.value(&values, state, action, discount))
            .collect()
    }

    fn value(&self, values: &[f64], state: usize, action: usize, discount: f64) -> f64 {
        match &self.states[state] {
            State::Worth(worth) => worth[action],
            State::Rows(rows) => self.worth_of(&rows[action], values, discount),
        }
    }

    fn worth_of(&self, row: &Row, values: &[f64], discount: f64) -> f64 {
        let sum = |entries: &[(u32, f32)]| -> f64 {
            let entries = entries.iter();
            entries
                .map(|(state, weight)| f64::from(*weight) * values[*state as usize])
                .sum()
        };
        let afresh = match row.restarted > 0.0 {
            true => row.restarted * sum(&self.start),
            false => 0.0,
        };
        row.reward + discount * (sum(&row.next) + afresh)
    }

    /// The value of every state.
    fn best(&self, found: &[f64]) -> Vec<f64> {
        let best = |values: &[f64]| best_of(values.iter().copied());
        found.chunks(self.actions).map(best).collect()
    }

    /// By how much straight lines between points are off along each variable, on average over beliefs that were met. Where every second
    /// point is left out a point itself says it; lines half as long are off by a quarter of that.
    pub(super) fn bends<F>(&self, codebook: &Codebook, found: &[f64], met: &[Met<F>]) -> Vec<f64> {
        let values = self.best(found);
        let mut bends = vec![0.0; self.means.dim()];
        let mut code = Vec::new();
        for met in met {
            let stratum = codebook.nearest(&met.moments, &mut code);
            let point = self.means.nearest(&met.moments.mean);
            let at = |point: usize| values[stratum * self.means.len() + point];
            for (axis, bend) in bends.iter_mut().enumerate() {
                if let Some([before, after]) = self.means.beside(point, axis) {
                    *bend += 0.25 * (at(point) - 0.5 * (at(before) + at(after))).abs();
                }
            }
        }
        let count = met.len().max(1) as f64;
        bends.into_iter().map(|bend| bend / count).collect()
    }

    /// What the best actions are worth in every state over so many steps.
    fn over(&self, found: &[f64], discount: f64, steps: usize) -> Vec<f64> {
        let chosen: Vec<usize> = found.chunks(self.actions).map(first_best).collect();
        let mut values = vec![0.0; chosen.len()];
        for _ in 0..steps {
            let value = |state: usize| self.value(&values, state, chosen[state], discount);
            values = parallel::map(chosen.len(), value);
        }
        values
    }

    /// What the best action is worth at the start itself, over an episode.
    pub(super) fn worth<K: Keeping>(
        &self,
        keeping: &K,
        codebook: &Codebook,
        found: &[f64],
        discount: f64,
        readings: usize,
    ) -> f64 {
        let reader = Reader {
            codebook,
            means: &self.means,
            length: self.length,
        };
        let values = match discount.powi(self.length as i32) > NOTHING {
            true => self.over(found, discount, self.length - 1),
            false => self.best(found),
        };
        let start = keeping.start();
        let of = |action| {
            let row = reader.row(keeping, (&start, 0), action, FINE * readings);
            self.worth_of(&row, &values, discount)
        };
        best_of((0..self.actions).map(of))
    }
}

fn best_of(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, f64::max)
}

/// Less than this share of what is worth something after an episode is nothing at its start.
const NOTHING: f64 = 1e-3;

/// So many times as many readings are thought of at the start.
const FINE: usize = 10;
