//! The bound where the filter is exact: a value of beliefs that is rounded up at every step.
//!
//! The state is linear, nothing stops it, and the agent always knows the mode, so that a belief is a mean and a variance along each
//! axis and moves as `m' = A m + B u + e`, `e` of the variance that the reading takes away. Backwards from the end of the episode,
//!
//! ```text
//! U_k(m) = max_a [ r(m, a) + discount * E U_(k-1)(A m + B u + e) + margin ]      at the points of a grid
//! U_k(m) = the linear interpolation of these, constant beyond the grid
//! ```
//!
//! is never below what any policy earns in `k` steps:
//!
//! - Rewards and expectations are exact: probabilities of boxes under a Gaussian, and those of a piecewise linear function.
//! - Between points a function `f` of which `f'' >= -M` lies at most `M h^2 / 8` above its interpolation along each axis. For a
//!   reward `M` follows from the jumps of what is paid. For the expectation it follows from how far the interpolated `U_(k-1)` bends
//!   downwards at its points, since averaging bends nothing further. Where a `max` bends, it bends upwards and costs nothing.
//! - Beyond the grid the value is at most what is paid there at most, and then the most of everything from there outwards.
//! - Covariances are only ever replaced by smaller ones ([`super::levels`]).
//! - After a start of several hypotheses, or a uniform one, the agent is told after its first step which was true.

mod backup;
mod lattice;
mod paid;
mod rewards;

use super::ceiling::Ceiling;
use super::frame::{AxisModel, Frame};
use super::law::Law;
use super::levels::{Levels, Variances};
use super::measure::common_measure;
use crate::model::{ActionId, ModeId, Then};
use crate::progress::Progress;
use crate::solve::grid::Axis;
use backup::Expected;
pub(super) use lattice::towards;
use lattice::{Targets, product};
use paid::{Effect, effects};
use rewards::Rewards;

/// Most sweeps; an episode that is longer begins them with the ceiling.
const MOST_SWEEPS: usize = 20_000;
/// Multiplications that all sweeps together may take.
const WORK: f64 = 1.2e10;

/// Fewest points to which an axis is cut down to save work.
const COARSEST: usize = 61;
/// Of a variable that there is not.
const NO_AXIS: Axis = Axis::stepped(0.0, 1.0, 1);
/// What is found.
pub(super) struct Found {
    pub value: f64,
    /// Whether every level is wide enough for the grid to follow its rewards.
    pub fine: bool,
}

/// The bound, or why the filter is not exact.
pub(super) fn bound(
    frame: &Frame,
    points: Option<usize>,
    observer: &dyn Progress,
) -> Result<Found, String> {
    let effects = effects(frame)?;
    let starts: Vec<Variances> = frame
        .starts
        .iter()
        .map(|start| match start.uniform {
            true => [0.0, 0.0],
            false => start.laws.map(|law| law.sd * law.sd),
        })
        .collect();
    let a = [frame.axes[0].a, frame.axes[1].a];
    let (most, fewer) = if frame.is_real(1) {
        (60, 12)
    } else {
        (600, 48)
    };
    let levels = |limit| {
        Levels::new(
            a,
            &frame.classes,
            &starts,
            limit,
            frame.model.episode.length,
        )
    };
    let mut planner = Planner::new(frame, effects, levels(most));
    let count = points.unwrap_or(if frame.is_real(1) { 601 } else { 2001 });
    planner.lay(count);
    if planner.work() > WORK {
        planner = Planner::new(frame, planner.effects, levels(fewer));
        planner.lay(count);
    }
    planner.coarsen(count, points);
    let value = planner.solve(observer);
    Ok(Found {
        value,
        fine: planner.is_fine(),
    })
}

struct Planner<'a> {
    frame: &'a Frame<'a>,
    effects: Vec<Vec<Effect>>,
    levels: Levels,
    lattice: [Axis; 2],
    ceiling: Ceiling,
    /// Levels that can be reached at each step up to when they no longer change, and from then on.
    reached: Vec<Vec<usize>>,
    late: Vec<usize>,
    /// `U`, by mode and level.
    values: Vec<Vec<f64>>,
    start_value: f64,
}

