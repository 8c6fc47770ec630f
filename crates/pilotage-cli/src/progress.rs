//! Progress on standard error: bars on a terminal, in a pipe a line now and then.

use std::fmt::Write as _;
use std::io::{IsTerminal, Write};
use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pilotage::progress::Progress;

use crate::failure::say;

/// Time between two lines in a pipe. Work that ends sooner says nothing there.
const EVERY: Duration = Duration::from_secs(10);

/// Time between two looks of a bar, so that it shows that work goes on.
const TICK: Duration = Duration::from_millis(200);

/// Shows the stages of the work on standard error.
pub struct Bars {
    shown: Shown,
    work: Arc<Mutex<Work>>,
}

#[derive(Clone, Copy, PartialEq)]
enum Shown {
    Nothing,
    Bars,
    Lines,
}

impl Bars {
    /// Bars for a command; `quiet` shows nothing.
    pub fn new(quiet: bool) -> Self {
        let shown = match (quiet, std::io::stderr().is_terminal()) {
            (true, _) => Shown::Nothing,
            (false, true) => Shown::Bars,
            (false, false) => Shown::Lines,
        };
        let work = Arc::new(Mutex::new(Work::new()));
        if shown == Shown::Lines {
            let work = Arc::downgrade(&work);
            std::thread::spawn(move || tell(&work, EVERY, std::io::stderr()));
        }
        Self { shown, work }
    }

    /// Says which part of a long run is being made, and how many seconds are left where that can be told.
    pub fn chapter(&self, name: &str, (done, of): (usize, usize), left: Option<f64>) {
        let left = left.map_or(String::new(), |seconds| {
            format!(", about {} left", spoken(seconds))
        });
        let chapter = format!("{:>3} of {of}: {name}{left}", done + 1);
        self.note(&chapter);
        if let Ok(mut work) = self.work.lock() {
            work.chapter = chapter.trim_start().to_owned();
            work.stage = None;
        }
    }
}

impl Progress for Bars {
    fn progress(&self, stage: &'static str, done: u64, total: u64) {
        if self.shown != Shown::Nothing
            && let Ok(mut work) = self.work.lock()
        {
            work.progress(stage, done, total);
            if self.shown == Shown::Bars {
                work.draw();
            }
        }
    }

    fn status(&self, message: &str) {
        if let Ok(mut work) = self.work.lock()
            && let Some(stage) = work.stage.as_mut()
        {
            message.clone_into(&mut stage.status);
        }
    }

    fn note(&self, message: &str) {
        if self.shown != Shown::Bars {
            return;
        }
        match self.work.lock().ok().as_ref().map(|work| &work.bar) {
            Some(Some(bar)) => bar.println(message),
            _ => say(message),
        }
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        if let Ok(mut work) = self.work.lock() {
            work.clear();
        }
    }
}

/// The work so far.
struct Work {
    began: Instant,
    /// The part of a long run, where it has parts.
    chapter: String,
    stage: Option<Stage>,
    /// What shows the stage on a terminal, while there is more of it to come.
    bar: Option<ProgressBar>,
}

/// A stage, and how far it has come.
struct Stage {
    name: &'static str,
    began: Instant,
    /// What was done already when it was first heard of: more than nothing where a run goes on from a checkpoint.
    first: u64,
    done: u64,
    /// All there is to do; 0 where that is not known.
    total: u64,
    /// How it stands, in a few words.
    status: String,
}

impl Work {
    fn new() -> Self {
        Self {
            began: Instant::now(),
            chapter: String::new(),
            stage: None,
            bar: None,
        }
    }

    /// Takes in a report. Those of several threads may come out of order; one of nothing done begins a stage anew.
    fn progress(&mut self, name: &'static str, done: u64, total: u64) {
        match self.stage.as_mut() {
            Some(stage) if stage.name == name && stage.total == total && done > 0 => {
                stage.done = stage.done.max(done);
            }
            _ => {
                self.clear();
                self.stage = Some(Stage {
                    name,
                    began: Instant::now(),
                    first: done,
                    done,
                    total,
                    status: String::new(),
                });
            }
        }
    }

    /// Brings the bar up to date, or takes it away where the stage is done.
    fn draw(&mut self) {
        match self.stage.as_ref().filter(|stage| !stage.is_done()) {
            None => self.clear(),
            Some(stage) => {
                let bar = self.bar.get_or_insert_with(|| bar(stage));
                let left = stage.left(stage.began.elapsed());
                let left = left.map_or_else(String::new, |left| format!(", {left}  "));
                bar.set_prefix(format!("{left}{}", stage.status));
                bar.set_position(stage.done);
            }
        }
    }

    fn clear(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    /// How the work stands, in one line.
    fn line(&self, now: Instant) -> String {
        let mut line = format!("{} so far", spoken(seconds(now - self.began).floor()));
        if !self.chapter.is_empty() {
            let _ = write!(line, "; {}", self.chapter);
        }
        if let Some(stage) = self.stage.as_ref().filter(|stage| !stage.is_done()) {
            let _ = write!(line, "; {} {}", stage.name, stage.done);
            if stage.total > 0 {
                let _ = write!(line, " of {}", stage.total);
            }
            let left = stage.left(now - stage.began);
            for words in [left.as_deref(), Some(stage.status.as_str())] {
                if let Some(words) = words.filter(|words| !words.is_empty()) {
                    let _ = write!(line, ", {words}");
                }
            }
        }
        line
    }
}

impl Stage {
    fn is_done(&self) -> bool {
        self.total > 0 && self.done >= self.total
    }

