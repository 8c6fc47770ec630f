//! The settings of every solver, as `pilotage solve --help` lists them.

use comfy_table::presets;
use comfy_table::{ContentArrangement, Table};
use pilotage::solve::{Registry, SettingInfo};

/// Columns of the page, as of the rest of the help.
const WIDTH: u16 = 100;

/// Every solver's settings: name, default, meaning and range.
pub fn settings_of_solvers() -> String {
    let registry = Registry::builtin();
    let lists = registry.entries().iter().map(|entry| {
        format!(
            "Settings of {}, for --set NAME=VALUE:\n{}",
            entry.name(),
            table(entry.settings())
        )
    });
    lists.collect::<Vec<_>>().join("\n\n")
}

fn table(settings: Vec<SettingInfo>) -> String {
    let mut table = Table::new();
    table
        .load_style(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Dynamic)
        .set_width(WIDTH);
    table.set_header(["name", "default", "what it is"]);
    for setting in settings {
        table.add_row([setting.name, setting.default, setting.about]);
    }
    table.trim_fmt()
}
