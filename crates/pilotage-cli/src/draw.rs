//! `pilotage draw`

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use pilotage::policy::{Saved, write_whole};
use pilotage_report::{automaton_svg, belief_map_svg, graph_svg};

use crate::failure::Failure;
use crate::options::{beside, policy_and_problem, shown};

#[derive(Args)]
pub struct Arguments {
    /// A policy file written by `pilotage solve --out`.
    policy: PathBuf,
    /// Model file of the problem, where it is not a built-in one.
    #[arg(long)]
    problem: Option<PathBuf>,
    /// Folder to write to; beside the policy file otherwise.
    #[arg(long)]
    out: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let (policy, scenario) = policy_and_problem(&arguments.policy, arguments.problem.as_deref())?;
    let pictures = match &policy {
        Saved::Graph(graph) => vec![("graph.svg", graph_svg(graph)?)],
        Saved::Automaton(automaton) => {
            let space = automaton.space(&scenario.model);
            if let Some(mdp) = space.as_mdp() {
                mdp.check()?;
            }
            vec![
                ("automaton.svg", automaton_svg(automaton)?),
                (
                    "map.svg",
                    belief_map_svg(space.as_ref(), automaton, Some(automaton))?,
                ),
            ]
        }
    };
    let mut out = std::io::stdout().lock();
    for (suffix, picture) in pictures {
        let beside = beside(&arguments.policy, suffix);
        let path = match (&arguments.out, beside.file_name()) {
            (Some(folder), Some(name)) => folder.join(name),
            _ => beside,
        };
        write_whole(&path, picture.as_bytes())?;
        writeln!(out, "{}", shown(&path))?;
    }
    Ok(())
}
