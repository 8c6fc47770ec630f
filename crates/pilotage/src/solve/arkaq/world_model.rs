//! WorldModelGenerator (Figure 3.2): clusters of beliefs and the histories in which they follow one another, found by acting at random.

use serde::{Deserialize, Serialize};

use super::ClusterFound;
use super::art::{Art, Outcome, Rule, Settings as Network};
use super::coding::Coding;
use super::history::{Histories, History};
use super::task::Task;
use crate::belief::Recall;
use crate::error::Result;
use crate::model::{ActionId, Then};
use crate::solve::learn::{Actor, Experience, any_action};

/// What exploration found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct WorldModel {
    pub vigilance: f64,
    /// The states of the automaton.
    pub states: Vec<History>,
    /// How they follow one another.
    pub recall: Recall,
    /// By cluster: how much of it was rewarded, in `[0, 1]`.
    pub rewarded: Vec<f64>,
    /// Steps of experience at which each cluster was founded.
    pub founded: Vec<u64>,
    /// Whether neither a new cluster nor a new state had been found for long.
    pub settled: bool,
    /// Whether a cluster or a state would have been made that was not allowed.
    pub capped: bool,
}

impl WorldModel {
    /// Whether it is one that a task can have.
    pub(super) fn fits(&self, task: &Task<'_>) -> bool {
        let (actions, depth) = (task.actions(), task.settings.depth);
        let clusters = self.recall.clusters().len();
        let state = |state: &History| state.fits(clusters, actions, depth);
        let states = self.states.len();
        self.recall.fits(task.extents().len(), actions, states)
            && self.states.iter().all(state)
            && self.rewarded.len() == clusters
            && self.founded.len() == clusters
    }

    /// How exploration ended, in a sentence.
    pub(super) fn describe(&self) -> String {
        let (vigilance, clusters) = (self.vigilance, self.recall.clusters().len());
        let states = self.states.len();
        if self.capped {
            format!(
                "vigilance {vigilance}: the limit of {states} states is reached, with {clusters} clusters, and beliefs call for more; the \
                 policy is learned on these; lower the vigilance or `depth`, or raise `state_limit`"
            )
        } else {
            format!("vigilance {vigilance}: {clusters} clusters, {states} states")
        }
    }

    /// The clusters, as a result tells of them.
    pub(super) fn clusters(&self) -> Vec<ClusterFound> {
        let centres = self.recall.clusters().centres().iter();
        centres
            .zip(self.rewarded.iter().zip(&self.founded))
            .map(|(centre, (&rewarded, &founded))| ClusterFound {
                centre: centre.clone(),
                rewarded,
                founded,
            })
            .collect()
    }
}

/// Acts at random until neither clusters nor states are new, or there are too many.
pub(super) fn generate(
    task: &Task<'_>,
    vigilance: f64,
    experience: &mut Experience,
) -> Result<WorldModel> {
    let settings = &task.settings;
    explore(task, experience, settings.scout, |_, _| Ok(true))?;
    let coding = Coding::new(task.extents());
    let mut network = Segmentation::new(task, &coding, vigilance)?;
    explore(
        task,
        experience,
        settings.explore_limit,
        |seen, experience| network.take(&seen, experience),
    )?;
    let clusters = coding.clusters(network.art.centres());
    let mut memory = Memory::new(task, clusters.len());
    if !network.patience.capped {
        explore(task, experience, settings.explore_limit, |seen, _| {
            Ok(memory.take(clusters.nearest(seen.place), seen.action))
        })?;
    }
    let (states, recall) = memory.histories.into_automaton(clusters, task.actions());
    Ok(WorldModel {
        vigilance,
        states,
        recall,
        rewarded: coding.rewarded(network.art.centres()),
        founded: network.founded,
        settled: network.patience.settled() && memory.patience.settled(),
        capped: network.patience.capped || memory.patience.capped,
    })
}

