//! Strata of beliefs that no level graph tells apart: everything about a belief but its mean, as one of finitely many.

use smallvec::{SmallVec, smallvec};

use super::full::Moments;
use super::{Belief, StratumId};
use crate::model::{Dynamics, Interval, ModeId, Model};

/// Strata that two beliefs lie between are told by their covariance and by how likely modes are and, where a model changes with the step of
/// the episode, by the step. Distances are measured between logarithms of standard deviations, correlations, and square roots of
/// probabilities.
#[derive(Debug, Clone, PartialEq)]
pub struct Codebook {
    strata: Vec<Stratum>,
    /// Standard deviations below which beliefs count as certain, length `n`.
    floors: Vec<f64>,
    /// Steps that are told apart.
    clock: usize,
}

/// Everything about a belief but its mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Stratum {
    /// Covariance, row by row, `n x n`.
    pub covariance: Vec<f64>,
    /// Probability of each mode; they sum to 1.
    pub weights: Vec<f64>,
    /// Step of the episode; 0 where steps are not told apart.
    pub step: usize,
    /// Where it is among strata.
    code: Vec<f64>,
    /// The same, with probabilities of modes as they are: those after readings are on average those before.
    average: Vec<f64>,
}

/// How far apart beliefs of certain and of even modes are, in the units of logarithms of standard deviations.
const MODES: f64 = 2.0;

/// How far apart beliefs at one step and at the next are, in the same units, where steps are told apart.
const STEP: f64 = 0.5;

/// A belief that is so many times narrower than the start, or than the bounds, is certain.
const CERTAIN: f64 = 1e-3;

/// So is one that is so many times narrower than what any step adds to it.
const HARDLY: f64 = 0.1;

/// Most beliefs that strata are brought near to, and most that they are chosen among.
const LOOKED_AT: usize = 4_000;
const CANDIDATES: usize = 400;

/// A belief lies between so many strata at most.
const BETWEEN: usize = 8;

/// What it costs to lie between strata that are far away, beside not lying where they are on average, both as squares.
const FARNESS: f64 = 0.05;

/// Times that weights are moved between all pairs of strata at most.
const EXCHANGES: usize = 20;

/// Weights that move by less have settled.
const SETTLED: f64 = 1e-4;

impl Stratum {
    /// The mode that is most likely, the first of several.
    pub fn mode(&self) -> ModeId {
        let heavier = |best: usize, mode: usize| match self.weights[mode] > self.weights[best] {
            true => mode,
            false => best,
        };
        (0..self.weights.len()).fold(0, heavier)
    }

    /// The moments of a belief of this stratum with a given mean.
    pub fn at(&self, mean: Vec<f64>) -> Moments {
        Moments {
            mean,
            covariance: self.covariance.clone(),
            weights: self.weights.clone(),
            step: self.step,
        }
    }

    /// How uncertain it is: the sum of logarithms of standard deviations.
    fn spread(&self) -> f64 {
        let n = (self.covariance.len() as f64).sqrt() as usize;
        self.code[..n].iter().sum()
    }

    /// What tells it from others in few numbers: how uncertain it is and, of several modes, how likely each is.
    fn traits(&self) -> impl Iterator<Item = f64> {
        let several = self.weights.len() > 1;
        let weights = self.weights.iter().copied().filter(move |_| several);
        std::iter::once(self.spread()).chain(weights)
    }
}

impl Codebook {
    /// A codebook for a model of strata to be added.
    pub fn new(model: &Model) -> Self {
        let stirred = stirred(model);
        let floor = |i: usize| {
            let starts = model.start.iter();
            let widest = starts.map(|start| start.covariance[(i, i)].max(0.0).sqrt());
            let width = model.state[i].bounds.width();
            let width = if width.is_finite() { 0.1 * width } else { 0.0 };
            let floor = CERTAIN * widest.fold(width, f64::max).max(f64::MIN_POSITIVE);
            floor.max(HARDLY * stirred[i])
        };
        Self {
            strata: Vec::new(),
            floors: (0..model.state_dim()).map(floor).collect(),
            clock: model.clock(),
        }
    }

