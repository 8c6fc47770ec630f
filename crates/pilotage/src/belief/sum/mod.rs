//! A belief that is a sum of weighted Gaussians, each in a mode: what is believed of hidden modes, at walls, and where noise depends on the
//! place.
//!
//! One Gaussian a mode makes it the filter of interacting multiple models. More of them stand for what no Gaussian is: a start that is wide
//! for its sensor is split, events and walls cut off what happens there. After every reading those most alike are merged, so that mean
//! and covariance stay.

mod act;
mod adapt;
mod bend;
mod component;
mod frame;
mod line;
mod motion;
mod quadrature;
mod readings;
mod reduce;
mod regression;
mod sense;
mod sensor;
#[cfg(test)]
mod tests;

pub use component::Component;
use quadrature::Rule;
use reduce::{Likeness, normalise};

use super::full::{Acted, Keeping, Moments, Sensed};
use super::reading::Reading;
use crate::model::{
    ActionId, Doing, Dynamics, Effect, EffectTable, Interval, ModeId, Model, StartShape,
    VariableKind,
};

/// A sum of Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub struct Sum {
    components: Vec<Component>,
}

impl Sum {
    /// Its Gaussians.
    pub fn components(&self) -> &[Component] {
        &self.components
    }
}

/// Keeps sums of Gaussians for a model.
#[derive(Debug)]
pub struct SumKeeping {
    model: Model,
    dynamics: Dynamics,
    effects: EffectTable,
    /// Those of them that do more than pay.
    changes: EffectTable,
    start: Sum,
    most: usize,
    /// Whether a Gaussian that is too wide for its sensor may become several.
    splits: bool,
    /// Whether there is one Gaussian a mode, so that what walls make of each may as well be one at once.
    whole: bool,
    likeness: Likeness,
    /// For expectations of smooth functions.
    rule: Rule,
    /// For those that are less smooth.
    fine: Rule,
    /// For noise beside a state that is not known either.
    gusts: Rule,
    /// For posterior moments in 1, 2, ... coordinates.
    posterior: Vec<Rule>,
    /// The box in which a state can be, where walls without a map are known.
    bounds: Option<Vec<Interval>>,
}

/// Gaussians of a mode where only walls, modes and starts make more than one of it, unless the model says how many.
const FEW: usize = 4;

/// Gaussians of a sum, unless the model says how many.
const COMPONENTS: usize = 16;

/// Gaussians of a mode in a coarse sum: what is free, and what has run against a wall on either side.
const COARSE: usize = 3;

/// A standard deviation so many times smaller than the start's, or than a tenth of the bounds, counts as none.
const CERTAIN: f64 = 1e-4;

/// Variances that are none where numbers are whole.
const NARROW: f64 = 1e-6;

/// Most points that a start of whole numbers becomes.
const MOST_POINTS: usize = 400;

/// Equal slices of a uniform start along a variable.
const SLICES: usize = 8;

impl SumKeeping {
    /// Sums of Gaussians for a model, of as many as [`crate::model::BeliefSettings::components`] says: by itself 16, or 4 a
    /// mode where motion and sensor are linear.
    pub fn new(model: &Model) -> Self {
        let n = model.state_dim();
        let dynamics = Dynamics::new(model);
        let floor = |i: usize| {
            let starts = model.start.iter();
            let widest = starts.map(|start| start.covariance[(i, i)].max(0.0).sqrt());
            let width = model.state[i].bounds.width();
            let width = if width.is_finite() { 0.1 * width } else { 0.0 };
            CERTAIN * widest.fold(width, f64::max).max(f64::MIN_POSITIVE)
        };
        let walled = dynamics.walls().filter(|walls| walls.map.is_none());
        let felt = |effects: Vec<Effect>| match dynamics.walls() {
            Some(walls) => effects.into_iter().filter_map(|e| walls.felt(e)).collect(),
            None => effects,
        };
        let changing = |effects: Vec<Effect>| -> Vec<Effect> {
            let mut felt = felt(effects);
            felt.retain(|effect| effect.change.is_some());
            felt
        };
        let most = model.belief.components.unwrap_or(match model.is_linear() {
            true => COMPONENTS.min(FEW * model.modes.len()),
            false => COMPONENTS,
        });
        let mut keeping = Self {
            start: Sum {
                components: Vec::new(),
            },
            most,
            splits: true,
            whole: most <= model.modes.len(),
            likeness: Likeness::new((0..n).map(floor).collect(), dynamics.kinds()),
            rule: Rule::new(n, if n == 1 { 9 } else { 5 }),
            fine: Rule::new(n, if n == 1 { 15 } else { 7 }),
            gusts: Rule::cubature(n),
            posterior: (1..=n).map(posterior_rule).collect(),
            bounds: walled.map(|walls| walls.bounds.clone()),
            effects: EffectTable::new(model, felt),
            changes: EffectTable::new(model, changing),
            model: model.clone(),
            dynamics,
        };
        keeping.start = keeping.first();
        keeping
    }

