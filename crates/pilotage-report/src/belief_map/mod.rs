//! Maps of the belief space: what a policy does where (Figures 5.10, 5.11 and 5.13).
//!
//! With one state variable the whole space is one picture, mean across and uncertainty level up. With more it is a picture
//! of two variables for each level.

mod line;
mod plane;
mod voronoi;

use super::is_sound;
use super::palette::Paint;
use super::plot::figure;
use super::sheet::{Sheet, Sign};
use pilotage::belief::{BeliefSpace, Codebook, StratumId, Updater};
use pilotage::error::{Error, Result};
use pilotage::model::{Interval, ModeId, Region};
use pilotage::policy::{Automaton, Node, Place, Policy};

/// What is shown beyond the bounds, as a share of their width.
const BEYOND: f64 = 0.12;

/// Draws what a policy does at every belief, coloured by action, with an automaton's nodes and their borders on top.
///
/// With one state variable: its mean across, uncertainty levels up, the most certain at the bottom. With two: a plane for up
/// to four levels. With more: the plane of the two most uncertain variables at the steady level, the others at the start mean.
///
/// An automaton that remembers more than the modes of the model, as one that was learned may, is drawn by what it remembers.
///
/// # Errors
/// [`Error::Policy`] if the automaton is not one of this problem's state variables and levels.
pub fn belief_map_svg(
    space: &dyn BeliefSpace,
    policy: &dyn Policy,
    automaton: Option<&Automaton>,
) -> Result<String> {
    // Places in coordinates of their own have no frames among the state variables.
    let automaton = automaton.filter(|automaton| automaton.coordinates.is_none());
    if let Some(automaton) = automaton {
        check(space, automaton)?;
    }
    let map = Map {
        space,
        updater: space.updater(),
        policy,
        automaton,
    };
    if space.model().state_dim() == 1 {
        Ok(line::draw(&map))
    } else {
        Ok(plane::draw(&map))
    }
}

fn check(space: &dyn BeliefSpace, automaton: &Automaton) -> Result<()> {
    let (n, model) = (space.model().state_dim(), space.model());
    let fits = automaton.nodes.iter().all(|node| {
        is_sound(&node.place, n)
            && node.levels.1 < space.strata()
            && node.mode < automaton.modes.len()
            && node.action < model.actions.len()
    });
    if fits && automaton.scale.len() == n {
        return Ok(());
    }
    Err(Error::Policy {
        origin: automaton.problem.clone(),
        reason: format!(
            "its nodes are not beliefs of {}; draw it with the model it was made for",
            model.name
        ),
    })
}

/// What is drawn.
struct Map<'a> {
    space: &'a dyn BeliefSpace,
    updater: Updater,
    policy: &'a dyn Policy,
    automaton: Option<&'a Automaton>,
}