    /// The codebook of strata of given covariances, probabilities of modes and steps, in this order, that tells apart the steps up to
    /// `clock` ([`Model::clock`]).
    pub fn of(
        floors: Vec<f64>,
        clock: usize,
        strata: impl IntoIterator<Item = (Vec<f64>, Vec<f64>, usize)>,
    ) -> Self {
        let mut codebook = Self {
            strata: Vec::new(),
            floors,
            clock,
        };
        for (covariance, weights, step) in strata {
            codebook.add(&Moments {
                mean: Vec::new(),
                covariance,
                weights,
                step,
            });
        }
        codebook
    }

    /// Steps up to which strata are told apart by the step; 0 where they are not.
    pub fn clock(&self) -> usize {
        self.clock
    }

    /// Number of strata.
    pub fn len(&self) -> usize {
        self.strata.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.strata.is_empty()
    }

    /// A stratum.
    pub fn stratum(&self, stratum: StratumId) -> &Stratum {
        &self.strata[stratum]
    }

    /// Standard deviations below which beliefs count as certain, length `n`.
    pub fn floors(&self) -> &[f64] {
        &self.floors
    }

    /// Adds the stratum of a belief.
    pub fn add(&mut self, moments: &Moments) {
        let mut code = Vec::new();
        self.write_code(moments, &mut code);
        let mut average = code.clone();
        self.even_modes(moments, &mut average);
        self.strata.push(Stratum {
            covariance: moments.covariance.clone(),
            weights: moments.weights.clone(),
            step: moments.step.min(self.clock),
            code,
            average,
        });
    }

    /// Adds strata of beliefs, the one that is farthest from all strata so far first, until all are nearer than `apart` or there are
    /// `most`. Returns which beliefs these are, in the order of their strata.
    pub fn cover(&mut self, met: &[Moments], apart: f64, most: usize) -> Vec<usize> {
        let mut codes = vec![Vec::new(); met.len()];
        for (moments, code) in met.iter().zip(&mut codes) {
            self.write_code(moments, code);
        }
        let mut gaps: Vec<f64> = codes.iter().map(|code| self.gap(code)).collect();
        let mut added = Vec::new();
        while self.strata.len() < most {
            let farthest =
                (0..met.len()).max_by(|&a, &b| gaps[a].total_cmp(&gaps[b]).then(b.cmp(&a)));
            let Some(farthest) = farthest.filter(|&i| gaps[i] > apart) else {
                break;
            };
            let chosen = codes[farthest].clone();
            for (gap, code) in gaps.iter_mut().zip(&codes) {
                *gap = gap.min(distance(code, &chosen));
            }
            self.add(&met[farthest]);
            added.push(farthest);
        }
        added
    }

    /// Adds strata of beliefs, each time the one by which beliefs come nearest to a stratum on the whole, until all are nearer than `apart` or
    /// there are `most`: what is met often counts more than what is far from everything.
    pub(crate) fn represent(&mut self, met: &[Moments], apart: f64, most: usize) {
        let sample = |size: usize| met.iter().step_by(met.len().div_ceil(size).max(1));
        let coded = |moments: &Moments| {
            let mut code = Vec::new();
            self.write_code(moments, &mut code);
            code
        };
        let codes: Vec<Vec<f64>> = sample(LOOKED_AT).map(coded).collect();
        let candidates: Vec<(&Moments, Vec<f64>)> = sample(CANDIDATES)
            .map(|moments| (moments, coded(moments)))
            .collect();
        let mut gaps: Vec<f64> = codes.iter().map(|code| self.gap(code)).collect();
        while self.strata.len() < most && gaps.iter().any(|gap| *gap > apart) {
            let left = |(_, code): &(&Moments, Vec<f64>)| -> f64 {
                let pairs = gaps.iter().zip(&codes);
                pairs
                    .map(|(gap, other)| gap.min(distance(code, other)))
                    .sum()
            };
            let left: Vec<f64> = candidates.iter().map(left).collect();
            let best = (0..left.len()).min_by(|&a, &b| left[a].total_cmp(&left[b]));
            // None of the candidates brings anything nearer.
            let Some(best) = best.filter(|&best| left[best] < gaps.iter().sum()) else {
                break;
            };
            let (moments, code) = &candidates[best];
            for (gap, other) in gaps.iter_mut().zip(&codes) {
                *gap = gap.min(distance(code, other));
            }
            self.add(moments);
        }
    }

