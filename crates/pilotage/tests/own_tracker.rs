//! Trackers that the library does not know: a histogram that knows of walls, and odds that are moved by signals. Agents, evaluation and
//! policies take them as they take the Kalman filter.
#![allow(clippy::unwrap_used)]

use pilotage::belief::{Belief, BeliefMdp, Reading, Tracker, Tracking};
use pilotage::model::{ActionId, ModeId, Model, Then};
use pilotage::policy::Policy;
use pilotage::progress::Silent;
use pilotage::scenario;
use pilotage::simulate::{Agent, Estimate, Options, TrackingAgent, evaluate, run_episode};
use pilotage::solve::{Form, Request, ValueIteration, plan};
use pilotage::world::{Observation, Step, Streams, World};

/// Cells along one variable, whose ends stop whoever walks into them.
struct Cells<'a> {
    mdp: &'a BeliefMdp,
    count: usize,
}

struct CellTracker<'a> {
    cells: &'a Cells<'a>,
    start: Vec<f64>,
    weights: Vec<f64>,
    belief: Belief,
}

impl Cells<'_> {
    fn model(&self) -> &Model {
        self.mdp.model()
    }

    fn at(&self, cell: usize) -> f64 {
        let bounds = self.model().state[0].bounds;
        bounds.low + (cell as f64 + 0.5) * bounds.width() / self.count as f64
    }

    /// Density of a Gaussian but for a factor.
    fn bell(apart: f64, variance: f64) -> f64 {
        (-0.5 * apart * apart / variance).exp()
    }

    /// As a policy reads it: the mean, and the stratum whose variance is closest.
    fn read(&self, weights: &[f64]) -> Belief {
        let moment = |of: &dyn Fn(f64) -> f64| -> f64 {
            let cells = weights.iter().enumerate();
            cells.map(|(cell, weight)| weight * of(self.at(cell))).sum()
        };
        let mean = moment(&|x| x);
        let variance = moment(&|x| (x - mean).powi(2));
        let gap = |stratum| (self.mdp.covariance(stratum)[0] - variance).abs();
        let strata = 0..self.mdp.strata();
        Belief {
            stratum: strata.min_by(|&a, &b| gap(a).total_cmp(&gap(b))).unwrap(),
            mode: 0,
            mean: vec![mean],
        }
    }
}

fn normalised(mut weights: Vec<f64>) -> Vec<f64> {
    let total: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= total);
    weights
}

impl Tracking for Cells<'_> {
    fn tracker(&self) -> Box<dyn Tracker + '_> {
        let start = &self.model().start[0];
        let (mean, variance) = (start.mean[0], start.covariance[0]);
        let weight = |cell| Self::bell(self.at(cell) - mean, variance);
        let weights = normalised((0..self.count).map(weight).collect());
        Box::new(CellTracker {
            cells: self,
            belief: self.read(&weights),
            start: weights.clone(),
            weights,
        })
    }
}

impl Tracker for CellTracker<'_> {
    fn reset(&mut self) {
        self.weights.clone_from(&self.start);
        self.belief = self.cells.read(&self.weights);
    }

    fn update(&mut self, action: ActionId, reading: Reading<'_>) {
        let (cells, model) = (self.cells, self.cells.model());
        let shift = model.displacement(action, 0)[0];
        let (moved, sensed) = (
            model.motion_noise(action, 0)[0],
            model.sensor_noise(action, 0)[0],
        );
        let bounds = model.state[0].bounds;
        let mut next = vec![0.0; cells.count];
        for (from, weight) in self.weights.iter().enumerate() {
            let mean = cells.at(from) + shift;
            // What would lie beyond a wall is stopped there.
            let reach = 5.0 * moved.sqrt();
            let steps = 60;
            let ways = (0..=steps).map(|k| -reach + 2.0 * reach * f64::from(k) / f64::from(steps));
            let ways: Vec<(f64, f64)> = ways.map(|way| (way, Self::way(way, moved))).collect();
            let total: f64 = ways.iter().map(|way| way.1).sum();
            for (way, chance) in ways {
                let share = (bounds.clamp(mean + way) - bounds.low) / bounds.width();
                let cell = ((share * cells.count as f64) as usize).min(cells.count - 1);
                next[cell] += weight * chance / total;
            }
        }
        if let Reading::Values(values) = reading {
            for (cell, weight) in next.iter_mut().enumerate() {
                *weight *= Cells::bell(values[0] - cells.at(cell), sensed);
            }
        }
        self.weights = normalised(next);
        self.belief = cells.read(&self.weights);
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }
}

impl CellTracker<'_> {
    fn way(way: f64, variance: f64) -> f64 {
        if variance == 0.0 {
            return 1.0;
        }
        Cells::bell(way, variance)
    }
}

