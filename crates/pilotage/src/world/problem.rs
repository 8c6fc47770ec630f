//! The world a model file describes.

use super::cart_pole::Plant;
use super::noise::Noise;
use super::robot::RobotArena;
use super::{Draws, Step, World};
use crate::model::{ActionId, Barriers, ModeId, Model, StartHypothesis, StartShape, Then, When};
use crate::random::{normal, uniform};
use crate::scenario::{Scenario, Simulator, Walls};

/// The true world of a [`Scenario`]: its model's own linear motion unless it names another simulator.
#[derive(Debug, Clone)]
pub struct ProblemWorld {
    model: Model,
    starts: Vec<(StartHypothesis, Noise)>,
    dynamics: Dynamics,
    sensor_noise: Vec<Noise>,
    walls: Option<Barriers>,
    state: Vec<f64>,
    scratch: Vec<f64>,
    mode: ModeId,
    hypothesis: usize,
}

#[derive(Debug, Clone)]
enum Dynamics {
    /// `s' = A s + B u + v`, with displacement by mode and action, and noise by action; `A` row by row.
    Linear {
        a: Vec<f64>,
        displacements: Vec<Vec<Vec<f64>>>,
        noise: Vec<Noise>,
    },
    /// Cart and pole, with the force of each action and the standard deviation of its noise.
    CartPole {
        plant: Plant,
        forces: Vec<f64>,
        force_sd: f64,
    },
    /// A robot, with the displacement that each action names.
    Robot {
        arena: RobotArena,
        displacements: Vec<Vec<f64>>,
    },
}

impl ProblemWorld {
    /// The world of a scenario, at a start that [`World::reset`] has yet to draw.
    pub fn new(scenario: &Scenario) -> Self {
        let (model, truth) = (&scenario.model, &scenario.truth);
        let actions = 0..model.actions.len();
        let dynamics = match &truth.simulator {
            Simulator::Linear => Dynamics::Linear {
                a: model.motion.a.transpose().as_slice().to_vec(),
                displacements: (0..model.modes.len())
                    .map(|mode| {
                        let truly = |action| displacement(scenario, mode, action);
                        actions.clone().map(truly).collect()
                    })
                    .collect(),
                noise: actions
                    .clone()
                    .map(|action| {
                        let truly = truth.motion.noise.as_ref();
                        Noise::new(truly.unwrap_or_else(|| model.motion_noise(action)))
                    })
                    .collect(),
            },
            Simulator::CartPole(parameters) => Dynamics::CartPole {
                plant: Plant::new(parameters.clone()),
                forces: model
                    .actions
                    .iter()
                    .map(|action| action.control[0])
                    .collect(),
                force_sd: parameters.force_noise.sqrt(),
            },
            Simulator::Robot(robot) => Dynamics::Robot {
                arena: RobotArena::new(robot, model),
                displacements: actions
                    .clone()
                    .map(|action| model.displacement(action).as_slice().to_vec())
                    .collect(),
            },
        };
        Self {
            starts: scenario
                .start()
                .iter()
                .map(|start| (start.clone(), Noise::new(&start.covariance)))
                .collect(),
            dynamics,
            sensor_noise: actions
                .map(|action| Noise::new(model.sensor_noise(action)))
                .collect(),
            walls: (truth.walls == Walls::Clamp).then(|| Barriers::new(model)),
            state: model.start[0].mean.as_slice().to_vec(),
            scratch: vec![0.0; model.state_dim()],
            mode: model.start[0].mode,
            hypothesis: 0,
            model: model.clone(),
        }
    }

    /// Which of the true start hypotheses the last [`World::reset`] drew.
    pub fn hypothesis(&self) -> usize {
        self.hypothesis
    }

    fn move_on(&mut self, mode: ModeId, action: ActionId, draws: &mut Draws) {
        match &mut self.dynamics {
            Dynamics::Linear {
                a,
                displacements,
                noise,
            } => {
                let n = self.state.len();
                for (i, value) in self.scratch.iter_mut().enumerate() {
                    let row: f64 = a[i * n..(i + 1) * n]
                        .iter()
                        .zip(&self.state)
                        .map(|(a, s)| a * s)
                        .sum();
                    *value = row + displacements[mode][action][i];
                }
                noise[action].add_to(&mut self.scratch, &mut draws.world);
            }
            Dynamics::CartPole {
                plant,
                forces,
                force_sd,
            } => {
                self.scratch.copy_from_slice(&self.state);
                plant.advance(
                    &mut self.scratch,
                    forces[action] + *force_sd * normal(&mut draws.world),
                );
            }
            Dynamics::Robot {
                arena,
                displacements,
            } => arena.carry_out(&displacements[action], &mut self.scratch, &mut draws.world),
        }
        if let Some(walls) = &self.walls {
            walls.stop(&self.state, &mut self.scratch);
        }
        std::mem::swap(&mut self.state, &mut self.scratch);
    }

