//! Wakes a lost robot up in the mazes of thesis 5.6, and puts Table 5.1 beside the policy found here.
//!
//! `cargo run --release --example wake_up -- [episodes]`
#![allow(clippy::print_stdout)]

use pilotage::belief::{Belief, BeliefMdp, Merge, Tracking};
use pilotage::model;
use pilotage::observe::Silent;
use pilotage::policy::Policy;
use pilotage::simulate::wake_up::{Choice, Settings, measure};
use pilotage::solve::kbvi::closed::{self, GridPolicy};

/// Table 5.1: level, name, point and action.
const TABLE: [(usize, &str, [f64; 2], &str); 10] = [
    (0, "p31", [1.5, 1.5], "SOUTH"),
    (0, "p32", [2.5, 0.5], "EAST"),
    (0, "p33", [2.5, 1.5], "NORTH"),
    (1, "p21", [2.8, 0.5], "EAST"),
    (1, "p22", [4.1, 0.4], "EAST"),
    (1, "p23", [3.9, 2.9], "NORTH"),
    (2, "p11", [3.8, 0.5], "EAST"),
    (2, "p12", [3.9, 1.8], "NORTH"),
    (2, "p13", [4.3, 3.9], "NORTH"),
    (2, "p14", [4.3, 4.6], "EAST"),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let episodes = match std::env::args().nth(1) {
        Some(count) => count.parse()?,
        None => 10_000,
    };
    for name in ["n-maze", "u-maze"] {
        let mdp = BeliefMdp::new(&model::find(name)?);
        let policy = closed::solve(&mdp, &closed::Settings::default(), &Silent)?;
        println!(
            "{name}: {episodes} kidnappings, at most {} steps",
            mdp.model().episode.length
        );
        if name == "u-maze" {
            beside_table(&mdp, &policy);
        }
        wake_up(&mdp, &policy, episodes)?;
    }
    Ok(())
}

fn beside_table(mdp: &BeliefMdp, policy: &GridPolicy) {
    println!("  Table 5.1              thesis  ours   value");
    for (level, name, mean, action) in TABLE {
        let belief = Belief {
            level,
            mode: 0,
            mean: mean.to_vec(),
        };
        let ours = &mdp.model().actions[policy.action(&belief)].name;
        let variance = mdp.levels().covariance(level)[(0, 0)];
        let value = policy.value(&belief).unwrap_or(f64::NAN);
        println!(
            "  {variance:.4} {name} ({:.1}, {:.1})  {action:<6}  {ours:<6} {value:.3}",
            mean[0], mean[1]
        );
    }
}

fn wake_up(mdp: &BeliefMdp, policy: &GridPolicy, episodes: usize) -> pilotage::Result<()> {
    let close = Tracking {
        merge: Merge::Agree(1.0),
        ..Tracking::default()
    };
    let rules = [
        (
            "weighted, merged when they coincide",
            Choice::Weighted,
            Tracking::default(),
        ),
        (
            "weighted, merged when close and agreed",
            Choice::Weighted,
            close,
        ),
        (
            "valid, merged when they coincide",
            Choice::Valid,
            Tracking::default(),
        ),
        (
            "valid, merged when agreed (printed)",
            Choice::Valid,
            Tracking::PRINTED,
        ),
    ];
    for (rule, choice, tracking) in rules {
        let settings = Settings {
            choice,
            tracking,
            episodes,
            ..Settings::default()
        };
        let found = measure(mdp, policy, &settings, &Silent)?;
        println!("  {rule}");
        for (agent, reached) in [("lost", &found.lost), ("told", &found.told)] {
            let steps = reached.steps.map_or(f64::NAN, |steps| steps.mean);
            println!(
                "    {agent}: success {:.4} +- {:.4}, {steps:.2} steps to the goal, discounted {:.4} +- {:.4}",
                reached.success.mean,
                reached.success.stderr,
                reached.discounted.mean,
                reached.discounted.stderr
            );
        }
        println!(
            "    success of the lost / the told: {:.4} +- {:.4}",
            found.ratio.mean, found.ratio.stderr
        );
        let shares: Vec<String> = found
            .alone_after
            .iter()
            .enumerate()
            .skip(1)
            .take(10)
            .map(|(steps, &count)| {
                format!("{steps}: {:.1}%", 100.0 * count as f64 / episodes as f64)
            })
            .collect();
        println!("    one hypothesis left after {}", shares.join(", "));
        println!(
            "    never {:.1}%",
            100.0 * found.never_alone as f64 / episodes as f64
        );
    }
    Ok(())
}
