//! The learners' settings, as `pilotage solve --help` lists them.

use comfy_table::presets;
use comfy_table::{ContentArrangement, Table};
use pilotage::solve::{SettingInfo, arkaq, kafaq};

/// Columns of the page, as of the rest of the help.
const WIDTH: u16 = 100;

/// Every learner's settings: name, default, meaning and range.
pub fn learner_settings() -> String {
    let learners = [
        ("kafaq", kafaq::Settings::described()),
        ("arkaq", arkaq::Settings::described()),
    ];
    let lists = learners.map(|(learner, settings)| {
        format!(
            "Settings of {learner}, for --learn NAME=VALUE:\n{}",
            table(settings)
        )
    });
    lists.join("\n\n")
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