impl Map<'_> {
    /// A sheet with the heading.
    fn sheet(&self, what: &str, width: f64) -> Sheet {
        let model = self.space.model();
        let title = format!("Belief map of {}", model.name);
        let description = format!("The best action of {} for every belief: {what}", model.name);
        Sheet::new(&title, what, &description, width)
    }

    /// The actions and the marks, with what they mean.
    fn legend(&self, more: Vec<(Sign, String)>) -> Vec<(Sign, String)> {
        let actions = self.space.model().actions.iter().enumerate();
        actions
            .map(|(k, action)| (Sign::Tint(Paint::Hue(k)), action.name.clone()))
            .chain(more)
            .collect()
    }

    /// The automaton's nodes of a mode.
    fn nodes(&self, mode: ModeId) -> impl Iterator<Item = &Node> {
        let nodes = self
            .automaton
            .map(|automaton| automaton.nodes.as_slice())
            .unwrap_or_default();
        nodes.iter().filter(move |node| node.mode == mode)
    }

    /// What is shown of a state variable: its bounds and a little beyond, the start and every place of a node.
    fn extent(&self, variable: usize) -> (f64, f64) {
        let model = self.space.model();
        let start = self.space.start();
        let deviation = self.space.covariance(start.stratum)[(variable, variable)].sqrt();
        let mean = start.mean[variable];
        let Interval { low, high } = model.state[variable].bounds;
        let around = 4.0 * deviation.max(0.25 * mean.abs()).max(1e-3);
        let low = if low.is_finite() { low } else { mean - around };
        let high = if high.is_finite() {
            high
        } else {
            mean + around
        };
        let air = BEYOND * (high - low).max(0.0);
        let places = self
            .automaton
            .iter()
            .flat_map(|automaton| &automaton.nodes)
            .flat_map(|node| match &node.place {
                Place::Point(point) => [point[variable], point[variable]],
                Place::Segment { lower, upper, .. } => [lower[variable], upper[variable]],
            });
        let reach = 4.0 * air;
        let seen = places
            .chain([mean])
            .filter(|x| *x > low - reach && *x < high + reach);
        seen.fold((low - air, high + air), |(low, high), x| {
            (low.min(x - 0.5 * air), high.max(x + 0.5 * air))
        })
    }

    /// Levels from the least to the most certain.
    fn ordered_levels(&self) -> Vec<StratumId> {
        let spread = |level| self.space.covariance(level).trace();
        let mut ids: Vec<StratumId> = (0..self.space.strata()).collect();
        ids.sort_by(|&a, &b| spread(b).total_cmp(&spread(a)).then(a.cmp(&b)));
        ids
    }

    /// The level that repeats itself, or where there is none the most certain.
    fn steady_level(&self) -> StratumId {
        self.space
            .steady()
            .or_else(|| self.ordered_levels().last().copied())
            .unwrap_or(0)
    }

    /// Standard deviation of a variable at a level.
    fn deviation(&self, level: StratumId, variable: usize) -> f64 {
        self.space.covariance(level)[(variable, variable)]
            .max(0.0)
            .sqrt()
    }

    /// "σ = 0.48", or one for each of the variables where they differ.
    fn deviations(&self, level: StratumId, variables: &[usize]) -> String {
        let figures: Vec<String> = variables
            .iter()
            .map(|&variable| figure(self.deviation(level, variable)))
            .collect();
        if figures.windows(2).all(|pair| pair[0] == pair[1]) {
            return figures
                .first()
                .map(|sd| format!("σ = {sd}"))
                .unwrap_or_default();
        }
        let states = &self.space.model().state;
        let each = variables
            .iter()
            .zip(&figures)
            .map(|(&variable, sd)| format!("σ of {} {sd}", states[variable].name));
        each.collect::<Vec<_>>().join(", ")
    }

    /// What the policy tells apart: the automaton's modes or memories that have nodes, or else the model's modes.
    fn modes(&self) -> Vec<ModeId> {
        match self.automaton {
            None => (0..self.space.model().modes.len()).collect(),
            Some(automaton) => (0..automaton.modes.len())
                .filter(|&mode| self.nodes(mode).next().is_some())
                .collect(),
        }
    }

    /// Whether they are not the model's modes but memories of its own.
    fn remembers(&self) -> bool {
        let own = |automaton: &Automaton| automaton.modes != self.space.model().modes;
        self.automaton.is_some_and(own)
    }

    /// The mode or memory at the start.
    fn start_mode(&self) -> ModeId {
        let start = |automaton: &Automaton| automaton.updater.start().belief().mode;
        self.automaton.map_or(self.space.start().mode, start)
    }

    /// Where something good is paid in a mode, but for what is paid everywhere. What is remembered is no mode, and shows all.
    fn goals(&self, mode: ModeId) -> Vec<&Region> {
        let model = self.space.model();
        let rewards = model
            .rewards
            .iter()
            .map(|reward| (reward.mode, reward.value, &reward.region));
        let events = model
            .events
            .iter()
            .map(|event| (event.mode, event.reward, &event.region));
        let bounded = |region: &Region| {
            region
                .sides
                .iter()
                .any(|(_, side)| side.low.is_finite() && side.high.is_finite())
        };
        rewards
            .chain(events)
            .filter(|(needed, value, region)| {
                (self.remembers() || needed.is_none_or(|needed| needed == mode))
                    && *value > 0.0
                    && bounded(region)
            })
            .map(|(_, _, region)| region)
            .collect()
    }

    /// By what levels are told apart where the probability of modes is part of them, and none is believed.
    fn codebook(&self) -> Option<&Codebook> {
        let codebook = self.updater.codebook();
        codebook.filter(|_| self.space.model().modes.len() > 1 && !self.remembers())
    }

    /// Name of a mode or memory for a heading; empty where there is only one.
    fn mode_name(&self, mode: ModeId) -> &str {
        let modes = self
            .automaton
            .map_or(&self.space.model().modes, |automaton| &automaton.modes);
        if modes.len() > 1 { &modes[mode] } else { "" }
    }
}
