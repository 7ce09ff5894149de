//! Where a real station is that drives: asked of the program that works it, `place`, every [`ASK_S`] seconds.
//!
//! | it prints | meaning |
//! | --- | --- |
//! | `here` | it stands where it takes robots in, and stays |
//! | `here LEAVES` | it stands there, and sets off in so many seconds |
//! | `here LEAVES RETURNS` | the same, and takes robots in once more, there or elsewhere, in `RETURNS` seconds from now |
//! | `arrives SECONDS` | it is on its way, and will be there in so many seconds |
//!
//! After either may follow as many `LEAVES` and `RETURNS` as are known, all in seconds from now.
//! The last line that says so counts. Where there is none, or the program fails, what was said before holds, counted down.

use device::Program;
use tracing::warn;

use super::hands::{KEY, SLEPT_S};

/// Time between two questions, s: robots are on their way for minutes.
const ASK_S: f64 = 10.0;
/// Longest time that an answer may take, s.
const ANSWER_MAX_S: f64 = 60.0;

/// Where the station is, as it said last.
#[derive(Debug)]
pub struct Place {
    program: Program,
    /// Time to the next question, or of the one that is asked, s.
    wait_s: f64,
    said: Stand,
    trouble: Option<String>,
}

/// When it arrives, and when it is away after that, s from now; see [`crate::source::Observation`]. By default it stands and stays.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Stand {
    pub(super) arrives_s: Option<f64>,
    pub(super) away_s: Vec<(f64, Option<f64>)>,
}

impl Place {
    /// Of the station that this program works.
    #[must_use]
    pub fn new(operate: Vec<String>) -> Self {
        // Nobody is sent to where it may not be.
        let said = Stand { arrives_s: Some(ASK_S), ..Stand::default() };
        Self { program: Program::new(KEY, operate), wait_s: 0.0, said, trouble: None }
    }

    /// Where it is after `dt_s` (s) more.
    pub(super) fn advance(&mut self, dt_s: f64) -> Stand {
        let away = self.said.away_s.iter_mut().flat_map(|(leaves_s, returns_s)| std::iter::once(leaves_s).chain(returns_s));
        for time_s in self.said.arrives_s.iter_mut().chain(away) {
            // What was expected for now may have come: that is asked at once.
            if (0.0..dt_s).contains(time_s) {
                self.wait_s = if self.program.is_running() { self.wait_s } else { 0.0 };
            }
            *time_s -= dt_s;
        }
        self.said.away_s.retain(|(_, returns_s)| returns_s.is_none_or(|returns_s| returns_s > 0.0));
        if self.program.is_running() {
            // What the machine slept through, the program did too.
            self.wait_s += if dt_s > SLEPT_S { 0.0 } else { dt_s };
            match self.program.ended() {
                Some(ended) => self.told(ended.result.and_then(|()| stand_in(&ended.printed))),
                None if self.wait_s <= ANSWER_MAX_S => {}
                None => {
                    self.program.stop();
                    self.told(Err(format!("{KEY}: `place` has not ended in {ANSWER_MAX_S:.0} s and was stopped")));
                }
            }
        } else {
            self.wait_s -= dt_s;
            if self.wait_s <= 0.0 && !self.program.is_ending() {
                self.wait_s = 0.0;
                if let Err(what) = self.program.begin(&["place".to_owned()]) {
                    self.told(Err(what));
                }
            }
        }
        self.said.clone()
    }

    fn told(&mut self, answer: Result<Stand, String>) {
        self.wait_s = ASK_S;
        match answer {
            Ok(stand) => (self.said, self.trouble) = (stand, None),
            Err(what) => {
                if self.trouble.as_ref() != Some(&what) {
                    warn!("{what}");
                }
                self.trouble = Some(what);
            }
        }
    }

    /// Why where it is may not be known.
    pub(super) fn trouble(&self) -> Option<String> {
        self.trouble.clone()
    }
}

