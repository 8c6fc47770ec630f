//! What the network is shown: the mean of a belief, and whether it was rewarded. Where beliefs are kept in full, traits of the stratum follow
//! the mean: how uncertain it is, and how likely modes are.
//!
//! The mean is scaled by the world's outer bounds and complement coded, which is what two range finders read between opposite walls. A
//! notable reward sets clusters apart at any vigilance but 0, so that the goal has its own; agents that run the automaton see no
//! rewards, and find their clusters by the mean.

use super::art::complement;
use crate::belief::Clusters;
use crate::belief::recall::scaled;
use crate::model::Interval;

/// Makes inputs of means and rewards, and clusters of centres. Squared distances between inputs, rewards aside, are those of
/// [`Clusters`]: opposite corners of the world are at distance 1.
pub(super) struct Coding {
    /// What places lie between.
    bounds: Vec<Interval>,
}

impl Coding {
    pub(super) fn new(bounds: Vec<Interval>) -> Self {
        Self { bounds }
    }

    /// Length of an input.
    pub(super) fn length(&self) -> usize {
        2 * self.bounds.len() + 1
    }

    /// The input of a place that was notably rewarded, or was not.
    pub(super) fn input(&self, place: &[f64], event: bool) -> Vec<f64> {
        let axes = self.bounds.iter().zip(place);
        let place: Vec<f64> = axes.map(|(bounds, x)| scaled(bounds, *x)).collect();
        let mut input: Vec<f64> = complement(&place).map(|x| self.unit() * x).collect();
        input.push(f64::from(u8::from(event)));
        input
    }

    fn unit(&self) -> f64 {
        1.0 / (2.0 * self.bounds.len() as f64).sqrt()
    }

    /// The clusters with these centres.
    pub(super) fn clusters(&self, centres: &[Vec<f64>]) -> Clusters {
        let place = |centre: &Vec<f64>| {
            let axes = self.bounds.iter().zip(centre);
            let places = axes.map(|(bounds, x)| bounds.low + x / self.unit() * bounds.width());
            places.collect()
        };
        Clusters::between_ends(self.bounds.clone(), centres.iter().map(place).collect())
    }

    /// By cluster: how much of it was rewarded.
    pub(super) fn rewarded(&self, centres: &[Vec<f64>]) -> Vec<f64> {
        let rewarded = centres.iter().map(|centre| centre[self.length() - 1]);
        rewarded.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Role, stream, uniform};
    use crate::scenario;
    use crate::solve::arkaq::art::{Art, Rule, Settings as Network};

    /// Without rewards, means fall into the clusters that the network finds.
    #[test]
    fn means_fall_into_the_clusters_of_the_network() {
        let model = scenario::find("maze-4x4").expect("it is built in").model;
        let bounds = model.state.iter().map(|variable| variable.bounds);
        let coding = Coding::new(bounds.collect());
        let network = Network {
            vigilance: 0.85,
            rate: 0.1,
            rule: Rule::Distance { extent: 1.0 },
            limit: 100,
        };
        let mut art = Art::new(coding.length(), network).expect("settings are in range");
        let mut rng = stream(1, 0, Role::World);
        let mut draw = || [(); 2].map(|()| 5.0 * uniform(&mut rng) - 0.5);
        for _ in 0..500 {
            art.present(&coding.input(&draw(), false))
                .expect("it is finite");
        }
        let clusters = coding.clusters(art.centres());
        assert!(clusters.len() > 10);
        for _ in 0..500 {
            let mean = draw();
            let found = art
                .classify(&coding.input(&mean, false))
                .expect("it is finite");
            assert_eq!(found.map(|best| best.0), Some(clusters.nearest(&mean)));
        }
    }
}
