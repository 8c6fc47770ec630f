//! The bound where the filter is not exact: an agent that is told the state and the mode one step late.
//!
//! When it acts, such an agent knows where it was one step before, what it did there and what it has sensed since. It knows at least
//! as much as any that only acts and senses, so that what it earns at most is a bound; and what it does not know yet, the noise of
//! one move seen through one reading, is often most of what there is to know. For a state `s` in mode `q`,
//!
//! ```text
//! Q_k(s, q, a) = r(s, q, a) + E r'(s') + discount * E_o max_a' E[ Q_(k-1)(s', q', a') | s, a, o ]
//!             = r(s, q, a) + E [ r'(s') + discount * V_(k-1)(s', q') ] - discount * price(s, a)
//! price       = E_o min_a' E[ V(s', q') - Q(s', q', a') | s, a, o ],   V = max_a Q
//! ```
//!
//! with `s'` where the move ended: the value of an agent that sees everything, less the price of not seeing it yet (the fast informed
//! bound of Hauskrecht 2000, for continuous states). A first action is taken for all starts at once.
//!
//! It is rounded up at every step:
//!
//! - All rewards and events are constant in the cells of a partition, and `Q` is kept linear in each, with a value of its own at
//!   either end. Expectations over the noise of the move are exact.
//! - In a cell of width `h` the expectation lies at most `0.484 range (A h)^2 / (8 q)` above its chord, `q` the variance of the motion
//!   and `range` that of what is expected. Without noise cells move onto cells.
//! - The price is never too high: the integral over the reading is a sum over points a step apart, less the most by which a sum can
//!   exceed the integral of a function of its curvature, `step^2 E max_a'(V - Q) / (12 R)` about.
//! - An agent that sees everything at all steps but the first few is only ever better off, which saves time in two dimensions.

mod moves;

use super::beliefs::towards;
use super::ceiling::Ceiling;
use super::cells::Cells;
use super::frame::Frame;
use super::law::Law;
use super::step::{After, Before, Doing};
use crate::model::{ActionId, ModeId, Then};
use crate::parallel;
use crate::progress::Progress;
use moves::{Moves, Place, moves};

/// Most sweeps; an episode that is longer begins them with the ceiling.
const MOST_SWEEPS: usize = 20_000;
/// Multiplications that all sweeps together may take, by number of variables.
const WORK: [f64; 2] = [1e10, 3e10];
/// Fewest cells to which an axis is cut down to save work.
const COARSEST: usize = 12;

/// What a move can lead to: the same for many modes and actions.
#[derive(Debug)]
struct Group {
    class: usize,
    /// By cell.
    afters: Vec<After>,
}

/// What an action does in a cell before the move.
#[derive(Debug, Clone, Copy)]
struct Begin {
    before: Before,
    /// Where it goes on to move.
    group: usize,
}

struct Planner<'a> {
    frame: &'a Frame<'a>,
    cells: [Cells; 2],
    /// By class and axis.
    moves: Vec<[Moves; 2]>,
    groups: Vec<Group>,
    /// By mode, action and cell.
    begins: Vec<Vec<Vec<Begin>>>,
    ceiling: Ceiling,
    /// `Q`, by mode and action, at the ends of cells.
    q: Vec<Vec<Vec<f64>>>,
    start_value: f64,
}

/// The bound, or why the model is too much for it.
pub(super) fn bound(
    frame: &Frame,
    points: Option<usize>,
    observer: &dyn Progress,
) -> Result<f64, String> {
    if frame.walled && frame.model.map.is_some() {
        return Err("the walls of its map stop moves along both variables together".to_owned());
    }
    let finest = if frame.is_real(1) { 128 } else { 1500 };
    let mut count = points.map_or_else(|| suitable(frame), |points| points.min(finest));
    loop {
        let mut planner = Planner::new(frame, count)?;
        if points.is_none() && count > COARSEST && planner.work() > planner.affordable() / 10.0 {
            count = count * 3 / 4;
            continue;
        }
        return Ok(planner.solve(observer));
    }
}