/// Everything about a level that no sweep changes.
struct Work {
    level: usize,
    /// By mode, then action.
    actions: Vec<Vec<Rewards>>,
    /// By class and axis: weights of the average over what a reading moves, empty where it moves nothing.
    kernels: Vec<[Vec<f64>; 2]>,
}

impl<'a> Planner<'a> {
    fn new(frame: &'a Frame<'a>, effects: Vec<Vec<Effect>>, levels: Levels) -> Self {
        let (reached, late) = reach(&levels, frame.model.restarts());
        Self {
            ceiling: Ceiling::new(frame.model),
            lattice: [NO_AXIS; 2],
            frame,
            effects,
            reached,
            late,
            values: Vec::new(),
            start_value: 0.0,
            levels,
        }
    }

    fn lay(&mut self, count: usize) {
        self.lattice = [self.axis(0, count), self.axis(1, count)];
    }

    /// Fewer points, if none are asked for and these are too much work.
    fn coarsen(&mut self, mut count: usize, points: Option<usize>) {
        while points.is_none() && count > COARSEST && self.work() > WORK {
            count = count * 4 / 5;
            self.lay(count);
        }
    }

    /// Whether the grid can follow the rewards of every level that is come back to.
    fn is_fine(&self) -> bool {
        let narrow = |&level: &usize, i: usize| {
            let predicted = self.levels.steps[level]
                .iter()
                .map(|step| step.predicted[i]);
            let least = predicted.fold(self.levels.variances[level][i], f64::min);
            least < 4.0 * self.lattice[i].step.powi(2)
        };
        let axes = (0..2).filter(|&i| self.frame.is_real(i));
        !axes
            .into_iter()
            .any(|i| self.late.iter().any(|level| narrow(level, i)))
    }

    /// Multiplications of all sweeps, about.
    fn work(&self) -> f64 {
        let length = self.frame.model.episode.length;
        let points = self.size() as f64;
        let discount = self.frame.model.discount;
        let sweeps = (length.min(MOST_SWEEPS) as f64).min(20.0 / (1.0 - discount).max(1e-9));
        let taps = |level: usize, class: usize, i: usize| {
            2.0 * 9.0 * self.spread(level, class)[i].sqrt() / self.lattice[i].step
        };
        let of_level = |&level: &usize| {
            let classes = 0..self.frame.classes.len();
            let smoothing: f64 = classes
                .map(|class| taps(level, class, 0) + taps(level, class, 1))
                .sum();
            self.effects.len() as f64 * (smoothing + 6.0 * self.frame.class_of.len() as f64)
        };
        let late: f64 = self.late.iter().map(of_level).sum();
        let early = self.reached.iter().take(length).flatten().map(of_level);
        points * (sweeps * late + early.sum::<f64>())
    }

    /// Variance of the next mean around where it is expected.
    fn spread(&self, level: usize, class: usize) -> Variances {
        let step = self.levels.steps[level][class];
        let left = step
            .next
            .map_or([0.0; 2], |next| self.levels.variances[next]);
        std::array::from_fn(|i| (step.predicted[i] - left[i]).max(0.0))
    }

    /// About so many points, a whole number of them to every displacement if that can be.
    fn axis(&self, i: usize, count: usize) -> Axis {
        if !self.frame.is_real(i) {
            return NO_AXIS;
        }
        let AxisModel { displacement, .. } = &self.frame.axes[i];
        let core = self.frame.core(i);
        let farthest = displacement.iter().fold(0.0, |x: f64, d| x.max(d.abs()));
        let variance = |&level: &usize| {
            let predicted = self.levels.steps[level]
                .iter()
                .map(|step| step.predicted[i]);
            predicted.fold(0.0, f64::max)
        };
        let sd = self.late.iter().map(variance).fold(0.0, f64::max).sqrt();
        let margin = (0.5 * core.width()).max(3.0 * farthest) + 4.0 * sd.min(core.width());
        let (low, width) = (core.low - margin, core.width() + 2.0 * margin);
        let coarse = width / (count.max(2) - 1) as f64;
        let step = match common_measure(displacement) {
            Some(measure) if measure >= coarse => measure / (measure / coarse).ceil(),
            _ => coarse,
        };
        Axis::stepped(low, step, (width / step).ceil() as usize + 1)
    }

