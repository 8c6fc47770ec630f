//! Progress bars on a terminal, nothing in a pipe.

use std::io::IsTerminal;
use std::sync::Mutex;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use pilotage::observe::Observer;

use crate::failure::say;

/// Shows the stages of the work on standard error.
pub struct Bars {
    current: Mutex<Option<(&'static str, ProgressBar)>>,
    quiet: bool,
}

impl Bars {
    /// Bars for a command; `quiet` shows nothing.
    pub fn new(quiet: bool) -> Self {
        Self {
            current: Mutex::new(None),
            quiet: quiet || !std::io::stderr().is_terminal(),
        }
    }
}

impl Bars {
    /// Says which part of a long run is being made, and how many seconds are left where that can be told.
    pub fn chapter(&self, name: &str, (done, of): (usize, usize), left: Option<f64>) {
        let left = left.map_or(String::new(), |seconds| {
            format!(", about {:.0} s left", seconds.ceil())
        });
        self.note(&format!("{:>3} of {of}: {name}{left}", done + 1));
    }
}

impl Observer for Bars {
    fn progress(&self, stage: &'static str, done: u64, total: u64) {
        if self.quiet {
            return;
        }
        let Ok(mut current) = self.current.lock() else {
            return;
        };
        let same = current.as_ref().is_some_and(|(known, _)| *known == stage);
        if !same {
            if let Some((_, old)) = current.take() {
                old.finish_and_clear();
            }
            *current = Some((stage, bar(stage, total)));
        }
        if let Some((_, bar)) = current.as_ref() {
            bar.set_position(done);
            if total > 0 && done >= total {
                bar.finish_and_clear();
            }
        }
    }

    fn status(&self, message: &str) {
        if let Ok(current) = self.current.lock()
            && let Some((_, bar)) = current.as_ref()
        {
            bar.set_prefix(message.to_owned());
        }
    }

    fn note(&self, message: &str) {
        if self.quiet {
            return;
        }
        match self
            .current
            .lock()
            .ok()
            .as_ref()
            .and_then(|current| current.as_ref())
        {
            Some((_, bar)) => bar.println(message),
            None => say(message),
        }
    }
}

fn bar(stage: &'static str, total: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
    let template = "{msg:>10} [{bar:30}] {human_pos}/{human_len}  {eta} left  {prefix}";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar.set_message(stage);
    bar
}
