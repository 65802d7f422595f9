//! A progress bar where someone is watching, nothing in a pipe.

use super::interrupt;
use crate::study::run::Watch;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;

const TICKS: u64 = 1000;

/// What a run calls with the share that is done. The bar goes when the run does.
pub fn watch() -> Watch {
    let seen = std::io::stderr().is_terminal();
    let target = if seen { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = Gone(ProgressBar::with_draw_target(Some(TICKS), target));
    if let Ok(style) = ProgressStyle::with_template("{wide_bar} {percent:>3} %  {eta} left") {
        bar.0.set_style(style);
    }
    Box::new(move |share| {
        bar.0.set_position((share * TICKS as f64) as u64);
        !interrupt::asked()
    })
}

struct Gone(ProgressBar);

impl Drop for Gone {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