    /// What is believed at the start, in several Gaussians where its shape asks for them.
    fn first(&mut self) -> Sum {
        let starts: Vec<(Component, StartShape)> = self
            .model
            .start
            .iter()
            .map(|start| {
                let component = Component {
                    weight: start.weight,
                    mode: start.mode,
                    mean: start.mean.as_slice().to_vec(),
                    covariance: start.covariance.transpose().as_slice().to_vec(),
                };
                (component, start.shape)
            })
            .collect();
        let mut components = Vec::new();
        for (component, shape) in starts {
            let whole = component.dim() == 1 && self.dynamics.kinds()[0] == VariableKind::Integer;
            match (whole, shape) {
                (true, shape) => components.extend(points(&component, shape)),
                (false, StartShape::Uniform) => components.extend(slices(component)),
                (false, StartShape::Normal) => components.extend(self.stopped(component)),
            }
        }
        let alive = &self.model.episode.alive;
        if !alive.sides.is_empty() {
            let cut = |component: Component| component.cut(alive).0;
            components = components.into_iter().filter_map(cut).collect();
        }
        normalise(&mut components);
        self.most = match self.dynamics.kinds() {
            [VariableKind::Integer] => self.most.max(components.len().min(MOST_POINTS)),
            _ => self.most,
        };
        Sum { components }
    }

    fn doing(&self, mode: ModeId, action: ActionId, step: usize) -> Doing {
        Doing { mode, action, step }
    }
}

/// The rule that finds posterior moments in so many coordinates.
fn posterior_rule(r: usize) -> Rule {
    match r {
        1 => Rule::product(1, 9),
        2 => Rule::product(2, 5),
        3 => Rule::product(3, 4),
        4 => Rule::product(4, 3),
        _ => Rule::new(r, 0),
    }
}

/// The same for a sum that is as coarse as the moments of a belief.
fn coarse_rule(r: usize) -> Rule {
    match r {
        2 => Rule::product(2, 4),
        3 => Rule::product(3, 3),
        _ => posterior_rule(r),
    }
}

/// The whole numbers that a start may be, each a point.
fn points(start: &Component, shape: StartShape) -> Vec<Component> {
    let (mean, variance) = (start.mean[0], start.covariance[0].max(0.0));
    let reach = match shape {
        StartShape::Normal => 5.0 * variance.sqrt(),
        StartShape::Uniform => (3.0 * variance).sqrt(),
    };
    let (low, high) = ((mean - reach).round() as i64, (mean + reach).round() as i64);
    let stride = ((high - low) as usize / MOST_POINTS + 1) as i64;
    let inside = |k: i64| -> f64 {
        let half = 0.5 * stride as f64;
        let side = Interval::new(k as f64 - half, k as f64 + half);
        match shape {
            StartShape::Normal => super::gaussian::interval_probability(mean, variance, side),
            StartShape::Uniform => {
                let within = side.high.min(mean + reach) - side.low.max(mean - reach);
                within.max(0.0).max(if reach == 0.0 { 1.0 } else { 0.0 })
            }
        }
    };
    let numbers = (low..=high).step_by(stride as usize);
    let points = numbers.map(|k| Component {
        weight: inside(k),
        mode: start.mode,
        mean: vec![k as f64],
        covariance: vec![0.0],
    });
    let mut points: Vec<Component> = points.filter(|point| point.weight > 0.0).collect();
    normalise(&mut points);
    for point in &mut points {
        point.weight *= start.weight;
    }
    points
}

/// A uniform box in slices along its widest variables, with the moments of each.
fn slices(start: Component) -> Vec<Component> {
    let n = start.dim();
    let each = if n == 1 { SLICES } else { 3 };
    let sliced = n.min(2);
    let mut widest: Vec<usize> = (0..n).collect();
    widest.sort_by(|&a, &b| start.variance(b).total_cmp(&start.variance(a)));
    let mut parts = vec![start];
    for &variable in &widest[..sliced] {
        let mut finer = Vec::new();
        for part in parts {
            let width = (12.0 * part.variance(variable)).sqrt();
            for k in 0..each {
                let mut slice = part.clone();
                slice.weight /= each as f64;
                let offset = (k as f64 + 0.5) / each as f64 - 0.5;
                slice.mean[variable] += width * offset;
                slice.covariance[variable * n + variable] /= (each * each) as f64;
                finer.push(slice);
            }
        }
        parts = finer;
    }
    parts
}