/// Cells in what matters of an axis: several to a standard deviation of the noise, if that is not too many.
fn suitable(frame: &Frame) -> usize {
    let (least, most, share) = match frame.is_real(1) {
        true => (48, 96, 3.0),
        false => (160, 1200, 6.0),
    };
    let along = |i: usize| {
        let noise = frame.classes.iter().map(|class| class[i].motion);
        let narrowest = noise
            .filter(|variance| *variance > 0.0)
            .fold(f64::INFINITY, f64::min);
        frame.core(i).width() * share / narrowest.sqrt()
    };
    let wanted = if frame.is_real(1) {
        along(0).max(along(1))
    } else {
        along(0)
    };
    (wanted.min(f64::from(most)) as usize).max(least)
}

impl<'a> Planner<'a> {
    fn new(frame: &'a Frame<'a>, count: usize) -> Result<Self, String> {
        let cells = [Cells::new(frame, 0, count)?, Cells::new(frame, 1, count)?];
        let moves: Result<Vec<[Moves; 2]>, String> = (0..frame.classes.len())
            .map(|class| {
                Ok([
                    moves(frame, &cells[0], class, 0)?,
                    moves(frame, &cells[1], class, 1)?,
                ])
            })
            .collect();
        let model = frame.model;
        let (modes, actions) = (model.modes.len(), model.actions.len());
        let size = cells[0].places() * cells[1].places();
        let mut planner = Self {
            frame,
            moves: moves?,
            groups: Vec::new(),
            begins: Vec::new(),
            ceiling: Ceiling::new(model),
            q: vec![vec![vec![0.0; size]; actions]; modes],
            start_value: 0.0,
            cells,
        };
        planner.begins = (0..modes)
            .map(|mode| {
                (0..actions)
                    .map(|action| planner.begin(mode, action))
                    .collect()
            })
            .collect();
        Ok(planner)
    }

    fn begin(&mut self, mode: ModeId, action: ActionId) -> Vec<Begin> {
        let frame = self.frame;
        let all: Vec<[f64; 2]> = (0..self.cells[0].count())
            .flat_map(|x| (0..self.cells[1].count()).map(move |y| (x, y)))
            .map(|(x, y)| [self.cells[0].inside(x), self.cells[1].inside(y)])
            .collect();
        let doing = Doing::new(frame.model, mode, action);
        let mut known: Vec<(Before, usize)> = Vec::new();
        let mut begins = Vec::with_capacity(all.len());
        for at in &all {
            let before = doing.before(frame.state(at));
            let alike =
                |other: &Before| (other.mode, other.happened) == (before.mode, before.happened);
            let found = known.iter().find(|(other, _)| alike(other));
            let group = match (before.then, found) {
                (Then::Continue, Some(found)) => found.1,
                (Then::Continue, None) => {
                    let to = |at: &[f64; 2]| doing.after(&before, frame.state(at));
                    let group = self.group(frame.class_of[action], all.iter().map(to).collect());
                    known.push((before, group));
                    group
                }
                _ => 0,
            };
            begins.push(Begin { before, group });
        }
        begins
    }

    fn group(&mut self, class: usize, afters: Vec<After>) -> usize {
        let same = |group: &Group| group.class == class && group.afters == afters;
        self.groups.iter().position(same).unwrap_or_else(|| {
            self.groups.push(Group { class, afters });
            self.groups.len() - 1
        })
    }

    fn sizes(&self) -> [usize; 2] {
        [self.cells[0].places(), self.cells[1].places()]
    }

    /// The cell of an end of a cell.
    fn cell_of(&self, place: usize) -> usize {
        let columns = self.cells[1].places();
        place / columns / 2 * self.cells[1].count() + place % columns / 2
    }

    /// Multiplications that all such sweeps together may take.
    fn affordable(&self) -> f64 {
        WORK[usize::from(self.frame.is_real(1))]
    }

