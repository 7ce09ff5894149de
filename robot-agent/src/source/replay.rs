//! A measured log, replayed as a gauge would have seen it; the robot in it is at work.

use device::Log;

use super::{Act, Observation, Place, Source};

/// A log being replayed.
#[derive(Debug, Clone)]
pub struct Replay(pub Log);

impl Source for Replay {
    fn act(&mut self, _: &Act) {
        // A log has already happened.
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        if self.0.has_ended() {
            return None;
        }
        let sample = self.0.advance(dt_s);
        Some(Observation {
            sample,
            place: Place::Mission,
            powered: false,
            exchanged: None,
            said_soc: None,
            depleted: false,
            why_down: None,
        })
    }
}
