//! The episodes that open the report. That a recording is sound, and the run of a simulation, is tested where recordings are made.

use pilotage::progress::Silent;
use pilotage_thesis::episodes;

#[test]
fn three_episodes_open_the_report() {
    let recordings = episodes(1, &Silent).expect("built-in models");
    let ids: Vec<&str> = recordings.iter().map(|each| &*each.id).collect();
    assert_eq!(ids, ["corridor-blind", "load-unload", "u-maze"]);
    for recording in &recordings {
        assert!(!recording.places.is_empty() && !recording.walls.is_empty());
    }
    assert_eq!(recordings[2].frames[0].hypotheses.len(), 3);
}