    /// Multiplications of a sweep in which readings are weighed.
    fn work(&self) -> f64 {
        let actions = self.frame.class_of.len() as f64;
        let of_group = |group: &Group| {
            let [x, y] = &self.moves[group.class];
            let readings = |moves: &Moves| -> f64 {
                let of = moves.places.iter();
                of.map(|place| place.readings.len() as f64).sum()
            };
            let weights = |moves: &Moves| -> f64 {
                let of = moves.places.iter().flat_map(|place| &place.readings);
                of.map(|(_, weights)| weights.len() as f64).sum()
            };
            actions * (weights(x) * self.cells[1].places() as f64 + readings(x) * weights(y))
        };
        self.groups.iter().map(of_group).sum()
    }

    /// Backwards from the end of the episode.
    fn solve(&mut self, observer: &dyn Progress) -> f64 {
        let length = self.frame.model.episode.length;
        let sweeps = length.min(MOST_SWEEPS);
        let mut ceiling = self.ceiling.within(length - sweeps);
        self.q
            .iter_mut()
            .flatten()
            .flatten()
            .for_each(|q| *q = ceiling);
        self.start_value = ceiling;
        let late = sweeps.min((self.affordable() / self.work()).max(1.0) as usize);
        for (count, told_late) in [(sweeps - late, false), (late, true)] {
            for sweep in 0..count {
                ceiling = self.ceiling.one_more(ceiling);
                let further = self.sweep(told_late, ceiling);
                observer.progress("bound", sweep as u64 + 1, count as u64);
                if let Some(further) = further {
                    self.q
                        .iter_mut()
                        .flatten()
                        .flatten()
                        .for_each(|q| *q += further);
                    self.start_value += further;
                    ceiling = f64::INFINITY;
                    break;
                }
            }
        }
        self.start_value
    }

    /// One step more. Once a step more changes next to nothing, the most that all further ones can add.
    fn sweep(&mut self, told_late: bool, ceiling: f64) -> Option<f64> {
        let model = self.frame.model;
        let (modes, actions) = (model.modes.len(), model.actions.len());
        let values: Vec<Vec<f64>> = self.q.iter().map(|q| most(q)).collect();
        let expected: Vec<Expected> = (0..self.groups.len())
            .map(|group| self.expect(group, &values, told_late))
            .collect();
        let mut rise = f64::NEG_INFINITY;
        let mut change = 0.0_f64;
        let mut scale = 0.0_f64;
        let mut q = Vec::with_capacity(modes);
        for mode in 0..modes {
            let mut of_mode = Vec::with_capacity(actions);
            for action in 0..actions {
                let fresh = self.back_up(mode, action, &expected, ceiling);
                for (new, old) in fresh.iter().zip(&self.q[mode][action]) {
                    rise = rise.max(new - old);
                    change = change.max((new - old).abs());
                    scale = scale.max(new.abs());
                }
                of_mode.push(fresh);
            }
            q.push(of_mode);
        }
        self.q = q;
        let start = self.at_start();
        rise = rise.max(start - self.start_value);
        change = change.max((start - self.start_value).abs());
        self.start_value = start;
        let further = |step: f64| step / (1.0 - model.discount);
        (model.discount < 1.0 && further(change) <= 1e-5 * scale).then(|| further(rise.max(0.0)))
    }

