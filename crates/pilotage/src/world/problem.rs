//! The world of a scenario: where it starts, what a step pays and changes. What moves in it is a [`Body`].

use super::cart_pole::CartAndPole;
use super::lawful::Lawful;
use super::linear::Linear;
use super::noise::Noise;
use super::robot::Driven;
use super::{Body, Doing, Observation, Step, Streams, World};
use crate::model::{
    ActionId, Barriers, EffectTable, ModeId, Model, Outcome, Point, StartHypothesis, StartShape,
    Tally, Then, When,
};
use crate::random::uniform;
use crate::scenario::{Scenario, Simulator, Walls};

/// Times that a start within the limits of the episode is drawn for; what is then still outside fails at once.
const TRIES: usize = 1000;

/// The true world of a [`Scenario`]: its model's own linear motion unless it names another simulator.
pub struct ProblemWorld {
    model: Model,
    starts: Vec<(StartHypothesis, Noise)>,
    body: Box<dyn Body>,
    walls: Option<Barriers>,
    effects: EffectTable,
    state: Vec<f64>,
    scratch: Vec<f64>,
    mode: ModeId,
    /// Steps taken since the start.
    time: usize,
    hypothesis: usize,
}

impl ProblemWorld {
    /// The world of a scenario, at a start that [`World::reset`] has yet to draw.
    pub fn new(scenario: &Scenario) -> Self {
        let (model, truth) = (&scenario.model, &scenario.truth);
        let body: Box<dyn Body> = match &truth.simulator {
            Simulator::Linear if model.is_linear() => Box::new(Linear::new(scenario)),
            Simulator::Linear => Box::new(Lawful::new(model)),
            Simulator::CartPole(parameters) => Box::new(CartAndPole::new(scenario, parameters)),
            Simulator::Robot(robot) => Box::new(Driven::new(scenario, robot)),
        };
        let start = |start: &StartHypothesis| (start.clone(), Noise::new(&start.covariance));
        Self {
            starts: scenario.start().iter().map(start).collect(),
            body,
            walls: (truth.walls == Walls::Clamp).then(|| Barriers::new(model)),
            effects: EffectTable::new(model, |effects| effects),
            state: model.start[0].mean.as_slice().to_vec(),
            scratch: vec![0.0; model.state_dim()],
            mode: model.start[0].mode,
            time: 0,
            hypothesis: 0,
            model: model.clone(),
        }
    }

    /// Which of the true start hypotheses the last [`World::reset`] drew.
    pub(crate) fn hypothesis(&self) -> usize {
        self.hypothesis
    }

    /// Comes to where another world of the same scenario is. What a simulated body keeps for itself is not told: this is for worlds that
    /// models assume, whose bodies keep nothing.
    pub(crate) fn resume(&mut self, at: &Self) {
        self.state.copy_from_slice(&at.state);
        self.mode = at.mode;
        self.time = at.time;
        self.hypothesis = at.hypothesis;
    }

    /// An action, in the mode and phase of now.
    fn doing(&self, action: ActionId) -> Doing {
        Doing {
            mode: self.mode,
            action,
            phase: self.model.phase(self.time),
            step: self.time,
        }
    }

    fn move_on(&mut self, doing: Doing, draws: &mut Streams) {
        self.body
            .advance(doing, &self.state, &mut self.scratch, &mut draws.world);
        if let Some(walls) = &self.walls {
            walls.stop(&self.state, &mut self.scratch);
            self.body.rest(&mut self.scratch);
        }
        std::mem::swap(&mut self.state, &mut self.scratch);
    }

    /// Lets the current state be sensed, unless the reading is missing.
    fn sense(&self, doing: Doing, draws: &mut Streams, observation: &mut Observation) {
        let doing = Doing {
            mode: self.mode,
            ..doing
        };
        let known = self.body.present(doing, &self.state);
        let present = known.unwrap_or_else(|| self.model.sensor_at(self.time).present);
        // A reading that always comes takes no draw.
        if present < 1.0 && uniform(&mut draws.sensor) >= present {
            return observation.silence();
        }
        self.body
            .sense(doing, &self.state, observation, &mut draws.sensor);
    }