    fn index(&self, mode: ModeId, level: usize) -> usize {
        mode * self.levels.variances.len() + level
    }

    fn sizes(&self) -> [usize; 2] {
        self.lattice.map(|axis| axis.count)
    }

    fn size(&self) -> usize {
        self.lattice[0].count * self.lattice[1].count
    }

    /// Backwards from the end of the episode.
    fn solve(&mut self, observer: &dyn Progress) -> f64 {
        let model = self.frame.model;
        let last = model.episode.length - 1;
        let settled = self.reached.len();
        let begin = last.min(settled + MOST_SWEEPS);
        let mut ceiling = self.ceiling.within(last - begin);
        let tables = self.frame.model.modes.len() * self.levels.variances.len();
        self.values = vec![vec![ceiling; self.size()]; tables];
        self.start_value = ceiling;
        let works: Vec<Work> = match begin >= settled.max(1) {
            true => self.late.iter().map(|&level| self.prepare(level)).collect(),
            false => Vec::new(),
        };
        let targets = self.targets();
        let mut time = begin;
        while time >= 1 {
            if time >= settled {
                let rise = self.sweep(&works, &targets, ceiling);
                observer.progress("bound", (begin - time) as u64 + 1, begin as u64);
                if let Some(further) = rise {
                    // What is left of the episode can add no more than this.
                    let late = self.late.clone();
                    for mode in 0..model.modes.len() {
                        for &level in &late {
                            let index = self.index(mode, level);
                            self.values[index].iter_mut().for_each(|v| *v += further);
                        }
                    }
                    self.start_value += further;
                    ceiling = self.ceiling.within(last - settled.min(time));
                    time = settled.min(time);
                    if time == 0 {
                        break;
                    }
                }
            } else {
                let early = self.reached[time].clone();
                let works: Vec<Work> = early.iter().map(|&level| self.prepare(level)).collect();
                self.sweep(&works, &targets, ceiling);
            }
            ceiling = self.ceiling.one_more(ceiling);
            time -= 1;
        }
        self.at_start(ceiling)
    }

    /// One step more for these levels. Once a step more changes next to nothing, the most that all further ones can add.
    fn sweep(&mut self, works: &[Work], targets: &[[Targets; 2]], ceiling: f64) -> Option<f64> {
        let modes = 0..self.frame.model.modes.len();
        let mut fresh = Vec::new();
        for work in works {
            let classes = self.frame.classes.len();
            let expected: Vec<Expected> = (0..modes.len() * classes)
                .map(|index| self.expect(index / classes, work, index % classes, ceiling))
                .collect();
            for mode in modes.clone() {
                let values = self.back_up(mode, work, &expected, targets, ceiling);
                fresh.push((self.index(mode, work.level), values));
            }
        }
        let start = self.at_start(ceiling);
        let mut rise = start - self.start_value;
        let mut change = rise.abs();
        if works.iter().any(|work| self.is_cut(work.level)) {
            rise = rise.max(self.ceiling.one_more(ceiling) - ceiling);
            change = change.max(rise);
        }
        let mut scale = start.abs();
        for (index, values) in fresh {
            for (new, old) in values.iter().zip(&self.values[index]) {
                change = change.max((new - old).abs());
                rise = rise.max(new - old);
                scale = scale.max(new.abs());
            }
            self.values[index] = values;
        }
        self.start_value = start;
        let discount = self.frame.model.discount;
        let most = |step: f64| step / (1.0 - discount);
        (discount < 1.0 && most(change) <= 1e-6 * scale).then(|| most(rise.max(0.0)))
    }