    /// Orders strata by their most likely mode, and from wide to narrow within it, as uncertainty levels are.
    pub fn sort(&mut self) {
        self.strata.sort_by(|a, b| {
            let spread = b.spread().total_cmp(&a.spread());
            a.mode().cmp(&b.mode()).then(spread)
        });
    }

    /// A belief's mean and the traits of its stratum.
    pub(crate) fn place(&self, belief: &Belief) -> Vec<f64> {
        let traits = self.strata[belief.stratum].traits();
        belief.mean.iter().copied().chain(traits).collect()
    }

    /// What traits lie between.
    pub(crate) fn trait_bounds(&self) -> Vec<Interval> {
        let spreads = || self.strata.iter().map(Stratum::spread);
        let (low, high) = (
            spreads().fold(f64::INFINITY, f64::min),
            spreads().fold(f64::NEG_INFINITY, f64::max),
        );
        // All the same is between anything.
        let spread = match high > low {
            true => Interval::new(low, high),
            false => Interval::new(low - 1.0, low + 1.0),
        };
        let modes = self
            .strata
            .first()
            .map_or(0, |first| first.traits().count() - 1);
        let unit = std::iter::repeat_n(Interval::new(0.0, 1.0), modes);
        std::iter::once(spread).chain(unit).collect()
    }

    /// The stratum that is nearest to a belief; `code` is room.
    pub fn nearest(&self, moments: &Moments, code: &mut Vec<f64>) -> StratumId {
        self.write_code(moments, code);
        let mut best = (0, f64::INFINITY);
        for (id, stratum) in self.strata.iter().enumerate() {
            let apart = square_distance(code, &stratum.code);
            if apart < best.1 {
                best = (id, apart);
            }
        }
        best.0
    }

    /// The strata that a belief lies between, at most eight, with weights that sum to 1: on average they are as the belief is, as far
    /// as that can be, and as near to it as that allows. Were they narrower on average, planners would think that beliefs become
    /// narrower by themselves.
    pub fn between(&self, moments: &Moments, code: &mut Vec<f64>) -> Vec<(StratumId, f64)> {
        self.write_code(moments, code);
        let mut near: SmallVec<[(StratumId, f64); BETWEEN + 1]> = SmallVec::new();
        for (id, stratum) in self.strata.iter().enumerate() {
            let apart = square_distance(code, &stratum.code);
            if near
                .get(BETWEEN - 1)
                .is_some_and(|(_, last)| *last <= apart)
            {
                continue;
            }
            let place = near.partition_point(|(_, known)| *known <= apart);
            near.insert(place, (id, apart));
            near.truncate(BETWEEN);
        }
        let corners: SmallVec<[&[f64]; BETWEEN]> = near
            .iter()
            .map(|(id, _)| self.strata[*id].average.as_slice())
            .collect();
        self.even_modes(moments, code);
        let weights = barycentric(&corners, code);
        let shares = near.into_iter().map(|(id, _)| id).zip(weights);
        shares.filter(|(_, weight)| *weight > 0.0).collect()
    }

    /// How far a code is from all strata.
    fn gap(&self, code: &[f64]) -> f64 {
        let strata = self.strata.iter();
        strata
            .map(|stratum| distance(code, &stratum.code))
            .fold(f64::INFINITY, f64::min)
    }