impl Keeping for SumKeeping {
    type Full = Sum;

    fn coarse(&self) -> Option<Self> {
        Some(Self {
            most: self.most.min(COARSE * self.dynamics.modes()),
            splits: false,
            posterior: (1..=self.dynamics.states()).map(coarse_rule).collect(),
            ..Self::new(&self.model)
        })
    }

    fn is_light(&self) -> bool {
        self.whole || self.dynamics.states() == 1
    }

    fn actions(&self) -> usize {
        self.dynamics.actions()
    }

    fn start(&self) -> Sum {
        self.start.clone()
    }

    fn act(&self, full: &mut Sum, action: ActionId, step: usize) -> Acted {
        self.take(full, action, step, &self.effects)
    }

    fn go_on(&self, full: &mut Sum, action: ActionId, step: usize) {
        self.take(full, action, step, &self.changes);
    }

    fn readings(
        &self,
        full: &Sum,
        action: ActionId,
        step: usize,
        most: usize,
    ) -> Vec<(f64, Sensed)> {
        self.spread_readings(full, action, step, most)
    }

    fn sense(&self, full: &mut Sum, action: ActionId, step: usize, reading: Reading<'_>) {
        self.correct(full, action, step, reading);
        self.likeness.reduce(&mut full.components, self.most);
    }

    fn moments(&self, full: &Sum, moments: &mut Moments) {
        let n = self.dynamics.states();
        moments.mean.clear();
        moments.mean.resize(n, 0.0);
        moments.covariance.clear();
        moments.covariance.resize(n * n, 0.0);
        moments.weights.clear();
        moments.weights.resize(self.dynamics.modes(), 0.0);
        let apart = |component: &Component, from: &[f64], i: usize| {
            self.likeness.apart(i, from[i], component.mean[i])
        };
        // Angles are averaged around one of them.
        let around = full.components.first().map_or(&[][..], |first| &first.mean);
        for component in &full.components {
            moments.weights[component.mode] += component.weight;
            for (i, mean) in moments.mean.iter_mut().enumerate() {
                *mean += component.weight * apart(component, around, i);
            }
        }
        for (mean, around) in moments.mean.iter_mut().zip(around) {
            *mean += around;
        }
        self.dynamics.wrap(&mut moments.mean);
        for component in &full.components {
            for i in 0..n {
                let along = apart(component, &moments.mean, i);
                for j in 0..n {
                    let k = i * n + j;
                    let spread =
                        component.covariance[k] + along * apart(component, &moments.mean, j);
                    moments.covariance[k] += component.weight * spread;
                }
            }
        }
        self.keep_side(full, moments);
    }

    fn with_moments(&self, moments: &Moments) -> Sum {
        const UNLIKELY: f64 = 1e-6;
        let modes = moments.weights.iter().enumerate();
        let mut components: Vec<Component> = modes
            .filter(|(_, weight)| **weight > UNLIKELY)
            .map(|(mode, &weight)| Component {
                weight,
                mode,
                mean: moments.mean.clone(),
                covariance: moments.covariance.clone(),
            })
            .collect();
        let n = self.dynamics.states();
        // What is known exactly is known to be a whole number.
        let narrow = (0..n).all(|i| moments.covariance[i * n + i] < NARROW);
        for component in components.iter_mut().filter(|_| narrow) {
            self.dynamics.round_within(&mut component.mean);
        }
        normalise(&mut components);
        Sum { components }
    }

    fn moved_to(&self, full: &Sum, mean: &[f64]) -> Sum {
        let mut moments = Moments::default();
        self.moments(full, &mut moments);
        let mut mean = mean.to_vec();
        if let Some(walls) = self.dynamics.walls() {
            walls.confine(&mut mean);
        }
        let mut moved = full.clone();
        for component in &mut moved.components {
            for ((value, to), from) in component.mean.iter_mut().zip(&mean).zip(&moments.mean) {
                *value += to - from;
            }
            self.confine(&mean, &moments.covariance, &mut component.mean);
            self.dynamics.round_within(&mut component.mean);
        }
        if moved.components.len() > self.most {
            self.likeness.reduce(&mut moved.components, self.most);
        }
        moved
    }
}