    fn expect(&self, group: usize, values: &[Vec<f64>], told_late: bool) -> Expected {
        let Group { class, afters } = &self.groups[group];
        let (model, actions) = (self.frame.model, self.frame.class_of.len());
        let [rows, columns] = self.sizes();
        let size = rows * columns;
        // By column and then row, for the sums along the first axis.
        let turned = |place: usize| place % columns * rows + place / columns;
        let mut worth = vec![0.0; size];
        let mut stakes = vec![0.0; size];
        let mut gaps = vec![vec![0.0; size]; if told_late { actions } else { 0 }];
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for place in 0..size {
            let after = &afters[self.cell_of(place)];
            let to = turned(place);
            worth[to] = after.reward
                + match after.then {
                    Then::End => 0.0,
                    Then::Restart => model.discount * self.start_value,
                    Then::Continue => model.discount * values[after.mode][place],
                };
            high = high.max(worth[to]);
            low = low.min(worth[to]);
            if after.then != Then::Continue {
                continue;
            }
            for (action, gaps) in gaps.iter_mut().enumerate() {
                let gap = values[after.mode][place] - self.q[after.mode][action][place];
                gaps[to] = gap;
                stakes[to] = f64::max(stakes[to], gap);
                low = low.min(worth[to] - model.discount * gap);
            }
        }
        let [x, y] = &self.moves[*class];
        let loss = x.loss + y.loss;
        let rows_of = parallel::map(x.places.len(), |row| {
            let from = &x.places[row];
            let worths = along(&worth, rows, &from.flat);
            let stakes = along(&stakes, rows, &from.flat);
            let sensed: Vec<Vec<f64>> = gaps.iter().map(|gap| sense(gap, rows, from)).collect();
            let at = |place: &Place| {
                let expected = dot(&place.flat, &worths);
                let price =
                    price(&sensed, from.readings.len(), place) - loss * dot(&place.flat, &stakes);
                expected - model.discount * price.max(0.0)
            };
            y.places.iter().map(at).collect::<Vec<f64>>()
        });
        Expected {
            values: rows_of,
            range: high - low,
            outwards: self.outwards(&worth),
        }
    }

    /// By axis and side, what is worth most across that axis and from each place outwards.
    fn outwards(&self, turned: &[f64]) -> [[Vec<f64>; 2]; 2] {
        let [rows, _] = self.sizes();
        std::array::from_fn(|i| {
            let mut most = vec![f64::NEG_INFINITY; self.sizes()[i]];
            for (index, value) in turned.iter().enumerate() {
                let place = [index % rows, index / rows][i];
                most[place] = most[place].max(*value);
            }
            let mut down = most.clone();
            for k in 1..most.len() {
                down[k] = down[k].max(down[k - 1]);
            }
            for k in (1..most.len()).rev() {
                most[k - 1] = most[k - 1].max(most[k]);
            }
            [down, most]
        })
    }

    fn back_up(
        &self,
        mode: ModeId,
        action: ActionId,
        expected: &[Expected],
        ceiling: f64,
    ) -> Vec<f64> {
        let model = self.frame.model;
        let [rows, columns] = self.sizes();
        let class = self.frame.class_of[action];
        let [x, y] = &self.moves[class];
        let mut fresh = vec![0.0; rows * columns];
        for (place, value) in fresh.iter_mut().enumerate() {
            let begin = &self.begins[mode][action][self.cell_of(place)];
            let (row, column) = (place / columns, place % columns);
            let open = self.cells[0].open_side(row / 2).is_some()
                || self.cells[1].open_side(column / 2).is_some();
            let future = match begin.before.then {
                Then::End => 0.0,
                Then::Restart => model.discount * self.start_value,
                Then::Continue if open => f64::NEG_INFINITY,
                Then::Continue => {
                    let to = &expected[begin.group];
                    let margin = x.gap[row / 2] + y.gap[column / 2];
                    to.values[x.from[action][row]][y.from[action][column]] + margin * to.range
                }
            };
            *value = (begin.before.reward + future).min(ceiling);
        }
        for i in 0..2 {
            for side in 0..2 {
                self.raise_open(&mut fresh, (i, side), mode, action, expected);
            }
        }
        fresh
    }

