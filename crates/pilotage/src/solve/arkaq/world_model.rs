//! WorldModelGenerator (Figure 3.2): clusters of beliefs, found by acting at random.

use serde::{Deserialize, Serialize};

use super::ClusterFound;
use super::art::{Art, Match, Outcome, Rule, Settings as Network};
use super::coding::Coding;
use super::task::Task;
use crate::belief::Recall;
use crate::error::Result;
use crate::model::Then;
use crate::solve::learn::{Actor, Experience, any_action};

/// What exploration found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct WorldModel {
    pub vigilance: f64,
    /// The clusters, as the agent recalls them.
    pub recall: Recall,
    /// By cluster: how much of it was rewarded, in `[0, 1]`.
    pub rewarded: Vec<f64>,
    /// Whether no new cluster had been found for long.
    pub settled: bool,
    /// Whether a cluster would have been made that was not allowed.
    pub capped: bool,
    /// Steps of experience at which each cluster was founded.
    pub growth: Vec<u64>,
}

impl WorldModel {
    /// How exploration ended, in a sentence.
    pub fn describe(&self) -> String {
        let (vigilance, clusters) = (self.vigilance, self.recall.clusters().len());
        if self.capped {
            format!(
                "vigilance {vigilance}: the limit of {clusters} clusters is reached and beliefs call for more; the policy is learned on \
                 these; lower the vigilance or raise `cluster_limit`"
            )
        } else {
            format!("vigilance {vigilance}: {clusters} clusters")
        }
    }

    /// The clusters, as a result tells of them.
    pub fn clusters(&self) -> Vec<ClusterFound> {
        let clusters = self.recall.clusters().iter();
        clusters
            .zip(self.rewarded.iter().zip(&self.growth))
            .map(|(cluster, (&rewarded, &founded))| ClusterFound {
                centre: cluster.clone(),
                rewarded,
                founded,
            })
            .collect()
    }
}

/// Acts at random until no new clusters are found, or there are too many.
pub(super) fn generate(
    task: &Task<'_>,
    vigilance: f64,
    experience: &mut Experience,
) -> Result<WorldModel> {
    let settings = &task.settings;
    let coding = Coding::new(task);
    let network = Network {
        vigilance,
        rate: settings.rate,
        rule: Rule::Distance { extent: 1.0 },
        limit: settings.cluster_limit,
    };
    let mut explorer = Explorer {
        art: Art::new(coding.length(), network)?,
        coding,
        growth: Vec::new(),
        capped: false,
        since: 0,
    };
    let first = experience.samples + settings.scout as u64;
    let limit = first + settings.explore_limit as u64;
    let mut actor = Actor::new(task.worlds, &task.filter);
    while !explorer.capped && explorer.since < settings.settle && experience.samples < limit {
        let scouting = experience.samples < first;
        let (mut draws, mut exploration) = experience.next_episode(settings.seed);
        actor.reset(&mut draws);
        let mut before = None;
        if !scouting {
            before = Some(explorer.start(&actor.belief.mean, experience)?);
        }
        for _ in 0..task.mdp.model().episode.length {
            let action = any_action(task.actions(), &mut exploration);
            let step = actor.step(action, &mut draws);
            experience.collect(step.reward);
            let mean = &actor.belief.mean;
            before = match (step.then, before) {
                (Then::End, _) => break,
                (_, None) => None,
                (Then::Restart, _) => Some(explorer.start(mean, experience)?),
                (Then::Continue, Some(before)) => {
                    let event = experience.is_notable(step.reward, settings.notable);
                    Some(explorer.arrive(mean, before, action, event, experience)?)
                }
            };
        }
    }
    Ok(WorldModel {
        vigilance,
        recall: explorer.coding.recall(explorer.art.centres()),
        rewarded: explorer.coding.rewarded(explorer.art.centres()),
        settled: explorer.since >= settings.settle,
        capped: explorer.capped,
        growth: explorer.growth,
    })
}

/// ART2BeliefSimplexUpdate.
struct Explorer<'a> {
    art: Art,
    coding: Coding<'a>,
    growth: Vec<u64>,
    capped: bool,
    /// Steps since the last new cluster.
    since: usize,
}

impl Explorer<'_> {
    /// The cluster of the belief that an episode starts with.
    fn start(&mut self, mean: &[f64], experience: &Experience) -> Result<usize> {
        let shown = self.art.present(&self.coding.start(mean))?;
        Ok(self.take(shown, experience))
    }

    /// The cluster of a belief that an action led to.
    fn arrive(
        &mut self,
        mean: &[f64],
        before: usize,
        action: usize,
        event: bool,
        experience: &Experience,
    ) -> Result<usize> {
        let before = &self.art.centres()[before];
        let input = self.coding.arrival(mean, before, action, event);
        let shown = self.art.present(&input)?;
        Ok(self.take(shown, experience))
    }

    fn take(&mut self, shown: Match, experience: &Experience) -> usize {
        self.since += 1;
        match shown.outcome {
            Outcome::Resonated => {}
            Outcome::Full => self.capped = true,
            Outcome::Committed => {
                self.since = 0;
                self.growth.push(experience.samples);
            }
        }
        shown.category
    }
}