    fn write_code(&self, moments: &Moments, code: &mut Vec<f64>) {
        let n = self.floors.len();
        let variance = |i: usize| moments.covariance[i * n + i].max(0.0) + self.floors[i].powi(2);
        code.clear();
        code.extend((0..n).map(|i| 0.5 * variance(i).ln()));
        for i in 0..n {
            for j in 0..i {
                code.push(moments.covariance[i * n + j] / (variance(i) * variance(j)).sqrt());
            }
        }
        if moments.weights.len() > 1 {
            code.extend(
                moments
                    .weights
                    .iter()
                    .map(|weight| MODES * weight.max(0.0).sqrt()),
            );
        }
        if self.clock > 0 {
            code.push(STEP * moments.step.min(self.clock) as f64);
        }
    }

    /// Turns square roots of probabilities in a code into the probabilities themselves.
    fn even_modes(&self, moments: &Moments, code: &mut [f64]) {
        let modes = moments.weights.len();
        if modes > 1 {
            let end = code.len() - usize::from(self.clock > 0);
            let roots = code[end - modes..end].iter_mut();
            for (root, weight) in roots.zip(&moments.weights) {
                *root = MODES * weight;
            }
        }
    }
}

/// The least standard deviations of the noise that any action in any mode adds to where one may start, length `n`.
fn stirred(model: &Model) -> Vec<f64> {
    let n = model.state_dim();
    let dynamics = Dynamics::new(model);
    let mut least = vec![f64::INFINITY; n];
    let mut noise = vec![0.0; n * n];
    for start in &model.start {
        for doing in dynamics.doings() {
            dynamics.transition_noise(doing, start.mean.as_slice(), &mut noise);
            for (i, least) in least.iter_mut().enumerate() {
                *least = least.min(noise[i * n + i].max(0.0).sqrt());
            }
        }
    }
    least
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    square_distance(a, b).sqrt()
}

fn square_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// Of the strata that a belief lies between.
type Weights = SmallVec<[f64; BETWEEN]>;

/// Weights of corners, the nearest first, that sum to 1 and are none below 0: those with the least `|sum w c - at|^2 + FARNESS sum w |c - at|^2`,
/// found by moving weight from one corner to another as far as that gains anything.
fn barycentric(corners: &[&[f64]], at: &[f64]) -> Weights {
    // Loops whose lengths are known are unrolled.
    match at.len() {
        1 => barycentric_in(1, corners, at),
        3 => barycentric_in(3, corners, at),
        dim => barycentric_in(dim, corners, at),
    }
}

