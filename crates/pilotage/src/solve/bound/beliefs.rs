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

use super::ceiling::Ceiling;
use super::frame::{AxisModel, Frame, inside};
use super::law::{Law, crowding, kernel};
use super::levels::{Levels, Variances};
use super::measure::common_measure;
use super::step::{self, after, before, restarts};
use crate::model::{ActionId, ModeId, Then};
use crate::observe::Observer;
use crate::parallel;
use crate::solve::grid::Axis;

/// Most sweeps; an episode that is longer begins them with the ceiling.
const MOST_SWEEPS: usize = 20_000;
/// Multiplications that all sweeps together may take.
const WORK: f64 = 1.2e10;

/// Fewest points to which an axis is cut down to save work.
const COARSEST: usize = 61;
/// Of a variable that there is not.
const NO_AXIS: Axis = Axis {
    low: 0.0,
    step: 1.0,
    count: 1,
};

/// What is paid, constant in each cell between the cuts of both axes; the second axis runs faster.
#[derive(Debug, Clone)]
struct Paid {
    values: Vec<f64>,
    columns: usize,
}

impl Paid {
    fn rows(&self) -> usize {
        self.values.len() / self.columns
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }

    fn expectation(&self, rows: &[f64], columns: &[f64]) -> f64 {
        let row = |row: usize| {
            let values = &self.values[row * self.columns..(row + 1) * self.columns];
            values.iter().zip(columns).map(|(v, p)| v * p).sum::<f64>()
        };
        rows.iter().enumerate().map(|(i, p)| p * row(i)).sum()
    }

    /// The most that its values along one axis jump, all jumps together.
    fn jumps(&self, axis: usize) -> f64 {
        let (along, across) = match axis {
            0 => (self.rows(), self.columns),
            _ => (self.columns, self.rows()),
        };
        let value = |i: usize, j: usize| match axis {
            0 => self.at(i, j),
            _ => self.at(j, i),
        };
        let of_line = |j| -> f64 {
            (1..along)
                .map(|i| (value(i, j) - value(i - 1, j)).abs())
                .sum()
        };
        (0..across).map(of_line).fold(0.0, f64::max)
    }

    /// By cell of the other axis, the most that is expected of beliefs whose mean along an axis is at its edge or farther out.
    fn beyond(&self, axis: usize, reach: &Reach) -> Vec<f64> {
        let line = |j: usize| {
            let value = |i: usize| match axis {
                0 => self.at(i, j),
                _ => self.at(j, i),
            };
            reach.most(&(0..reach.masses.len()).map(value).collect::<Vec<_>>())
        };
        let across = [self.columns, self.rows()][axis];
        (0..across).map(line).collect()
    }
}

/// Beliefs from the edge of the grid outwards along an axis.
struct Reach {
    /// Probabilities of the cells at the edge.
    masses: Vec<f64>,
    /// Whether the probability of a cell only falls from there on.
    falls: Vec<bool>,
}

impl Reach {
    /// The most that can be expected of something constant in each cell.
    fn most(&self, values: &[f64]) -> f64 {
        let cells = || values.iter().zip(&self.masses).zip(&self.falls);
        let outer = cells().filter(|(_, falls)| !**falls);
        let most = outer.fold(f64::NEG_INFINITY, |most, ((value, _), _)| most.max(*value));
        let inner = cells().filter(|(_, falls)| **falls);
        most + inner
            .map(|((value, mass), _)| (value - most).max(0.0) * mass)
            .sum::<f64>()
    }
}

/// What an action does in a mode, the same wherever the state is.
#[derive(Debug)]
struct Effect {
    before: Paid,
    /// What is paid after the move; `None` where nothing comes after it.
    after: Option<Paid>,
    then: Then,
    mode: ModeId,
}

/// Why a belief of this model is not exact.
fn effects(frame: &Frame) -> Result<Vec<Vec<Effect>>, String> {
    let model = frame.model;
    if frame.walled {
        return Err("walls stop the state".to_owned());
    }
    if !model.episode.alive.sides.is_empty() {
        return Err("it is conditioned on not having failed".to_owned());
    }
    let effect = |mode: ModeId, action: ActionId| effect(frame, mode, action);
    (0..model.modes.len())
        .map(|mode| (0..model.actions.len()).map(|a| effect(mode, a)).collect())
        .collect()
}