/// In the corridor walls stop the robot, and its Kalman filter does not know. The same plan, on a belief that does, earns more.
#[test]
fn a_histogram_that_knows_of_walls_takes_the_place_of_the_filter() {
    let scenario = scenario::find("corridor-blind").unwrap();
    let mdp = BeliefMdp::new(&scenario.model);
    let request = Request::form(Form::Nearest);
    let solver = ValueIteration::default();
    let solution = plan(&solver, &scenario.model, &request, &Silent).unwrap();
    let options = Options {
        episodes: 2000,
        seed: 3,
    };
    let cells = Cells {
        mdp: &mdp,
        count: 80,
    };
    let automaton = solution.automaton().unwrap();
    let policy = pilotage::policy::AutomatonRunner::new(automaton);
    let earned = |tracking: &dyn Tracking| {
        evaluate(&scenario, tracking, &policy, options, &Silent).discounted
    };
    let (filter, histogram) = (earned(&automaton.updater), earned(&cells));
    let gained = histogram.mean - filter.mean;
    let stderr = filter.stderr.hypot(histogram.stderr);
    assert!(gained > 5.0 * stderr, "{filter:?} and {histogram:?}");
}

/// A coin that lies on one side. Whoever looks is told which with a probability of 0.8, now and then not at all; who names a side
/// is paid 1 if it is right.
struct Coin {
    side: [f64; 1],
}

const LOOK: ActionId = 0;

impl World for Coin {
    fn reset(&mut self, streams: &mut Streams) {
        self.side = [f64::from(u8::from(uniform(&mut streams.world) < 0.5))];
    }

    fn step(&mut self, action: ActionId, streams: &mut Streams, seen: &mut Observation) -> Step {
        if action == LOOK {
            let chance = uniform(&mut streams.sensor);
            let told = if chance < 0.72 {
                self.side[0]
            } else {
                1.0 - self.side[0]
            };
            match chance < 0.9 {
                true => seen.signal(told as u32),
                false => seen.silence(),
            }
        }
        Step {
            reward: f64::from(u8::from(action == 1 + self.side[0] as usize)),
            then: if action == LOOK {
                Then::Continue
            } else {
                Then::End
            },
            failed: false,
        }
    }

    fn state(&self) -> &[f64] {
        &self.side
    }

    fn mode(&self) -> ModeId {
        0
    }
}

fn uniform(rng: &mut pilotage::random::Rng) -> f64 {
    pilotage::random::uniform(rng)
}

/// Log-odds of side 1, as a mean.
struct Odds;

struct OddsTracker {
    belief: Belief,
}

impl Tracking for Odds {
    fn tracker(&self) -> Box<dyn Tracker + '_> {
        let mean = vec![0.0];
        Box::new(OddsTracker {
            belief: Belief {
                stratum: 0,
                mode: 0,
                mean,
            },
        })
    }
}

impl Tracker for OddsTracker {
    fn reset(&mut self) {
        self.belief.mean[0] = 0.0;
    }

    fn update(&mut self, _: ActionId, reading: Reading<'_>) {
        if let Reading::Symbol(side) = reading {
            self.belief.mean[0] += (2.0 * f64::from(side) - 1.0) * 4_f64.ln();
        }
    }

    fn belief(&self) -> &Belief {
        &self.belief
    }
}

/// Looks until two more signals were for one side than for the other.
struct Twice;

impl Policy for Twice {
    fn action(&self, belief: &Belief) -> ActionId {
        let odds = belief.mean[0] / 4_f64.ln();
        match odds.abs() > 1.5 {
            true => 1 + usize::from(odds > 0.0),
            false => LOOK,
        }
    }
}

/// Two signals ahead with odds of 4 each are odds of 16: 16 times of 17 it is right, however often nothing was heard.
#[test]
fn signals_move_a_belief_of_another_kind() {
    let mut world = Coin { side: [0.0] };
    let mut agent = TrackingAgent::new(&Odds, &Twice);
    let mut seen = Observation::new(0);
    let right = (0..20_000).map(|episode| {
        let mut streams = Streams::new(9, episode);
        run_episode(
            &mut world,
            &mut agent,
            &mut streams,
            &mut seen,
            (1000, 1.0),
            &mut |_, _| {},
        )
        .undiscounted
    });
    let right: Vec<f64> = right.collect();
    let right = Estimate::of(right.iter().copied());
    assert!(
        (right.mean - 16.0 / 17.0).abs() < 4.0 * right.stderr,
        "{right:?}"
    );
    assert!(agent.belief().unwrap().mean[0].abs() > 2.0);
}
