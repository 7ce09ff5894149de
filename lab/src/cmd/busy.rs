//! What is told on stderr while a search goes on: on a terminal a line that moves, elsewhere a line for each effect that was found.

use std::cell::RefCell;
use std::io::{IsTerminal as _, stderr};
use std::time::Duration;

use energy::Channel;
use indicatif::{ProgressBar, ProgressStyle};
use lab::infer::progress::{Progress, Rung};
use lab::report::quantity::{quantity, unit_of};

/// Nobody who waits for less wonders whether anything happens.
const SOON_S: f64 = 3.0;
/// Effects that are named in one line of a terminal; what was found before them is counted.
const NAMED: usize = 3;

/// Shows on a terminal, and nowhere else, that work goes on and for how long already.
pub(super) fn busy(words: String) -> ProgressBar {
    if !stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {msg} {elapsed}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_message(words);
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// Does `work`, which says how far it is, and tells who waits.
pub(super) fn while_telling<T>(words: String, work: impl FnOnce(&dyn Fn(Progress)) -> T) -> T {
    let is_terminal = stderr().is_terminal();
    let bar = busy(words.clone());
    let ladder = RefCell::new(Ladder { words, ..Ladder::default() });
    let say = |ladder: &mut Ladder| {
        if !is_terminal && bar.elapsed().as_secs_f64() > SOON_S {
            ladder.unsaid().iter().for_each(|line| eprintln!("lab: {line}"));
        }
    };
    let done = work(&|progress| {
        let mut ladder = ladder.borrow_mut();
        let message = ladder.moved(&progress);
        bar.set_message(message);
        say(&mut ladder);
    });
    say(&mut ladder.borrow_mut());
    bar.finish_and_clear();
    done
}

/// What was found so far, and what of it was said.
#[derive(Debug, Default)]
struct Ladder {
    /// What is looked for.
    words: String,
    given: Vec<(Channel, f64)>,
    found: Vec<Rung>,
    said: Vec<&'static str>,
    /// Whether all that was said holds no longer, since the search has begun anew.
    is_anew: bool,
}

impl Ladder {
    /// Where the search stands now, in one line.
    fn moved(&mut self, progress: &Progress) -> String {
        let now = match progress {
            Progress::Stands { found, given } => {
                self.is_anew |= found.is_empty() && !self.found.is_empty();
                (self.found, self.given) = (found.clone(), given.clone());
                String::new()
            }
            Progress::Asking => "; asking every absent effect".to_owned(),
            Progress::Trying { effect, number, of } => format!("; trying {effect}, {number} of {of}"),
            Progress::Refitting { effect } => format!("; refitting with {effect}"),
            Progress::Reviewing => "; going through what was found".to_owned(),
        };
        format!("{}{now}", self.stands())
    }

    fn stands(&self) -> String {
        if self.found.is_empty() {
            let left = if self.given.is_empty() { String::new() } else { format!(": {}", left(&self.given)) };
            return format!("{}{left}", self.words);
        }
        let more = self.found.len().saturating_sub(NAMED);
        let more = (more > 0).then(|| format!("{more} more"));
        let named = self.found.iter().skip(self.found.len().saturating_sub(NAMED));
        let named = named.map(|rung| format!("+ {} {}", rung.effect, left(&rung.left)));
        more.into_iter().chain(named).collect::<Vec<_>>().join(" ")
    }

    /// Lines about what was found and not yet said.
    fn unsaid(&mut self) -> Vec<String> {
        let mut lines = Vec::new();
        if std::mem::take(&mut self.is_anew) && !self.said.is_empty() {
            self.said.clear();
            lines.push("once more from the beginning, with what the noise of inputs does by what was found".to_owned());
        }
        let stays = |effect: &&'static str| self.found.iter().any(|rung| rung.effect == *effect);
        let (stay, gone): (Vec<_>, Vec<_>) = self.said.iter().copied().partition(stays);
        lines.extend(gone.iter().map(|effect| format!("- {effect}, whose work is done without it")));
        self.said = stay;
        for rung in &self.found {
            if !self.said.contains(&rung.effect) {
                self.said.push(rung.effect);
                lines.push(format!("+ {}: {} left", rung.effect, left(&rung.left)));
            }
        }
        lines
    }
}

/// An error by channel, which is named where there are several.
fn left(rms: &[(Channel, f64)]) -> String {
    let of = |&(channel, rms): &(Channel, f64)| {
        let size = quantity(rms, unit_of(channel.name()));
        if rms.is_finite() { size } else { "no number".to_owned() }
    };
    match rms {
        [one] => of(one),
        several => several.iter().map(|one| format!("{} {}", of(one), one.0.name())).collect::<Vec<_>>().join(" and "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stands(found: &[(&'static str, f64)]) -> Progress {
        let rung = |&(effect, rms): &(&'static str, f64)| Rung { effect, left: vec![(Channel::VoltageV, rms)] };
        Progress::Stands { found: found.iter().map(rung).collect(), given: vec![(Channel::VoltageV, 0.0257)] }
    }

    #[test]
    fn the_line_of_a_terminal_names_what_was_found_and_what_is_tried() {
        let mut ladder = Ladder { words: "looking for what cell lacks".to_owned(), ..Ladder::default() };
        assert_eq!(ladder.moved(&stands(&[])), "looking for what cell lacks: 25.7 mV");
        let trying = Progress::Trying { effect: "rc1", number: 14, of: 22 };
        assert_eq!(ladder.moved(&trying), "looking for what cell lacks: 25.7 mV; trying rc1, 14 of 22");
        ladder.moved(&stands(&[("ohmic_soc", 0.0157)]));
        assert_eq!(ladder.moved(&trying), "+ ohmic_soc 15.7 mV; trying rc1, 14 of 22");
        assert_eq!(ladder.moved(&Progress::Refitting { effect: "rc1" }), "+ ohmic_soc 15.7 mV; refitting with rc1");
        let four = stands(&[("a", 4e-3), ("b", 3e-3), ("c", 2e-3), ("d", 1e-3)]);
        assert_eq!(ladder.moved(&four), "1 more + b 3.00 mV + c 2.00 mV + d 1.00 mV");
    }

    #[test]
    fn each_effect_is_said_once_and_what_gave_way_too() {
        let mut ladder = Ladder::default();
        ladder.moved(&stands(&[]));
        assert_eq!(ladder.unsaid(), Vec::<String>::new());
        ladder.moved(&stands(&[("rc1", 0.0157)]));
        assert_eq!(ladder.unsaid(), ["+ rc1: 15.7 mV left"]);
        assert_eq!(ladder.unsaid(), Vec::<String>::new());
        ladder.moved(&stands(&[("ohmic_soc", 0.012), ("rc2", 2e-3)]));
        assert_eq!(ladder.unsaid(), ["- rc1, whose work is done without it", "+ ohmic_soc: 12.0 mV left", "+ rc2: 2.00 mV left"]);
        ladder.moved(&stands(&[]));
        ladder.moved(&stands(&[("rc2", 2e-3)]));
        let anew = ladder.unsaid();
        assert!(anew.len() == 2 && anew[0].starts_with("once more from the beginning") && anew[1] == "+ rc2: 2.00 mV left", "{anew:?}");
    }
}
