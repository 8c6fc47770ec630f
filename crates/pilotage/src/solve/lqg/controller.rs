//! The exact solution for a free control over a finite episode.

use nalgebra::{DMatrix, DVector};

use super::stage::Stage;
use crate::belief::BeliefMdp;
use crate::belief::is_kept;
use crate::belief::kalman::Correction;
use crate::error::{Error, Result};
use crate::model::{Model, QuadraticCost};
use crate::progress::Progress;
use crate::scenario::{Scenario, Simulator, Walls};
use crate::simulate::{Episode, Evaluation, Options, summarise};
use crate::world::{Noise, ProblemWorld, Streams, World};

/// Most steps of an episode that gains are kept for.
const MOST_STEPS: usize = 100_000;

/// The gains of every step of an episode, of the control and of the filter.
#[derive(Debug, Clone)]
pub struct LqgController {
    model: Model,
    cost: QuadraticCost,
    /// Mean of the start belief, length `n`.
    start: DVector<f64>,
    /// By step `t`: `L_t`, `p x n`.
    gains: Vec<DMatrix<f64>>,
    /// By step `t`: the filter's step from `t` to `t + 1`.
    corrections: Vec<Correction>,
    planned_value: f64,
}

impl LqgController {
    /// Solves a model with a quadratic cost over its episode. Its expected cost is
    ///
    /// ```text
    /// J = m_0' S_0 m_0 + tr(S_0 P_0) + sum_t g^(t+1) tr(S_(t+1) W) + sum_t g^t tr(P_t L_t' M_t L_t)
    /// ```
    ///
    /// with the start's mean and covariance `m_0`, `P_0`, the discount `g`, the motion noise `W` and the filter's `P_t`. The terminal
    /// cost is paid after the last step.
    ///
    /// # Errors
    /// [`Error::Unsupported`] without a cost or for an episode of more than 100,000 steps, [`Error::NotPositiveDefinite`] where some control costs nothing, now or later.
    pub fn new(mdp: &BeliefMdp) -> Result<Self> {
        let model = mdp.model();
        let Some(cost) = model.cost.clone() else {
            return Err(Error::Unsupported {
                solver: "lqg",
                model: model.name.clone(),
                reason: "it has no [cost]; add one".to_owned(),
            });
        };
        let (a, b, discount) = (&model.motion.a, &model.motion.b, model.discount);
        let length = model.episode.length;
        if length > MOST_STEPS {
            return Err(Error::Unsupported {
                solver: "lqg",
                model: model.name.clone(),
                reason: format!(
                    "it keeps a gain for every step of an episode, {MOST_STEPS} at most, and this one has {length}; set `length` in [episode] lower"
                ),
            });
        }
        let weights = (&cost.state, &cost.control);
        let mut stages = Vec::with_capacity(length);
        let mut next = cost.terminal.clone();
        for _ in 0..length {
            let stage = Stage::new(a, b, weights, discount, &next)?;
            next.clone_from(&stage.cost);
            stages.push(stage);
        }
        stages.reverse();

        let start = DVector::from_column_slice(&mdp.start().mean);
        let mut covariance = mdp.covariance(mdp.start().stratum).clone();
        let noise = &model.motion.noise;
        let mut expected = (start.transpose() * &next * &start)[0] + (&next * &covariance).trace();
        let mut corrections = Vec::with_capacity(length);
        let mut weight = 1.0;
        for (t, stage) in stages.iter().enumerate() {
            let later = stages.get(t + 1).map_or(&cost.terminal, |next| &next.cost);
            let ignorance = stage.gain.transpose() * &stage.deviation * &stage.gain;
            expected += weight * (&covariance * ignorance).trace();
            weight *= discount;
            expected += weight * (later * noise).trace();
            let correction =
                Correction::new(a, noise, &model.sensor.h, &model.sensor.noise, &covariance);
            covariance.clone_from(&correction.covariance);
            corrections.push(correction);
        }
        Ok(Self {
            model: model.clone(),
            cost,
            start,
            gains: stages.into_iter().map(|stage| stage.gain).collect(),
            corrections,
            planned_value: -expected,
        })
    }

    /// Expected return, `-J`.
    pub fn planned_value(&self) -> f64 {
        self.planned_value
    }

    /// The gain `L_t` of a step of the episode, `p x n`; `None` after its end.
    pub fn gain(&self, time: usize) -> Option<&DMatrix<f64>> {
        self.gains.get(time)
    }

    /// Runs the controller in a linear world without walls. The same numbers for any number of threads.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for any other world: its steps know no free control.
    pub fn evaluate(
        &self,
        scenario: &Scenario,
        options: Options,
        observer: &dyn Progress,
    ) -> Result<Evaluation> {
        let truth = &scenario.truth;
        let linear = truth.simulator == Simulator::Linear && truth.motion == Default::default();
        if !linear || truth.walls != Walls::None {
            return Err(Error::Unsupported {
                solver: "lqg",
                model: self.model.name.clone(),
                reason: "a free control can be tried in the linear world that the model assumes, without walls; add `episode.alive` or a [[reward]] to steer by the actions, or set `world.walls` to \"none\"".to_owned(),
            });
        }
        let noise = (
            Noise::new(&self.model.motion.noise),
            Noise::new(&self.model.sensor.noise),
        );
        Ok(summarise(options, observer, &|| {
            let mut world = ProblemWorld::new(scenario);
            let noise = &noise;
            Box::new(move |episode| {
                let mut draws = Streams::new(options.seed, episode);
                self.run(&mut world, noise, &mut draws)
            })
        }))
    }

    /// One episode. The world is asked for its start only: its own steps know no free control.
    fn run(
        &self,
        world: &mut ProblemWorld,
        (motion_noise, sensor_noise): &(Noise, Noise),
        draws: &mut Streams,
    ) -> Episode {
        let (a, b, h) = (
            &self.model.motion.a,
            &self.model.motion.b,
            &self.model.sensor.h,
        );
        world.reset(draws);
        let mut state = DVector::from_column_slice(world.state());
        let mut mean = self.start.clone();
        let mut episode = Episode {
            discounted: 0.0,
            undiscounted: 0.0,
            steps: 0,
            failed: false,
            lost: false,
        };
        let mut weight = 1.0;
        let pay = |episode: &mut Episode, weight: f64, cost: f64| {
            episode.discounted -= weight * cost;
            episode.undiscounted -= cost;
        };
        for (gain, correction) in self.gains.iter().zip(&self.corrections) {
            let control = -(gain * &mean);
            pay(
                &mut episode,
                weight,
                quadratic(&self.cost.state, &state) + quadratic(&self.cost.control, &control),
            );
            weight *= self.model.discount;
            state = a * state + b * &control;
            motion_noise.add_to(state.as_mut_slice(), &mut draws.world);
            let mut observation = h * &state;
            sensor_noise.add_to(observation.as_mut_slice(), &mut draws.sensor);
            let predicted = a * mean + b * control;
            mean = &predicted + &correction.gain * (observation - h * &predicted);
            episode.steps += 1;
            if !is_kept(mean.as_slice()) {
                episode.lost = true;
                return episode;
            }
        }
        pay(&mut episode, weight, quadratic(&self.cost.terminal, &state));
        episode
    }
}

fn quadratic(weight: &DMatrix<f64>, x: &DVector<f64>) -> f64 {
    x.dot(&(weight * x))
}