    /// Takes in what the step does in the current state; what has happened, if an event has.
    fn see(
        &self,
        when: When,
        doing: Doing,
        tally: &mut Tally,
        draws: &mut Streams,
    ) -> Option<Outcome> {
        let effects = self.effects.at(self.time, doing.mode, doing.action);
        let now = effects.iter().filter(|effect| effect.when == when);
        let point = Point {
            state: &self.state,
            control: self.model.actions[doing.action].control.as_slice(),
            step: self.time,
        };
        tally.live(now, &point, &mut || uniform(&mut draws.world))
    }

    /// Draws a state from the start hypothesis.
    fn draw_start(&mut self, draws: &mut Streams) {
        let (start, noise) = &self.starts[self.hypothesis];
        self.state.copy_from_slice(start.mean.as_slice());
        match start.shape {
            StartShape::Normal => noise.add_to(&mut self.state, &mut draws.world),
            StartShape::Uniform => {
                for (i, value) in self.state.iter_mut().enumerate() {
                    let width = (12.0 * start.covariance[(i, i)]).sqrt();
                    *value += width * (uniform(&mut draws.world) - 0.5);
                }
            }
        }
        if let Some(walls) = &self.walls {
            walls.stop(start.mean.as_slice(), &mut self.state);
        }
        self.body.put(&mut self.state);
    }

    /// A step that ends or restarts the episode.
    fn close(&mut self, reward: f64, then: Then, draws: &mut Streams) -> Step {
        if then == Then::Restart {
            self.reset(draws);
        }
        Step {
            reward,
            then,
            failed: false,
        }
    }
}

impl World for ProblemWorld {
    fn reset(&mut self, draws: &mut Streams) {
        let mut chance = uniform(&mut draws.world);
        let chosen = self.starts.iter().position(|(start, _)| {
            chance -= start.weight;
            chance < 0.0
        });
        self.hypothesis = chosen.unwrap_or(self.starts.len() - 1);
        self.time = 0;
        self.mode = self.starts[self.hypothesis].0.mode;
        // Who has failed before the first step was never there.
        for _ in 0..TRIES {
            self.draw_start(draws);
            if self.model.episode.alive.contains(&self.state) {
                return;
            }
        }
    }

    fn step(
        &mut self,
        action: ActionId,
        draws: &mut Streams,
        observation: &mut Observation,
    ) -> Step {
        let doing = self.doing(action);
        let mut tally = self.model.tally(self.mode, action);
        tally.reward += self.model.running_cost(&self.state, None, action);
        let before = self.see(When::Before, doing, &mut tally, draws);
        let outcome = before.unwrap_or_else(|| tally.rest());
        self.mode = outcome.mode;
        if outcome.then != Then::Continue {
            return self.close(tally.reward, outcome.then, draws);
        }
        self.move_on(doing, draws);
        if !self.model.episode.alive.contains(&self.state) {
            return Step {
                reward: tally.reward + self.model.episode.failure_reward,
                then: Then::End,
                failed: true,
            };
        }
        if let Some(outcome) = self.see(When::After, doing, &mut tally, draws) {
            self.mode = outcome.mode;
            if outcome.then != Then::Continue {
                return self.close(tally.reward, outcome.then, draws);
            }
        }
        self.sense(doing, draws, observation);
        self.time += 1;
        Step {
            reward: tally.reward,
            then: Then::Continue,
            failed: false,
        }
    }

    fn ending(&self) -> f64 {
        self.model.terminal_cost(&self.state, None)
    }

    fn state(&self) -> &[f64] {
        &self.state
    }

    fn mode(&self) -> ModeId {
        self.mode
    }
}
