//! What actions pay at a level, at the points of the grid and beyond it.

use super::super::law::{Law, kernel};
use super::super::levels::Variances;
use super::lattice::{dot, towards};
use super::paid::{Effect, Paid, Reach};
use super::{Planner, Work};
use crate::model::ActionId;
use crate::parallel;

/// What an action pays at a level.
pub(super) struct Rewards {
    /// At the points of the grid.
    pub at: Vec<f64>,
    /// By axis and side: the most beyond the grid, at the points of the other axis.
    pub beyond: [[Vec<f64>; 2]; 2],
    /// The most by which it may lie above its interpolation.
    pub margin: f64,
}

impl Planner<'_> {
    pub(super) fn prepare(&self, level: usize) -> Work {
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
        rewards
            .at
            .iter_mut()
            .zip(add)
            .for_each(|(r, add)| *r += add);
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
    pub(super) fn outer_side(&self, i: usize, point: usize) -> Option<usize> {
        match (self.frame.is_real(i), point) {
            (false, _) => None,
            (true, 0) => Some(0),
            (true, point) => (point + 1 == self.lattice[i].count).then_some(1),
        }
    }

    /// Axes of state variables with their two sides.
    pub(super) fn sides(&self) -> impl Iterator<Item = (usize, usize)> {
        let axes = if self.frame.is_real(1) { 2 } else { 1 };
        (0..axes).flat_map(|i| [(i, 0), (i, 1)])
    }
}