/// What a program has printed.
fn stand_in(printed: &str) -> Result<Stand, String> {
    let said = |line: &&str| matches!(line.split_whitespace().next(), Some("here" | "arrives"));
    let line = printed.lines().rev().find(said).ok_or_else(|| format!("{KEY}: `place` printed neither `here` nor `arrives SECONDS`"))?;
    let mut words = line.split_whitespace();
    let first = words.next();
    let times: Option<Vec<f64>> = words.map(|word| word.parse().ok().filter(|time_s: &f64| time_s.is_finite() && *time_s >= 0.0)).collect();
    let times = times.filter(|times_s| times_s.is_sorted());
    let away = |times_s: &[f64]| times_s.chunks(2).map(|pair| (pair[0], pair.get(1).copied())).collect();
    match (first, times.as_deref()) {
        (Some("here"), Some(rest)) => Ok(Stand { arrives_s: None, away_s: away(rest) }),
        (Some("arrives"), Some([arrives_s, rest @ ..])) => Ok(Stand { arrives_s: Some(*arrives_s), away_s: away(rest) }),
        _ => Err(format!(
            "{KEY}: `place` printed `{line}`: expected `here [LEAVES [RETURNS ...]]` or `arrives SECONDS [LEAVES [RETURNS ...]]`, in seconds from now, one after the other"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_program_prints_is_where_the_station_is_and_what_makes_no_sense_is_told() {
        let of = |arrives_s, away_s: &[(f64, Option<f64>)]| Ok(Stand { arrives_s, away_s: away_s.to_vec() });
        for (printed, stand) in [
            ("here\n", of(None, &[])),
            ("battery low\nhere 1200\n\n", of(None, &[(1200.0, None)])),
            ("here 1200 1500", of(None, &[(1200.0, Some(1500.0))])),
            ("arrives 90.5", of(Some(90.5), &[])),
            ("here\narrives 90 3600 4000 5000\n", of(Some(90.0), &[(3600.0, Some(4000.0)), (5000.0, None)])),
        ] {
            assert_eq!(stand_in(printed), stand, "{printed}");
        }
        for printed in ["", "there", "here soon", "here -1", "here 2 1", "arrives", "arrives nan", "arrives 90 60"] {
            assert!(stand_in(printed).is_err_and(|said| said.starts_with("source.operate: `place` printed")), "{printed}");
        }
    }

    #[test]
    fn a_station_is_asked_again_and_again_and_what_it_said_is_counted_down() {
        let folder = tempfile::tempdir().unwrap();
        let (path, answer) = (folder.path().join("operate.sh"), folder.path().join("answer"));
        std::fs::write(&path, format!("test \"$*\" = place && cat {}\n", answer.display())).unwrap();
        let mut place = Place::new(vec!["/bin/sh".to_owned(), path.display().to_string()]);
        let until = |place: &mut Place, wanted: &dyn Fn(&Place) -> bool| {
            for _ in 0..2_000 {
                let stand = place.advance(0.01);
                if wanted(place) {
                    return stand;
                }
                std::thread::sleep(std::time::Duration::from_millis(5));
            }
            panic!("{place:?}")
        };
        std::fs::write(&answer, "arrives 90 3600").unwrap();
        assert!(place.advance(0.01).arrives_s.is_some(), "nobody is sent before it is known where it is");
        until(&mut place, &|place| !place.said.away_s.is_empty());
        let Stand { arrives_s, away_s } = place.advance(5.0);
        assert!(arrives_s.is_some_and(|left_s| (84.0..=85.0).contains(&left_s)) && away_s[0].0 <= 3595.0);
        std::fs::write(&answer, "nowhere").unwrap();
        place.advance(5.0);
        let lost = until(&mut place, &|place| place.trouble().is_some());
        assert!(lost.arrives_s.is_some_and(|left_s| left_s > 60.0), "what it said before holds: {lost:?}");
        // What it expected comes, and nobody says so: the time that it told stays what it was, and an absence that is over is none.
        place.said.away_s = vec![(5.0, Some(20.0)), (60.0, None)];
        assert_eq!(place.advance(10.0).away_s, [(-5.0, Some(10.0)), (50.0, None)]);
        assert_eq!(place.advance(15.0).away_s, [(35.0, None)]);
        std::fs::write(&answer, "here").unwrap();
        place.advance(10.0);
        assert_eq!(until(&mut place, &|place| place.trouble().is_none()), Stand::default());
    }
}