/// A belief that was come to.
struct Seen<'a> {
    /// Where it is among clusters.
    place: &'a [f64],
    /// What led to it; `None` where an episode starts.
    action: Option<ActionId>,
    reward: f64,
}

/// Acts at random for so many steps or until `take`, which is shown every belief, has seen enough.
fn explore(
    task: &Task<'_>,
    experience: &mut Experience,
    steps: usize,
    mut take: impl FnMut(Seen<'_>, &Experience) -> Result<bool>,
) -> Result<()> {
    let end = experience.samples + steps as u64;
    let mut actor = Actor::new(task.worlds, &task.updater, task.updater.readings());
    let mut more = true;
    while more && experience.samples < end {
        let (mut draws, mut exploration) = experience.next_episode(task.settings.seed);
        actor.reset(&mut draws);
        let mut seen = (None, 0.0);
        for _ in 0..task.body().episode.length {
            let (action, reward) = seen;
            let place = task.updater.place(actor.belief());
            more = take(
                Seen {
                    place: &place,
                    action,
                    reward,
                },
                experience,
            )?;
            if !more {
                break;
            }
            let action = any_action(task.actions(), &mut exploration);
            let step = actor.step(action, &mut draws);
            experience.collect(step.reward);
            seen = match step.then {
                Then::Continue => (Some(action), step.reward),
                Then::Restart => (None, 0.0),
                Then::End => break,
            };
        }
    }
    Ok(())
}

/// Whether anything new has been found of late.
struct Patience {
    /// Steps without anything new that are enough.
    enough: usize,
    /// Steps since there was anything new.
    since: usize,
    /// Whether there was something new that was not allowed.
    capped: bool,
}

impl Patience {
    fn new(enough: usize) -> Self {
        Self {
            enough,
            since: 0,
            capped: false,
        }
    }

    fn settled(&self) -> bool {
        self.since >= self.enough
    }

    /// Notes whether something was new, or was not allowed; says whether to go on.
    fn note(&mut self, outcome: Outcome) -> bool {
        match outcome {
            Outcome::Resonated => self.since += 1,
            Outcome::Committed => self.since = 0,
            Outcome::Full => self.capped = true,
        }
        !self.capped && !self.settled()
    }
}

/// ART2BeliefSimplexUpdate.
struct Segmentation<'a> {
    art: Art,
    coding: &'a Coding,
    notable: f64,
    founded: Vec<u64>,
    patience: Patience,
}

impl<'a> Segmentation<'a> {
    fn new(task: &Task<'_>, coding: &'a Coding, vigilance: f64) -> Result<Self> {
        let settings = &task.settings;
        let network = Network {
            vigilance,
            rate: settings.rate,
            rule: Rule::Distance { extent: 1.0 },
            limit: settings.state_limit,
        };
        Ok(Self {
            art: Art::new(coding.length(), network)?,
            coding,
            notable: settings.notable,
            founded: Vec::new(),
            patience: Patience::new(settings.settle),
        })
    }

    fn take(&mut self, seen: &Seen<'_>, experience: &Experience) -> Result<bool> {
        let event = experience.is_notable(seen.reward, self.notable);
        let shown = self.art.present(&self.coding.input(seen.place, event))?;
        if shown.outcome == Outcome::Committed {
            self.founded.push(experience.samples);
        }
        Ok(self.patience.note(shown.outcome))
    }
}

/// The previous cluster as memory.
struct Memory {
    histories: Histories,
    now: History,
    patience: Patience,
}

impl Memory {
    fn new(task: &Task<'_>, clusters: usize) -> Self {
        let settings = &task.settings;
        Self {
            histories: Histories::new(clusters, settings.depth, settings.state_limit),
            now: History::start(0),
            patience: Patience::new(settings.settle),
        }
    }

    fn take(&mut self, cluster: usize, action: Option<ActionId>) -> bool {
        self.now = match action {
            None => History::start(cluster),
            Some(action) => self.histories.after(&self.now, action, cluster),
        };
        self.patience.note(self.histories.meet(&self.now))
    }
}
