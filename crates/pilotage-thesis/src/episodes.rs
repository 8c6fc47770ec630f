//! The episodes that open the report.

use pilotage::belief::BeliefMdp;
use pilotage::policy::{Automaton, Matching};
use pilotage::progress::Progress;
use pilotage::scenario;
use pilotage::solve::{Request, ValueIteration, plan};
use pilotage_report::{Recording, Take, record};

use crate::error::Result;

/// Three problems that show what a policy does, each solved by closed-loop KBVI: a corridor, a cart with a load that no sensor
/// shows, and a robot that wakes up lost. Which episode is shown is not chosen: it is the first of the seed.
///
/// # Errors
/// None that a user could cause: those of solving the built-in models.
pub fn episodes(seed: u64, observer: &dyn Progress) -> Result<Vec<Recording>> {
    let shown = [
        (
            "corridor-blind",
            12,
            "A corridor",
            "The robot is paid in the last cell. Each move and each reading is noisy; the curve is what the robot makes of them. It knows nothing of the walls, so its belief may run past the end.",
        ),
        (
            "load-unload",
            20,
            "A load that no sensor shows",
            "The cart is paid for loading at the left end and for unloading at the right end. It senses where it is, never whether it is loaded: that it remembers, as part of its belief.",
        ),
        (
            "u-maze",
            20,
            "Waking up lost",
            "The robot was carried to one of three places and does not know which. It follows all three, drops those that do not fit what it senses, and acts on the one drawn with a solid line.",
        ),
    ];
    let recordings = shown.map(|(name, most_steps, title, about)| {
        let scenario = scenario::find(name)?;
        let solution = plan(
            &ValueIteration::default(),
            &scenario.model,
            &Request::default(),
            observer,
        )?;
        let mdp = BeliefMdp::new(&scenario.model);
        let empty = Automaton::new(&mdp, "", Matching::Nearest);
        let automaton = solution.automaton().unwrap_or(&empty);
        let take = Take {
            seed,
            episode: 0,
            most_steps,
        };
        Ok(Recording {
            title: title.to_owned(),
            about: about.to_owned(),
            ..record(&mdp, &scenario.truth, automaton, take)?
        })
    });
    recordings.into_iter().collect()
}
