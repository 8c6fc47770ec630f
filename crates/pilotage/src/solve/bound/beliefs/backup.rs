//! One step backwards at all points of the grid.

use super::super::law::{Law, crowding};
use super::lattice::{
    Targets, average_columns, average_rows, dot, interpolate, most_outwards, raise, raise_edge,
    towards,
};
use super::{Planner, Work};
use crate::model::{ActionId, ModeId, Then};
use crate::parallel;

/// The expectation of a value after a reading.
pub(super) struct Expected {
    pub values: Vec<f64>,
    /// How far the value bends downwards along each axis.
    pub bend: [f64; 2],
}

impl Planner<'_> {
    /// The expectation at the points of the grid; on its edges the most that is expected from there outwards.
    pub(super) fn expect(&self, mode: ModeId, work: &Work, class: usize, ceiling: f64) -> Expected {
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
                of_line(
                    (0..rows)
                        .map(|row| values[row * columns + column])
                        .collect(),
                )
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
            let most = dot(
                &law.hats(&self.lattice[i]),
                &most_outwards(line.to_vec(), side),
            );
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
            let back = if place > 0 {
                values[index - stride]
            } else {
                values[index]
            };
            let on = if place + 1 < count {
                values[index + stride]
            } else {
                values[index]
            };
            2.0 * values[index] - back - on
        };
        (0..values.len()).map(at).fold(0.0, f64::max) / self.lattice[i].step
    }

    /// The most by which the expectation after an action can lie above its interpolation, along both axes.
    fn margin(
        &self,
        work: &Work,
        action: ActionId,
        expected: &Expected,
        targets: &[Targets; 2],
    ) -> f64 {
        let spread = self.spread(work.level, self.frame.class_of[action]);
        let along = |i: usize| {
            let (step, a, bend) = (
                self.lattice[i].step,
                self.frame.axes[i].a.abs(),
                expected.bend[i],
            );
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

    pub(super) fn back_up(
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
                    let to_come = self.beyond(
                        effect.mode,
                        work,
                        action,
                        (i, side),
                        &targets[action],
                        ceiling,
                    );
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
            .map(
                |(point, &(below, on))| match self.outer_side(other, point) {
                    Some(side) => {
                        let weights = law(other, side).hats(&self.lattice[other]);
                        dot(&weights, &most_outwards(line.clone(), out(other, side)))
                    }
                    None if on == 0.0 => averaged[below],
                    None => averaged[below] + on * (averaged[below + 1] - averaged[below]),
                },
            )
            .collect()
    }
}
