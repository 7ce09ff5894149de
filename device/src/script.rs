//! A device for trials: what it says is laid out beforehand.

use anyhow::Context as _;

use crate::report::{Device, Report};

/// What is said each time that it is read; when that has ended it is unplugged.
pub struct Script(Box<dyn Iterator<Item = Vec<Report>> + Send>);

impl Script {
    /// A device that says this.
    #[must_use]
    pub fn new<I>(says: I) -> Box<Self>
    where
        I: IntoIterator<Item = Vec<Report>>,
        I::IntoIter: Send + 'static,
    {
        Box::new(Self(Box::new(says.into_iter())))
    }
}

impl Device for Script {
    fn name(&self) -> String {
        "script".to_owned()
    }

    fn read(&mut self, _dt_s: f64) -> anyhow::Result<Vec<Report>> {
        self.0.next().context("unplugged")
    }
}