    /// Writes what is sensed in the current state after an action.
    fn sense(&self, action: ActionId, draws: &mut Draws, observation: &mut [f64]) {
        if let Dynamics::Robot { arena, .. } = &self.dynamics {
            arena.sense(observation, &mut draws.sensor);
            return;
        }
        let h = &self.model.sensor.h;
        for (i, reading) in observation.iter_mut().enumerate() {
            *reading = (0..self.state.len())
                .map(|j| h[(i, j)] * self.state[j])
                .sum();
        }
        self.sensor_noise[action].add_to(observation, &mut draws.sensor);
    }

    /// What is paid in the current state for the action taken in the mode.
    fn paid(&self, when: When, mode: ModeId, action: ActionId) -> f64 {
        let rewards = self.model.rewards.iter().filter(|reward| {
            reward.when == when
                && reward.applies(mode, action)
                && reward.region.contains(&self.state)
        });
        rewards.map(|reward| reward.value).sum()
    }

    /// Lets the first event that applies in the current state happen; returns its reward and what it does to the episode.
    fn happen(&mut self, when: When, action: ActionId) -> Option<(f64, Then)> {
        let event = self.model.events.iter().find(|event| {
            event.when == when
                && event.applies(self.mode, action)
                && event.region.contains(&self.state)
        })?;
        self.mode = event.becomes.unwrap_or(self.mode);
        Some((event.reward, event.then))
    }

    /// A step that ends or restarts the episode.
    fn close(&mut self, reward: f64, then: Then, draws: &mut Draws) -> Step {
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

/// True `B u` of an action in a mode.
fn displacement(scenario: &Scenario, mode: ModeId, action: ActionId) -> Vec<f64> {
    let model = &scenario.model;
    let mut controls = scenario.truth.motion.controls.iter();
    let truly = controls.find(|control| control.applies(mode, action));
    let control = truly.map_or(&model.actions[action].control, |truly| &truly.control);
    (&model.motion.b * control).as_slice().to_vec()
}

impl World for ProblemWorld {
    fn reset(&mut self, draws: &mut Draws) {
        let mut chance = uniform(&mut draws.world);
        let chosen = self.starts.iter().position(|(start, _)| {
            chance -= start.weight;
            chance < 0.0
        });
        self.hypothesis = chosen.unwrap_or(self.starts.len() - 1);
        let (start, noise) = &self.starts[self.hypothesis];
        self.mode = start.mode;
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
        if let Dynamics::Robot { arena, .. } = &mut self.dynamics {
            arena.put(&mut self.state);
        }
    }

    fn step(&mut self, action: ActionId, draws: &mut Draws, observation: &mut [f64]) -> Step {
        let mode = self.mode;
        let mut reward = self.paid(When::Before, mode, action);
        let mut then = self.model.actions[action].then;
        let before = self.happen(When::Before, action);
        if let Some((paid, event_then)) = before {
            reward += paid;
            if then == Then::Continue {
                then = event_then;
            }
        }
        if then != Then::Continue {
            return self.close(reward, then, draws);
        }
        self.move_on(mode, action, draws);
        if !self.model.episode.alive.contains(&self.state) {
            return Step {
                reward: reward + self.model.episode.failure_reward,
                then: Then::End,
                failed: true,
            };
        }
        reward += self.paid(When::After, mode, action);
        if before.is_none()
            && let Some((paid, then)) = self.happen(When::After, action)
        {
            reward += paid;
            if then != Then::Continue {
                return self.close(reward, then, draws);
            }
        }
        self.sense(action, draws, observation);
        Step {
            reward,
            then: Then::Continue,
            failed: false,
        }
    }

    fn state(&self) -> &[f64] {
        &self.state
    }

    fn mode(&self) -> ModeId {
        self.mode
    }
}