fn effect(frame: &Frame, mode: ModeId, action: ActionId) -> Result<Effect, String> {
    let (model, hidden) = (frame.model, "it depends on the state whether an event happens");
    let places = [inside(&frame.axes[0].cuts), inside(&frame.axes[1].cuts)];
    let columns = places[1].len();
    let all = || {
        let rows = places[0].iter();
        rows.flat_map(|&x| places[1].iter().map(move |&y| [x, y]))
    };
    let befores: Vec<step::Before> = all()
        .map(|at| before(model, mode, action, frame.state(&at)))
        .collect();
    let paid = |values: Vec<f64>| Paid { values, columns };
    let first = befores[0];
    if befores
        .iter()
        .any(|other| (other.mode, other.then) != (first.mode, first.then))
    {
        return Err(hidden.to_owned());
    }
    let rewards = paid(befores.iter().map(|before| before.reward).collect());
    if first.then != Then::Continue {
        return Ok(Effect {
            before: rewards,
            after: None,
            then: first.then,
            mode: first.mode,
        });
    }
    let afters = |before: &step::Before| -> Vec<step::After> {
        all()
            .map(|at| after(model, mode, action, before, frame.state(&at)))
            .collect()
    };
    let after = afters(&first);
    let same = |other: &step::Before| other.happened == first.happened || afters(other) == after;
    let to = after[0];
    if !befores.iter().all(same)
        || after
            .iter()
            .any(|other| (other.mode, other.then) != (to.mode, to.then))
    {
        return Err(hidden.to_owned());
    }
    Ok(Effect {
        before: rewards,
        after: Some(paid(after.iter().map(|after| after.reward).collect())),
        then: to.then,
        mode: to.mode,
    })
}

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
    observer: &dyn Observer,
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
    let (most, fewer) = if frame.is_real(1) { (60, 12) } else { (600, 48) };
    let levels = |limit| Levels::new(a, &frame.classes, &starts, limit, frame.model.episode.length);
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

/// What an action pays at a level.
struct Rewards {
    /// At the points of the grid.
    at: Vec<f64>,
    /// By axis and side: the most beyond the grid, at the points of the other axis.
    beyond: [[Vec<f64>; 2]; 2],
    /// The most by which it may lie above its interpolation.
    margin: f64,
}

/// Where an action leads from the points of an axis: the point below, and how far on to the next.
struct Targets {
    places: Vec<(usize, f64)>,
    aligned: bool,
}

/// The expectation of a value after a reading.
struct Expected {
    values: Vec<f64>,
    /// How far the value bends downwards along each axis.
    bend: [f64; 2],
}

impl<'a> Planner<'a> {
    fn new(frame: &'a Frame<'a>, effects: Vec<Vec<Effect>>, levels: Levels) -> Self {
        let (reached, late) = reach(&levels, restarts(frame.model));
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
            let predicted = self.levels.steps[level].iter().map(|step| step.predicted[i]);
            let least = predicted.fold(self.levels.variances[level][i], f64::min);
            least < 4.0 * self.lattice[i].step.powi(2)
        };
        let axes = (0..2).filter(|&i| self.frame.is_real(i));
        !axes.into_iter().any(|i| self.late.iter().any(|level| narrow(level, i)))
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
        let left = step.next.map_or([0.0; 2], |next| self.levels.variances[next]);
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
            let predicted = self.levels.steps[level].iter().map(|step| step.predicted[i]);
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
        Axis {
            low,
            step,
            count: (width / step).ceil() as usize + 1,
        }
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
    fn solve(&mut self, observer: &dyn Observer) -> f64 {
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
        self.levels.steps[level].iter().any(|step| step.next.is_none())
    }

    fn prepare(&self, level: usize) -> Work {
        let classes = 0..self.frame.classes.len();
        let kernels = classes.map(|class| {
            let spread = self.spread(level, class);
            std::array::from_fn(|i| match spread[i] > 0.0 && self.frame.is_real(i) {
                true => kernel(spread[i].sqrt(), self.lattice[i].step),
                false => Vec::new(),
            })
        });
        let actions = self.effects.iter().map(|effects| {
            let effects = effects.iter().enumerate();
            effects
                .map(|(action, effect)| self.rewards(level, action, effect))
                .collect()
        });
        Work {
            level,
            actions: actions.collect(),
            kernels: kernels.collect(),
        }
    }