#[inline(always)]
fn barycentric_in(dim: usize, corners: &[&[f64]], at: &[f64]) -> Weights {
    let count = corners.len();
    let corners = corners.iter().map(|corner| &corner[..dim]);
    let offsets = corners.flat_map(|corner| corner.iter().zip(&at[..dim]).map(|(c, x)| c - x));
    let offsets: SmallVec<[f64; 4 * BETWEEN]> = offsets.collect();
    let offset = |i: usize| &offsets[i * dim..(i + 1) * dim];
    let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let squares: Weights = (0..count).map(|i| product(offset(i), offset(i))).collect();
    let mut weights: Weights = smallvec![0.0; count];
    if let Some(nearest) = weights.first_mut() {
        *nearest = 1.0;
    }
    let mut off: SmallVec<[f64; 8]> = offsets.iter().copied().take(dim).collect();
    for _ in 0..EXCHANGES {
        let mut most: f64 = 0.0;
        for i in 0..count {
            for j in 0..i {
                // Where nothing is, nothing can be moved.
                if weights[i] == 0.0 && weights[j] == 0.0 {
                    continue;
                }
                let (to, from) = (offset(i), offset(j));
                let between = square_distance(to, from);
                if between <= 0.0 {
                    continue;
                }
                let slope = product(&off[..dim], to) - product(&off[..dim], from)
                    + 0.5 * FARNESS * (squares[i] - squares[j]);
                let moved = (-slope / between).max(-weights[i]).min(weights[j]);
                if moved == 0.0 {
                    continue;
                }
                weights[i] = (weights[i] + moved).max(0.0);
                weights[j] = (weights[j] - moved).max(0.0);
                for ((off, a), b) in off[..dim].iter_mut().zip(to).zip(from) {
                    *off += moved * (a - b);
                }
                most = most.max(moved.abs());
            }
        }
        if most < SETTLED {
            break;
        }
    }
    weights
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_belief_is_as_the_strata_that_it_lies_between(
            corners in proptest::collection::vec(proptest::collection::vec(-1.0..1.0_f64, 3), 1..9),
            shares in proptest::collection::vec(0.0..1.0_f64, 8),
        ) {
            let total: f64 = shares[..corners.len()].iter().sum();
            prop_assume!(total > 0.1);
            let at: Vec<f64> = (0..3)
                .map(|i| corners.iter().zip(&shares).map(|(c, w)| w / total * c[i]).sum())
                .collect();
            let mut corners: Vec<&[f64]> = corners.iter().map(Vec::as_slice).collect();
            corners.sort_by(|a, b| distance(a, &at).total_cmp(&distance(b, &at)));
            let weights = barycentric(&corners, &at);
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            prop_assert!(weights.iter().all(|weight| *weight >= -1e-12));
            let mean: Vec<f64> = (0..3)
                .map(|i| corners.iter().zip(&weights).map(|(c, w)| w * c[i]).sum())
                .collect();
            // No worse than the nearest alone would be.
            let far: f64 = corners
                .iter()
                .zip(&weights)
                .map(|(c, w)| w * distance(c, &at).powi(2))
                .sum();
            let cost = distance(&mean, &at).powi(2) + FARNESS * far;
            let nearest = distance(corners[0], &at).powi(2);
            prop_assert!(cost <= (1.0 + FARNESS) * nearest + 1e-12);
        }
    }

    #[test]
    fn halfway_between_two_is_half_of_each() {
        let corners: [&[f64]; 3] = [&[0.0, 0.0], &[1.0, 0.0], &[5.0, 0.0]];
        let weights = barycentric(&corners, &[0.5, 0.0]);
        assert!((weights[0] - 0.5).abs() < 1e-3, "{weights:?}");
        assert!((weights[1] - 0.5).abs() < 1e-3, "{weights:?}");
        // Outside of all it is the nearest.
        assert_eq!(
            barycentric(&corners, &[-1.0, 0.0]).as_slice(),
            [1.0, 0.0, 0.0]
        );
        // A third of the way: nearly so, as what is far counts against itself.
        let weights = barycentric(&corners, &[1.0 / 3.0, 0.0]);
        assert!((weights[1] - 1.0 / 3.0).abs() < 0.02, "{weights:?}");
    }

    fn of_deviation(deviation: f64) -> Moments {
        Moments {
            mean: vec![0.0],
            covariance: vec![deviation * deviation],
            weights: vec![1.0],
            step: 0,
        }
    }

    /// Forty beliefs like one, thirty like another, and a stray.
    #[test]
    fn what_is_met_often_is_represented_before_what_is_far_from_everything() {
        let mut met = vec![of_deviation(1.0); 40];
        met.extend(vec![of_deviation(3.0); 30]);
        met.push(of_deviation(1e-3));
        let empty = || Codebook::of(vec![1e-6], 0, []);
        let variances = |codebook: &Codebook| -> Vec<f64> {
            let strata = (0..codebook.len()).map(|id| codebook.stratum(id));
            strata.map(|stratum| stratum.covariance[0]).collect()
        };
        let mut often = empty();
        often.represent(&met, 0.1, 2);
        assert_eq!(variances(&often), [1.0, 9.0]);
        let mut far = empty();
        far.cover(&met, 0.1, 2);
        assert!(variances(&far).contains(&1e-6));
        // All are near one: no more are needed.
        often.represent(&met, 0.1, 10);
        assert_eq!(often.len(), 3);
    }
}