    /// What is left at the pace so far, once some of it has been done.
    fn left(&self, elapsed: Duration) -> Option<String> {
        let made = self.done.saturating_sub(self.first);
        let rest = self.total.saturating_sub(self.done);
        (made > 0 && rest > 0).then(|| {
            let left = seconds(elapsed) / made as f64 * rest as f64;
            format!("about {} left", spoken(left))
        })
    }
}

fn seconds(duration: Duration) -> f64 {
    duration.as_secs_f64()
}

/// A time in the unit in which people say it, rounded up.
fn spoken(seconds: f64) -> String {
    let minutes = seconds / 60.0;
    if minutes < 2.0 {
        format!("{:.0} s", seconds.ceil().max(1.0))
    } else if minutes < 120.0 {
        format!("{:.0} min", minutes.ceil())
    } else {
        format!("{:.0} h", (minutes / 60.0).ceil())
    }
}

fn bar(stage: &Stage) -> ProgressBar {
    let (length, template) = if stage.total > 0 {
        let template = "{msg:>10} [{bar:30}] {human_pos}/{human_len}  {elapsed}{prefix}";
        (Some(stage.total), template)
    } else {
        (None, "{msg:>10} {spinner} {human_pos}  {elapsed}{prefix}")
    };
    let bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr());
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar.set_message(stage.name);
    bar.enable_steady_tick(TICK);
    bar
}

/// Writes how the work stands again and again, until it is over.
fn tell(work: &Weak<Mutex<Work>>, every: Duration, mut to: impl Write) {
    loop {
        std::thread::sleep(every);
        let Some(work) = work.upgrade() else {
            return;
        };
        let Ok(line) = work.lock().map(|work| work.line(Instant::now())) else {
            return;
        };
        // Progress that nobody can read is no reason to stop.
        let _ = writeln!(to, "{line}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(stage: Stage, seconds: u64) -> (Stage, Duration) {
        (stage, Duration::from_secs(seconds))
    }

    fn stage(first: u64, done: u64, total: u64) -> Stage {
        Stage {
            name: "levels",
            began: Instant::now(),
            first,
            done,
            total,
            status: String::new(),
        }
    }

    #[test]
    fn what_is_left_is_told_once_something_is_done_and_is_never_nothing() {
        for ((stage, elapsed), left) in [
            (after(stage(0, 0, 40), 5), None),
            (after(stage(0, 10, 40), 5), Some("about 15 s left")),
            (after(stage(0, 39, 40), 1), Some("about 1 s left")),
            (after(stage(0, 40, 40), 60), None),
            (after(stage(0, 7, 0), 60), None),
            // Gone on from a checkpoint: 30 were done before this run.
            (after(stage(30, 30, 40), 0), None),
            (after(stage(30, 32, 40), 100), Some("about 7 min left")),
            (
                after(stage(0, 1, 1_000_000), 60),
                Some("about 16667 h left"),
            ),
        ] {
            assert_eq!(stage.left(elapsed).as_deref(), left);
        }
    }

    #[test]
    fn reports_of_several_threads_come_in_any_order_and_a_stage_can_begin_anew() {
        let mut work = Work::new();
        for (done, shown) in [
            (0, 0),
            (128, 128),
            (64, 128),
            (256, 256),
            (192, 256),
            (0, 0),
        ] {
            work.progress("episodes", done, 256);
            assert_eq!(work.stage.as_ref().unwrap().done, shown, "{done}");
        }
        work.progress("levels", 3, 9);
        assert_eq!(work.stage.as_ref().unwrap().first, 3);
    }

    #[test]
    fn a_line_tells_how_the_work_stands() {
        let mut work = Work::new();
        let now = work.began + Duration::from_secs(20);
        assert_eq!(work.line(now), "20 s so far");
        work.progress("sweeps", 7, 0);
        assert_eq!(work.line(now), "20 s so far; sweeps 7");
        work.progress("levels", 0, 40);
        assert_eq!(work.line(now), "20 s so far; levels 0 of 40");
        work.chapter = "3 of 9: table-4.1".to_owned();
        work.progress("levels", 10, 40);
        work.stage.as_mut().unwrap().began = work.began;
        work.stage.as_mut().unwrap().status = "5 nodes".to_owned();
        assert_eq!(
            work.line(now),
            "20 s so far; 3 of 9: table-4.1; levels 10 of 40, about 60 s left, 5 nodes"
        );
        work.progress("levels", 40, 40);
        assert_eq!(work.line(now), "20 s so far; 3 of 9: table-4.1");
    }

    #[test]
    fn lines_come_again_and_again_until_the_work_is_over() {
        let (reader, writer) = std::io::pipe().unwrap();
        let work = Arc::new(Mutex::new(Work::new()));
        work.lock().unwrap().progress("levels", 0, 40);
        let weak = Arc::downgrade(&work);
        let teller = std::thread::spawn(move || tell(&weak, Duration::from_millis(5), writer));
        let mut lines = std::io::BufRead::lines(std::io::BufReader::new(reader));
        for _ in 0..3 {
            assert!(lines.next().unwrap().unwrap().ends_with("levels 0 of 40"));
        }
        drop(work);
        teller.join().unwrap();
    }
}
