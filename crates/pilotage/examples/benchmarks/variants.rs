//! docs/variants.md: built-in problems with other noises, rewards and places, so that nothing is tuned to one.

use std::error::Error;
use std::fs::{create_dir_all, write};

use pilotage::scenario;
use serde::Deserialize;

use crate::Page;
use crate::published::EPISODES;
use crate::row::{Row, SEED, Task, estimate, or_none};

/// What differs from which problem.
const DATA: &str = include_str!("../../../../docs/data/variants.toml");

const DIGITS: usize = 3;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Data {
    variant: Vec<Variant>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Variant {
    of: String,
    name: String,
    /// In words.
    differs: String,
    /// Most nodes.
    nodes: usize,
    /// Text of the model file, and what is put in its place.
    change: Vec<(String, String)>,
}

/// Variants of the problems that are asked for; their model files are kept in a folder.
pub fn page(folder: &str, asked: &dyn Fn(&str) -> bool) -> Page {
    create_dir_all(folder)?;
    let data: Data = toml::from_str(DATA)?;
    let mut page = heading(folder);
    let mut remarks = String::new();
    for variant in data.variant.iter().filter(|variant| asked(&variant.of)) {
        let row = measured(variant, folder)?;
        page += &line(variant, &row);
        if let Some(remark) = row.of_promise() {
            remarks += &format!("- `{}`, {}: {remark}.\n", variant.of, variant.name);
        }
    }
    if !remarks.is_empty() {
        page +=
            &format!("\n## What the output says of promises that miss what is earned\n\n{remarks}");
    }
    Ok(page)
}

fn heading(folder: &str) -> String {
    format!(
        "# Variants\n\n\
         Built-in problems with other noises, rewards and places, which nothing was tried on before it was measured: what is changed is in [data/variants.toml](data/variants.toml). *Planned* is what the first planner promises, *earned* the discounted return of its tree where the model holds, mean ± \
         standard error over {EPISODES} episodes; the rule of thumb of the model file, changed like the rest of it, acts on the same belief in the same episodes. Version {}, seed {SEED}; made by\n\n\
         ```sh\ncargo run --release -p pilotage --example benchmarks -- --variants {folder} --out docs/variants.md\n```\n\n\
         | of | variant | what differs | nodes at most | nodes | planned | earned | the rule | more than the rule |\n\
         |---|---|---|--:|--:|--:|--:|--:|--:|\n",
        env!("CARGO_PKG_VERSION")
    )
}

fn measured(variant: &Variant, folder: &str) -> Result<Row, Box<dyn Error>> {
    let problem = format!("{folder}/{}-{}.toml", variant.of, variant.name);
    write(&problem, text(variant)?)?;
    let task = Task {
        problem,
        tree: true,
        most: Some(variant.nodes),
        episodes: EPISODES,
        ..Task::default()
    };
    Ok(task.measure_apart()?)
}

fn line(variant: &Variant, row: &Row) -> String {
    format!(
        "| `{}` | {} | {} | {} | {} | {} | {} | {} | {} |\n",
        variant.of,
        variant.name,
        variant.differs,
        variant.nodes,
        or_none(row.nodes, |nodes| nodes.to_string()),
        or_none(row.planned, |planned| format!("{planned:.DIGITS$}")),
        estimate(row.earned, DIGITS),
        or_none(row.rule, |rule| estimate(rule.0, DIGITS)),
        or_none(row.rule, |rule| estimate(rule.1, DIGITS)),
    )
}

/// Its model file.
fn text(variant: &Variant) -> Result<String, Box<dyn Error>> {
    let Variant { of, name, .. } = variant;
    let text = scenario::builtin(of);
    let mut text = text
        .ok_or_else(|| format!("{of}-{name}: there is no built-in problem {of}"))?
        .to_owned();
    let named = (
        format!("name = \"{of}\""),
        format!("name = \"{of}-{name}\""),
    );
    for (from, to) in [&named].into_iter().chain(&variant.change) {
        if !text.contains(from.as_str()) {
            return Err(format!("{of}-{name}: {from} is not in the model file").into());
        }
        text = text.replace(from.as_str(), to);
    }
    Ok(text)
}
