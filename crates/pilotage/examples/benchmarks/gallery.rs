//! docs/gallery.md: problems that people have.

use pilotage::scenario;

use crate::Page;
use crate::row::{HEAD, SEED, Task};

const EPISODES: usize = 10_000;

/// Most nodes of the automata that are drawn, and of those that are written out.
const NODES: usize = 30;
const WRITTEN_OUT: usize = 12;

const DIGITS: usize = 3;

pub fn page(folder: &str, asked: &dyn Fn(&str) -> bool) -> Page {
    std::fs::create_dir_all(folder)?;
    let mut page = heading();
    for name in scenario::gallery_names().filter(|name| asked(name)) {
        page += &exhibit(name, folder)?;
    }
    Ok(page)
}

fn heading() -> String {
    format!(
        "# Gallery\n\n\
         Problems that people have, each a model file in [models/gallery](../models/gallery) with a rule of thumb that an engineer would write. Each is solved as \
         `pilotage solve NAME --loss 0` does, no return being lost by fewer nodes, and with `--nodes {NODES}` for an automaton to look at. *Earned* is the discounted return of the automaton where the model holds, mean ± standard error over {EPISODES} \
         episodes; the rule acts on the same belief in the same episodes, which is why *more than the rule* is known better than either. Where what was planned misses what is earned, the remark says why. Maps show what the \
         automaton does: the mean of the belief across and up, how sure it is in the panels. Version {}, seed {SEED}; made by\n\n\
         ```sh\nscripts/gallery.sh\n```\n",
        env!("CARGO_PKG_VERSION")
    )
}

/// Measures a problem, and keeps its small automaton in a folder.
fn exhibit(name: &str, folder: &str) -> Page {
    let model = scenario::find(name)?.model;
    let task = Task {
        problem: name.to_owned(),
        tree: true,
        episodes: EPISODES,
        ..Task::default()
    };
    let small = Task {
        most: Some(NODES),
        keep: Some(format!("{folder}/{name}.json")),
        ..task.clone()
    };
    let (small, large) = (small.measure_apart()?, task.measure_apart()?);
    let mut text = format!(
        "\n## `{name}`\n\n{}\n\n![What the automaton of {name} does](gallery/{name}-map.svg)\n\n{HEAD}{}{}",
        model.about,
        small.line(DIGITS),
        large.line(DIGITS)
    );
    for remark in &large.remarks {
        text += &format!("\nRemark: {remark}.\n");
    }
    if small.nodes.is_some_and(|nodes| nodes <= WRITTEN_OUT) {
        text += &format!("\n```text\n{}\n```\n", small.conditions.trim_end());
    }
    Ok(text)
}