    fn is_cut(&self, level: usize) -> bool {
        self.levels.steps[level]
            .iter()
            .any(|step| step.next.is_none())
    }
    fn targets(&self) -> Vec<[Targets; 2]> {
        let targets = |i: usize, action: ActionId| {
            let (axis, of) = (self.lattice[i], &self.frame.axes[i]);
            let last = (axis.count - 1) as f64;
            let places: Vec<(usize, f64)> = (0..axis.count)
                .map(|point| {
                    let at = of.a * axis.at(point) + of.displacement[action];
                    let place = ((at - axis.low) / axis.step).clamp(0.0, last);
                    let nearest = place.round();
                    let place = match (place - nearest).abs() < 1e-7 {
                        true => nearest,
                        false => place,
                    };
                    let below = place.floor();
                    (below as usize, place - below)
                })
                .collect();
            let aligned = places.iter().all(|place| place.1 == 0.0);
            Targets { places, aligned }
        };
        (0..self.frame.class_of.len())
            .map(|action| [targets(0, action), targets(1, action)])
            .collect()
    }
    /// The value of the start: one action for all hypotheses, after which the agent is told which was true.
    fn at_start(&self, ceiling: f64) -> f64 {
        let worth = |action: ActionId| -> f64 {
            let starts = self.frame.starts.iter().zip(&self.levels.starts);
            starts
                .map(|(start, &level)| {
                    let effect = &self.effects[start.mode][action];
                    let class = self.frame.class_of[action];
                    let step = self.levels.steps[level][class];
                    let masses: [Vec<f64>; 2] =
                        std::array::from_fn(|i| start.laws[i].masses(&self.frame.axes[i].cuts));
                    let mut worth = effect.before.expectation(&masses[0], &masses[1]);
                    let moved = |i: usize, variance: f64| {
                        let of = &self.frame.axes[i];
                        // What is held about the mean itself: nothing for a uniform start, since that is told.
                        let law = Law {
                            sd: 0.0,
                            ..start.laws[i]
                        };
                        law.moved(of.a, of.displacement[action], variance)
                    };
                    if let Some(after) = &effect.after {
                        let masses: [Vec<f64>; 2] = std::array::from_fn(|i| {
                            moved(i, step.predicted[i]).masses(&self.frame.axes[i].cuts)
                        });
                        worth += after.expectation(&masses[0], &masses[1]);
                    }
                    let future = match (effect.then, step.next) {
                        (Then::End, _) => 0.0,
                        (Then::Restart, _) => self.start_value,
                        (Then::Continue, None) => ceiling,
                        (Then::Continue, Some(next)) => {
                            let spread = self.spread(level, class);
                            let weights: [Vec<f64>; 2] =
                                std::array::from_fn(|i| moved(i, spread[i]).hats(&self.lattice[i]));
                            product(&self.values[self.index(effect.mode, next)], &weights)
                        }
                    };
                    start.weight * (worth + self.frame.model.discount * future)
                })
                .sum()
        };
        (0..self.frame.class_of.len())
            .map(worth)
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Levels by step until what can still be reached no longer shrinks, and what can be reached from then on.
fn reach(levels: &Levels, restarts: bool) -> (Vec<Vec<usize>>, Vec<usize>) {
    let mut starts = levels.starts.clone();
    starts.sort_unstable();
    starts.dedup();
    if restarts {
        return (vec![starts.clone()], levels.closure(&levels.after(&starts)));
    }
    let mut reached = vec![starts];
    loop {
        let now = &reached[reached.len() - 1];
        let next = levels.after(now);
        let (all, fewer) = (levels.closure(now), levels.closure(&next));
        // The start itself is only ever one belief, and needs no grid.
        if all == fewer && reached.len() > 1 || next.is_empty() {
            let late = reached.pop().unwrap_or_default();
            return (reached, levels.closure(&late));
        }
        reached.push(next);
    }
}