    fn rewards(&self, level: usize, action: ActionId, effect: &Effect) -> Rewards {
        let held = self.levels.variances[level];
        let class = self.frame.class_of[action];
        let predicted = self.levels.steps[level][class].predicted;
        let sizes = self.sizes();
        let beside = |i: usize| vec![0.0; sizes[1 - i]];
        let mut rewards = Rewards {
            at: vec![0.0; self.size()],
            beyond: std::array::from_fn(|i| [beside(i), beside(i)]),
            margin: 0.0,
        };
        let moved = std::array::from_fn(|i| {
            let axis = &self.frame.axes[i];
            (axis.a, axis.displacement[action])
        });
        let parts = [
            (Some(&effect.before), held, [(1.0, 0.0); 2]),
            (effect.after.as_ref(), predicted, moved),
        ];
        for (paid, variances, map) in parts {
            if let Some(paid) = paid {
                self.add_paid(&mut rewards, paid, variances, map);
            }
        }
        rewards
    }

    /// Adds what is paid by where `a m + b` of each axis is believed to be.
    fn add_paid(
        &self,
        rewards: &mut Rewards,
        paid: &Paid,
        variances: Variances,
        map: [(f64, f64); 2],
    ) {
        let sizes = self.sizes();
        let masses: [Vec<Vec<f64>>; 2] = std::array::from_fn(|i| {
            let at = |point| map[i].0 * self.lattice[i].at(point) + map[i].1;
            let law = |point| Law::normal(at(point), variances[i].sqrt());
            let points = 0..sizes[i];
            points
                .map(|point| law(point).masses(&self.frame.axes[i].cuts))
                .collect()
        });
        let add = parallel::map(self.size(), |point| {
            paid.expectation(&masses[0][point / sizes[1]], &masses[1][point % sizes[1]])
        });
        rewards.at.iter_mut().zip(add).for_each(|(r, add)| *r += add);
        let mut jumps = [paid.jumps(0), paid.jumps(1)];
        for (i, side) in self.sides() {
            let lines = paid.beyond(i, &self.reach(i, side, &masses[i], map[i]));
            let across: f64 = lines.windows(2).map(|pair| (pair[1] - pair[0]).abs()).sum();
            jumps[1 - i] = jumps[1 - i].max(across);
            for (point, sum) in rewards.beyond[i][side].iter_mut().enumerate() {
                let masses = &masses[1 - i];
                *sum += match self.outer_side(1 - i, point) {
                    None => dot(&masses[point], &lines),
                    Some(side) => self.reach(1 - i, side, masses, map[1 - i]).most(&lines),
                };
            }
        }
        for i in (0..2).filter(|&i| self.frame.is_real(i)) {
            rewards.margin += self.bending(jumps[i], i, variances[i], map[i].0);
        }
    }

    /// The most by which something that jumps so much can lie above its interpolation along an axis: `|phi'(z)| <= 0.242`.
    fn bending(&self, jumps: f64, i: usize, variance: f64, a: f64) -> f64 {
        let step = a * self.lattice[i].step;
        match variance > 0.0 {
            true => jumps * (0.241_970_725 * step * step / (8.0 * variance)).min(1.0),
            false => jumps,
        }
    }

    /// The edge of the grid along an axis and everything beyond it, where the mean is taken to `a m + b`.
    fn reach(&self, i: usize, side: usize, masses: &[Vec<f64>], (a, b): (f64, f64)) -> Reach {
        let axis = &self.lattice[i];
        let point = side * (axis.count - 1);
        let edge = a * axis.at(point) + b;
        let cuts = &self.frame.axes[i].cuts;
        // Going outwards goes away from a cell on the inner side of the edge.
        let falls = |cell: usize| match towards(a, side) {
            0 => cell > 0 && cuts[cell - 1] >= edge,
            _ => cell < cuts.len() && cuts[cell] <= edge,
        };
        Reach {
            masses: masses[point].clone(),
            falls: (0..=cuts.len()).map(falls).collect(),
        }
    }

