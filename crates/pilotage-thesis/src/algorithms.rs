//! The algorithms for a reader who has to choose one; how far each is from the best is read off the findings.

use pilotage_report::{Algorithm, Finding};

/// What is needed of each algorithm; `gap` names finding, table, row and column of the number that tells how far from the best it is.
struct About {
    name: &'static str,
    needs: &'static str,
    gives: &'static str,
    choose: &'static str,
    gap: (&'static str, usize, usize, usize),
    /// What that number is.
    of: &'static str,
}

const ABOUT: [About; 4] = [
    About {
        name: "KBVI, closed loop",
        needs: "motion, sensor, noise, map and rewards",
        gives: "the value of every belief, and an automaton that earns it",
        choose: "there is a model: the default",
        gap: ("declare", 0, 0, 2),
        of: "earned on corridor-declare, where the best is 2.6876",
    },
    About {
        name: "KBVI, open loop",
        needs: "the same",
        gives: "an automaton of segments or of nearest neighbours, as in the thesis",
        choose: "the thesis is to be compared with",
        gap: ("declare", 0, 1, 2),
        of: "earned on corridor-declare, where the best is 2.6876: it cannot see that looking pays",
    },
    About {
        name: "KAFAQ",
        needs: "motion, sensor and noise of its own body, the outer bounds, and a world to try things in",
        gives: "an automaton of a handful of regions, with memory where the past matters",
        choose: "map and rewards are not known",
        gap: ("figure-4.10", 0, 0, 4),
        of: "% of what one who is told earns in the 4x4 maze",
    },
    About {
        name: "ARKAQ",
        needs: "the same, and a vigilance",
        gives: "an automaton with a node for each cluster and way into it, or a handful of nodes where they are merged",
        choose: "clusters are wanted without any test, or the hidden thing is told by the last few steps",
        gap: ("figure-3.11", 0, 0, 4),
        of: "% of what one who is told earns with the hidden load",
    },
];

/// The algorithms, with numbers from the findings there are.
pub fn algorithms(findings: &[Finding]) -> Vec<Algorithm> {
    let cell = |(id, table, row, column): (&str, usize, usize, usize)| -> Option<&String> {
        let finding = findings.iter().find(|finding| finding.id == id)?;
        finding.tables.get(table)?.rows.get(row)?.get(column)
    };
    ABOUT
        .iter()
        .map(|about| Algorithm {
            name: about.name.to_owned(),
            needs: about.needs.to_owned(),
            gives: about.gives.to_owned(),
            choose: about.choose.to_owned(),
            gap: cell(about.gap).map_or_else(
                || format!("not in this report (see {})", about.gap.0),
                |number| format!("{number} {}", about.of),
            ),
        })
        .collect()
}
