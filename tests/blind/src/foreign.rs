//! Truths that no effect of the catalogue is: the same physics in another form, and things that
//! the catalogue knows nothing of.

mod other_form;
mod outside;

use std::sync::Arc;

use energy::System;

pub use other_form::OTHER_FORMS;
pub use outside::{AT_RANDOM, OUTSIDE};

use crate::random::Stream;
use crate::world::{Adds, Foreign, MakeForeign, Moment};

/// Something foreign that can be put into a world.
#[derive(Debug)]
pub struct Stranger {
    /// Name of its case.
    pub name: &'static str,
    /// The system.
    pub system: System,
    /// What it is, in words.
    pub story: &'static str,
    /// Effects whose physics it is in another form; none for what the catalogue does not know.
    pub any: &'static [&'static str],
    /// Effects that are no mistake beside these.
    pub may: &'static [&'static str],
    /// Effects of the base.
    pub base: &'static [&'static str],
    /// Makes it from draws that hold for all logs of a case.
    pub make: fn(&mut Stream) -> MakeForeign,
}

/// Something that adds to the target and starts anew in every log.
fn on_target(start: impl Fn(f64, usize) -> Adds + Send + Sync + 'static) -> MakeForeign {
    Arc::new(move |size, log| Foreign { current_a: None, target: Some(start(size, log)) })
}

/// Something that adds to the target and has no memory.
fn at_once(adds: impl Fn(&Moment<'_>) -> f64 + Copy + Send + Sync + 'static) -> MakeForeign {
    on_target(move |size, _| Box::new(move |now| size * adds(now)))
}

/// Something that draws a current which the gauge does not see.
fn on_current(start: impl Fn(f64, usize) -> Adds + Send + Sync + 'static) -> MakeForeign {
    Arc::new(move |size, log| Foreign { current_a: Some(start(size, log)), target: None })
}