    /// The side on which a point of an axis stands for everything beyond.
    fn outer_side(&self, i: usize, point: usize) -> Option<usize> {
        match (self.frame.is_real(i), point) {
            (false, _) => None,
            (true, 0) => Some(0),
            (true, point) => (point + 1 == self.lattice[i].count).then_some(1),
        }
    }

    /// Axes of state variables with their two sides.
    fn sides(&self) -> impl Iterator<Item = (usize, usize)> {
        let axes = if self.frame.is_real(1) { 2 } else { 1 };
        (0..axes).flat_map(|i| [(i, 0), (i, 1)])
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

    /// The expectation at the points of the grid; on its edges the most that is expected from there outwards.
    fn expect(&self, mode: ModeId, work: &Work, class: usize, ceiling: f64) -> Expected {
        let Some(next) = self.levels.steps[work.level][class].next else {
            return Expected {
                values: vec![ceiling; self.size()],
                bend: [0.0; 2],
            };
        };
        let values = &self.values[self.index(mode, next)];
        let sizes = self.sizes();
        let kernels = &work.kernels[class];
        let mut averaged = average_rows(values, sizes, &kernels[0]);
        averaged = average_columns(&averaged, sizes, &kernels[1]);
        let spread = self.spread(work.level, class);
        for (i, side) in self.sides() {
            let edge = self.lattice[i].at(side * (sizes[i] - 1));
            let line = self.outwards(values, i, side, &Law::normal(edge, spread[i].sqrt()));
            let line = self.average_line(&line, 1 - i, &kernels[1 - i], spread[1 - i]);
            raise_edge(&mut averaged, sizes, i, side, &line);
        }
        Expected {
            values: averaged,
            bend: [self.bend(values, 0), self.bend(values, 1)],
        }
    }

    /// By point of the other axis, the expectation, where the mean along an axis has a law, of the most of a value from there
    /// outwards.
    fn outwards(&self, values: &[f64], i: usize, side: usize, law: &Law) -> Vec<f64> {
        let [rows, columns] = self.sizes();
        let weights = law.hats(&self.lattice[i]);
        let of_line = |line: Vec<f64>| dot(&weights, &most_outwards(line, side));
        match i {
            0 => parallel::map(columns, |column| {
                of_line((0..rows).map(|row| values[row * columns + column]).collect())
            }),
            _ => values
                .chunks_exact(columns)
                .map(|line| of_line(line.to_vec()))
                .collect(),
        }
    }

    /// The expectation at the points of one axis; at its ends the most that is expected from there outwards.
    fn average_line(&self, line: &[f64], i: usize, kernel: &[f64], spread: f64) -> Vec<f64> {
        if !self.frame.is_real(i) {
            return line.to_vec();
        }
        let mut averaged = average_columns(line, [1, line.len()], kernel);
        for side in 0..2 {
            let end = side * (line.len() - 1);
            let law = Law::normal(self.lattice[i].at(end), spread.sqrt());
            let most = dot(&law.hats(&self.lattice[i]), &most_outwards(line.to_vec(), side));
            averaged[end] = averaged[end].max(most);
        }
        averaged
    }

    /// The most by which the slope of a value falls at a point of the grid along an axis.
    fn bend(&self, values: &[f64], i: usize) -> f64 {
        let [rows, columns] = self.sizes();
        let (count, stride) = match i {
            0 => (rows, columns),
            _ => (columns, 1),
        };
        if count == 1 {
            return 0.0;
        }
        let at = |index: usize| {
            let place = index / stride % count;
            let back = if place > 0 { values[index - stride] } else { values[index] };
            let on = if place + 1 < count { values[index + stride] } else { values[index] };
            2.0 * values[index] - back - on
        };
        (0..values.len()).map(at).fold(0.0, f64::max) / self.lattice[i].step
    }

    /// The most by which the expectation after an action can lie above its interpolation, along both axes.
    fn margin(&self, work: &Work, action: ActionId, expected: &Expected, targets: &[Targets; 2]) -> f64 {
        let spread = self.spread(work.level, self.frame.class_of[action]);
        let along = |i: usize| {
            let (step, a, bend) = (self.lattice[i].step, self.frame.axes[i].a.abs(), expected.bend[i]);
            let aligned = targets[i].aligned;
            let sd = spread[i].sqrt();
            // Kinks that stay where they are lie on points. Elsewhere a function that bends by `bend` in a cell may lie as much
            // above its chord as at most a quarter of that, and an eighth if the bend is spread evenly.
            let between = |a: f64, factor: f64| match sd > 0.0 {
                true => (factor * 0.25).min(a * a * crowding(sd, step) / 8.0),
                false => factor * 0.25,
            };
            match (aligned, sd > 0.0, a == 1.0) {
                (true, false, true) => 0.0,
                (true, ..) | (false, false, _) => bend * step * between(a, a * a.ceil()),
                (false, true, _) => bend * step * (between(a, a * a.ceil()) + between(1.0, 1.0)),
            }
        };
        (0..2).filter(|&i| self.frame.is_real(i)).map(along).sum()
    }

    fn back_up(
        &self,
        mode: ModeId,
        work: &Work,
        expected: &[Expected],
        targets: &[[Targets; 2]],
        ceiling: f64,
    ) -> Vec<f64> {
        let model = self.frame.model;
        let sizes @ [rows, columns] = self.sizes();
        let mut best = vec![f64::NEG_INFINITY; self.size()];
        let beside = |i: usize| vec![f64::NEG_INFINITY; sizes[1 - i]];
        let mut edges: [[Vec<f64>; 2]; 2] = std::array::from_fn(|i| [beside(i), beside(i)]);
        for (action, effect) in self.effects[mode].iter().enumerate() {
            let rewards = &work.actions[mode][action];
            let class = self.frame.class_of[action];
            let to_come = &expected[effect.mode * self.frame.classes.len() + class];
            let goes_on = effect.then == Then::Continue;
            let constant = rewards.margin
                + model.discount
                    * match effect.then {
                        Then::Continue => self.margin(work, action, to_come, &targets[action]),
                        Then::Restart => self.start_value,
                        Then::End => 0.0,
                    };
            let future = |row, column| match goes_on {
                true => interpolate(&to_come.values, columns, &targets[action], row, column),
                false => 0.0,
            };
            let fresh = parallel::map(rows, |row| {
                let value = |column| {
                    let paid = rewards.at[row * columns + column];
                    paid + model.discount * future(row, column) + constant
                };
                (0..columns).map(value).collect::<Vec<f64>>()
            });
            raise(&mut best, &fresh.concat(), 0.0);
            for (i, side) in self.sides() {
                let mut most = rewards.beyond[i][side].clone();
                if goes_on {
                    let to_come =
                        self.beyond(effect.mode, work, action, (i, side), &targets[action], ceiling);
                    let pairs = most.iter_mut().zip(&to_come);
                    pairs.for_each(|(most, value)| *most += model.discount * value);
                }
                raise(&mut edges[i][side], &most, constant);
            }
        }
        for (i, side) in self.sides() {
            raise_edge(&mut best, sizes, i, side, &edges[i][side]);
        }
        best
    }

    /// By point of the other axis, the most that is expected after an action taken beyond the grid.
    fn beyond(
        &self,
        mode: ModeId,
        work: &Work,
        action: ActionId,
        (i, side): (usize, usize),
        targets: &[Targets; 2],
        ceiling: f64,
    ) -> Vec<f64> {
        let (class, other) = (self.frame.class_of[action], 1 - i);
        let Some(next) = self.levels.steps[work.level][class].next else {
            return vec![ceiling; self.lattice[other].count];
        };
        let values = &self.values[self.index(mode, next)];
        let spread = self.spread(work.level, class);
        let law = |i: usize, side: usize| {
            let (axis, of) = (self.lattice[i], &self.frame.axes[i]);
            let edge = of.a * axis.at(side * (axis.count - 1)) + of.displacement[action];
            Law::normal(edge, spread[i].sqrt())
        };
        let out = |i: usize, side: usize| towards(self.frame.axes[i].a, side);
        let line = self.outwards(values, i, out(i, side), &law(i, side));
        let averaged = self.average_line(&line, other, &work.kernels[class][other], spread[other]);
        let places = targets[other].places.iter().enumerate();
        places
            .map(|(point, &(below, on))| match self.outer_side(other, point) {
                Some(side) => {
                    let weights = law(other, side).hats(&self.lattice[other]);
                    dot(&weights, &most_outwards(line.clone(), out(other, side)))
                }
                None if on == 0.0 => averaged[below],
                None => averaged[below] + on * (averaged[below + 1] - averaged[below]),
            })
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

/// `(row, column)` taken along its targets, by linear interpolation.
fn interpolate(
    values: &[f64],
    columns: usize,
    targets: &[Targets; 2],
    row: usize,
    column: usize,
) -> f64 {
    let ((x, u), (y, v)) = (targets[0].places[row], targets[1].places[column]);
    let line = |x: usize| {
        let at = values[x * columns + y];
        match v == 0.0 {
            true => at,
            false => at + v * (values[x * columns + y + 1] - at),
        }
    };
    let at = line(x);
    match u == 0.0 {
        true => at,
        false => at + u * (line(x + 1) - at),
    }
}

fn product(values: &[f64], weights: &[Vec<f64>; 2]) -> f64 {
    let rows = values.chunks_exact(weights[1].len()).zip(&weights[0]);
    rows.filter(|(_, weight)| **weight > 0.0)
        .map(|(row, weight)| {
            weight * row.iter().zip(&weights[1]).map(|(v, w)| v * w).sum::<f64>()
        })
        .sum()
}

/// The side to which everything beyond a side is taken by a motion that scales by `a`.
pub(super) fn towards(a: f64, side: usize) -> usize {
    match a < 0.0 {
        true => 1 - side,
        false => side,
    }
}

/// The most from each point outwards.
fn most_outwards(mut line: Vec<f64>, side: usize) -> Vec<f64> {
    let count = line.len();
    for k in 1..count {
        // The low side looks at what comes before, the high side at what comes after.
        let (at, inner) = match side {
            0 => (k, k - 1),
            _ => (count - 1 - k, count - k),
        };
        line[at] = line[at].max(line[inner]);
    }
    line
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn raise(values: &mut [f64], to: &[f64], and: f64) {
    let pairs = values.iter_mut().zip(to);
    pairs.for_each(|(value, to)| *value = value.max(to + and));
}

fn raise_edge(values: &mut [f64], sizes: [usize; 2], axis: usize, side: usize, to: &[f64]) {
    let [rows, columns] = sizes;
    let edge = side * (sizes[axis] - 1);
    match axis {
        0 => raise(&mut values[edge * columns..(edge + 1) * columns], to, 0.0),
        _ => (0..rows).for_each(|row| {
            let value = &mut values[row * columns + edge];
            *value = value.max(to[row]);
        }),
    }
}

/// Averages along the first axis, constant beyond its ends.
fn average_rows(values: &[f64], [rows, columns]: [usize; 2], kernel: &[f64]) -> Vec<f64> {
    if kernel.is_empty() {
        return values.to_vec();
    }
    let half = kernel.len() as isize / 2;
    let lines = parallel::map(rows, |row| {
        let mut line = vec![0.0; columns];
        for (tap, weight) in kernel.iter().enumerate() {
            let from = (row as isize + tap as isize - half).clamp(0, rows as isize - 1) as usize;
            let source = &values[from * columns..(from + 1) * columns];
            line.iter_mut()
                .zip(source)
                .for_each(|(sum, value)| *sum += weight * value);
        }
        line
    });
    lines.concat()
}

/// Averages along the second axis, constant beyond its ends.
fn average_columns(values: &[f64], [rows, columns]: [usize; 2], kernel: &[f64]) -> Vec<f64> {
    if kernel.is_empty() {
        return values.to_vec();
    }
    let half = kernel.len() / 2;
    let lines = parallel::map(rows, |row| {
        let source = &values[row * columns..(row + 1) * columns];
        let mut padded = vec![source[0]; half];
        padded.extend_from_slice(source);
        padded.extend(std::iter::repeat_n(source[columns - 1], half));
        let mut line = vec![0.0; columns];
        for (tap, weight) in kernel.iter().enumerate() {
            line.iter_mut()
                .zip(&padded[tap..])
                .for_each(|(sum, value)| *sum += weight * value);
        }
        line
    });
    lines.concat()
}