    /// An open cell is worth at most what is paid in it at most and then the most of everything from there outwards.
    fn raise_open(
        &self,
        values: &mut [f64],
        (i, side): (usize, usize),
        mode: ModeId,
        action: ActionId,
        expected: &[Expected],
    ) {
        let cell = side * (self.cells[i].count() - 1);
        if self.cells[i].open_side(cell) != Some(side) {
            return;
        }
        let of = &self.frame.axes[i];
        let edge = of.a * self.cells[i].outer_end(side) + of.displacement[action];
        let law = Law::normal(edge, self.frame.noise(action, i).motion.sqrt());
        let weights = self.cells[i].weights(&law, true);
        let out = towards(of.a, side);
        let beyond = |group: usize| dot(&weights, &expected[group].outwards[i][out]);
        let counts = [self.cells[0].count(), self.cells[1].count()];
        let worth = (0..counts[1 - i]).map(|across| {
            let index = match i {
                0 => cell * counts[1] + across,
                _ => across * counts[1] + cell,
            };
            let Begin { before, group } = self.begins[mode][action][index];
            before.reward
                + match before.then {
                    Then::End => 0.0,
                    Then::Restart => self.frame.model.discount * self.start_value,
                    Then::Continue => beyond(group),
                }
        });
        let worth = worth.fold(f64::NEG_INFINITY, f64::max);
        let columns = self.cells[1].places();
        for (place, value) in values.iter_mut().enumerate() {
            if [place / columns, place % columns][i] / 2 == cell {
                *value = value.max(worth);
            }
        }
    }

    /// One action for all starts.
    fn at_start(&self) -> f64 {
        let weights: Vec<[Vec<f64>; 2]> = self
            .frame
            .starts
            .iter()
            .map(|start| std::array::from_fn(|i| self.cells[i].weights(&start.laws[i], true)))
            .collect();
        let columns = self.cells[1].places();
        let worth = |action: ActionId| -> f64 {
            let starts = self.frame.starts.iter().zip(&weights);
            starts
                .map(|(start, [x, y])| {
                    let rows = self.q[start.mode][action].chunks_exact(columns).zip(x);
                    let value: f64 = rows.map(|(row, weight)| weight * dot(row, y)).sum();
                    start.weight * value
                })
                .sum()
        };
        (0..self.frame.class_of.len())
            .map(worth)
            .fold(f64::NEG_INFINITY, f64::max)
    }
}

/// What a move of a group brings.
struct Expected {
    /// By place along the first axis and along the second.
    values: Vec<Vec<f64>>,
    /// Between the least and the most that can come of it.
    range: f64,
    /// By axis and side, see [`Planner::outwards`].
    outwards: [[Vec<f64>; 2]; 2],
}

/// The expectation along the first axis, by place of the second.
fn along(turned: &[f64], rows: usize, weights: &[f64]) -> Vec<f64> {
    let columns = turned.chunks_exact(rows);
    columns.map(|column| dot(column, weights)).collect()
}

/// The same for every reading: by place of the second axis, then reading.
fn sense(turned: &[f64], rows: usize, from: &Place) -> Vec<f64> {
    let columns = turned.chunks_exact(rows);
    columns
        .flat_map(|column| {
            let readings = from.readings.iter();
            readings.map(|(first, weights)| dot(&column[*first..], weights))
        })
        .collect()
}

/// The sum over readings along both axes of what the best action is expected to miss, not knowing the state.
fn price(sensed: &[Vec<f64>], readings: usize, place: &Place) -> f64 {
    let Some(first) = sensed.first() else {
        return 0.0;
    };
    debug_assert_eq!(first.len() % readings.max(1), 0);
    let mut total = 0.0;
    let mut least = vec![0.0; readings];
    let mut sum = vec![0.0; readings];
    for (from, weights) in &place.readings {
        for (action, sensed) in sensed.iter().enumerate() {
            sum.fill(0.0);
            let lines = sensed[from * readings..].chunks_exact(readings.max(1));
            for (weight, line) in weights.iter().zip(lines) {
                sum.iter_mut()
                    .zip(line)
                    .for_each(|(sum, x)| *sum += weight * x);
            }
            match action {
                0 => least.copy_from_slice(&sum),
                _ => least
                    .iter_mut()
                    .zip(&sum)
                    .for_each(|(least, sum)| *least = f64::min(*least, *sum)),
            }
        }
        total += least.iter().sum::<f64>();
    }
    total
}

/// The most of all actions.
fn most(q: &[Vec<f64>]) -> Vec<f64> {
    let mut most = q[0].clone();
    for other in &q[1..] {
        most.iter_mut()
            .zip(other)
            .for_each(|(most, q)| *most = most.max(*q));
    }
    most
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
