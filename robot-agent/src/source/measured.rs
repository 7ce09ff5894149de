//! A robot whose battery a device measures: the gauge of [`device::Reader`], and the hands of a program.

use std::sync::Arc;

use device::{Device, Reader};
use energy::Model;
use node::Stride;

use super::body::{Body, Hands};
use super::{Act, Held, Observation, Place, Source};

/// A robot whose battery a device measures.
pub struct Measured {
    reader: Reader,
    hands: Hands,
}

impl Measured {
    /// A robot whose battery is believed to be `model` and measured by `device`.
    #[must_use]
    pub fn new(device: Box<dyn Device>, model: Arc<Model>, body: Body) -> Self {
        let unmeasured = body.unmeasured();
        Self { reader: Reader::new(device, model, unmeasured), hands: Hands::new(body.drive) }
    }
}

impl Source for Measured {
    fn act(&mut self, act: &Act) {
        match act {
            Act::Charge => self.reader.charge(true),
            Act::StopCharging => self.reader.charge(false),
            Act::TravelTo { .. } | Act::GoOnTo { .. } | Act::Resume => self.reader.leave(),
        }
        self.hands.begin(act);
    }

    fn stand(&mut self, place: Place) {
        self.hands.stand(place);
    }

    fn held(&mut self, held: Held) {
        self.hands.held(held);
    }

    fn stride(&self) -> Stride {
        Stride::AtOnce
    }

    fn advance(&mut self, dt_s: f64) -> Option<Observation> {
        let seen = self.reader.advance(dt_s);
        for supply in seen.supplies {
            self.hands.feel(supply);
        }
        let place = self.hands.place(dt_s);
        Some(Observation {
            sample: seen.sample,
            place,
            powered: self.hands.powered(),
            exchanged: seen.exchanged,
            said_soc: seen.said_soc,
            depleted: false,
            why_down: seen.silent.or_else(|| self.reader.device().trouble()).or_else(|| self.hands.trouble()),
        })
    }
}

#[cfg(test)]
mod tests;
