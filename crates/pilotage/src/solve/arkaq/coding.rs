//! What the network is shown: the mean of a belief, the action that led to it, the cluster before, and whether it was rewarded.
//!
//! The mean is scaled by the world's outer bounds and complement coded, which is what two range finders read between opposite walls.
//! The cluster before is shown as the centre that it passes on, a place and an action, mixed with what was passed on to it (M.
//! Strickert, B. Hammer, *Merge SOM for temporal data*, Neurocomputing 64, 2005). A notable reward sets clusters apart at any vigilance but 0, so
//! that the goal has its own; agents that run the automaton see no rewards, and find their clusters by the rest.

use super::art::complement;
use super::task::Task;
use crate::belief::recall::{Weights, scaled};
use crate::belief::{Cluster, Recall, Sight};
use crate::model::{ActionId, Model};

/// Makes inputs of places, actions and rewards, and clusters of centres. Squared distances between inputs, rewards aside, are those of
/// [`Recall`].
pub(super) struct Coding<'a> {
    model: &'a Model,
    weights: Weights,
}

impl<'a> Coding<'a> {
    pub fn new(task: &'a Task<'_>) -> Self {
        Self {
            model: task.mdp.model(),
            weights: Weights {
                before: task.settings.before,
                past: task.settings.past,
                action: task.settings.action,
            },
        }
    }

    /// Length of an input: places and actions now and before, and one component for the reward.
    pub fn length(&self) -> usize {
        2 * self.sight() + 1
    }

    /// Length of a complement coded place with its actions.
    fn sight(&self) -> usize {
        2 * self.model.state.len() + self.model.actions.len()
    }

    /// The input of the belief that an episode starts with: it comes from where it is, by no action.
    pub fn start(&self, mean: &[f64]) -> Vec<f64> {
        let sight = self.code(mean, None);
        self.input(&sight, &sight, false)
    }

    /// The input of a belief that an action led to, from the cluster with a centre.
    pub fn arrival(&self, mean: &[f64], before: &[f64], action: ActionId, event: bool) -> Vec<f64> {
        let (now, earlier) = before.split_at(self.sight());
        let passed: Vec<f64> = now
            .iter()
            .zip(earlier)
            .map(|(now, earlier)| {
                let earlier = unscaled(*earlier, self.before_unit());
                self.weights.passed(*now, earlier)
            })
            .collect();
        self.input(&self.code(mean, Some(action)), &passed, event)
    }

    fn input(&self, sight: &[f64], before: &[f64], event: bool) -> Vec<f64> {
        let unit = self.before_unit();
        let mut input = sight.to_vec();
        input.extend(before.iter().map(|x| unit * x));
        input.push(f64::from(u8::from(event)));
        input
    }

    /// A place and an action as components: opposite corners of the world are at distance 1.
    fn code(&self, mean: &[f64], action: Option<ActionId>) -> Vec<f64> {
        let variables = self.model.state.iter().zip(mean);
        let place: Vec<f64> = variables
            .map(|(variable, m)| scaled(&variable.bounds, *m))
            .collect();
        let mut code: Vec<f64> = complement(&place).map(|x| self.place_unit() * x).collect();
        code.resize(self.sight(), 0.0);
        if let Some(action) = action {
            code[2 * place.len() + action] = self.action_unit();
        }
        code
    }

    fn place_unit(&self) -> f64 {
        1.0 / (2.0 * self.model.state.len() as f64).sqrt()
    }

    fn before_unit(&self) -> f64 {
        self.weights.before.sqrt()
    }

    fn action_unit(&self) -> f64 {
        (0.5 * self.weights.action).sqrt()
    }

    /// How the agent recalls the clusters with these centres.
    pub fn recall(&self, centres: &[Vec<f64>]) -> Recall {
        let clusters = centres.iter().map(|centre| {
            let (now, before) = centre.split_at(self.sight());
            Cluster {
                now: self.decode(now, 1.0),
                before: self.decode(before, self.before_unit()),
            }
        });
        Recall::new(self.model, self.weights, clusters.collect())
    }

    fn decode(&self, code: &[f64], unit: f64) -> Sight {
        let n = self.model.state.len();
        let part = |part: &[f64], unit: f64| -> Vec<f64> {
            part.iter().map(|x| unscaled(*x, unit)).collect()
        };
        Sight {
            place: part(&code[..n], unit * self.place_unit()),
            actions: part(&code[2 * n..self.sight()], unit * self.action_unit()),
        }
    }

    /// By cluster: how much of it was rewarded.
    pub fn rewarded(&self, centres: &[Vec<f64>]) -> Vec<f64> {
        let rewarded = centres.iter().map(|centre| centre[self.length() - 1]);
        rewarded.collect()
    }
}

/// A component without its unit; one of no weight is 0.
fn unscaled(x: f64, unit: f64) -> f64 {
    if unit > 0.0 { x / unit } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model;
    use crate::random::{Role, stream, uniform};
    use crate::solve::arkaq::Settings;
    use crate::solve::arkaq::art::{Art, Rule, Settings as Network};
    use crate::world::{ProblemWorld, World};

    /// Without rewards, the network and the filter that recalls its centres find the same clusters.
    #[test]
    fn the_filter_recalls_the_clusters_of_the_network() {
        let model = model::find("maze-4x4").expect("it is built in");
        let worlds = || -> Box<dyn World> { Box::new(ProblemWorld::new(&model)) };
        let settings = Settings {
            before: 0.7,
            past: 0.3,
            action: 0.4,
            ..Settings::default()
        };
        let task = Task::new(&model, settings, &worlds).expect("it has bounds");
        let coding = Coding::new(&task);
        let network = Network {
            vigilance: 0.6,
            rate: 0.1,
            rule: Rule::Distance { extent: 1.0 },
            limit: 100,
        };
        let mut art = Art::new(coding.length(), network).expect("settings are in range");
        let mut rng = stream(1, 0, Role::World);
        let mut draw = || {
            (
                [4.0 * uniform(&mut rng), 4.0 * uniform(&mut rng)],
                (4.0 * uniform(&mut rng)) as usize,
            )
        };
        let mut at = art
            .present(&coding.start(&[1.0, 2.0]))
            .expect("it is finite")
            .category;
        for _ in 0..500 {
            let (mean, action) = draw();
            let input = coding.arrival(&mean, &art.centres()[at], action, false);
            at = art.present(&input).expect("it is finite").category;
        }
        let recall = coding.recall(art.centres());
        assert!(recall.clusters().len() > 10);
        let found = |input: &[f64]| {
            art.classify(input)
                .expect("it is finite")
                .map(|best| best.0)
        };
        for _ in 0..500 {
            let (mean, action) = draw();
            let input = coding.arrival(&mean, &art.centres()[at], action, false);
            let next = recall.next(at, action, &mean);
            assert_eq!(found(&input), Some(next));
            assert_eq!(found(&coding.start(&mean)), Some(recall.first(&mean)));
            at = next;
        }
    }
}
