//! A whole plan that takes longer than the core may: it is made beside the core, from what was believed
//! when it was asked for, and gives the same plan wherever and whenever it runs.

use std::fmt;
use std::sync::OnceLock;

use crate::models::Settings;
use crate::scheduler::{Effort, Plan, Solved, View, solve};

/// A plan to be made.
pub struct Study {
    view: View,
    settings: Settings,
    before: Plan,
    found: OnceLock<Solved>,
}

impl Study {
    pub(super) fn new(view: View, settings: Settings, before: Plan) -> Self {
        Self { view, settings, before, found: OnceLock::new() }
    }

    /// Makes the plan, the first time that it is asked for.
    pub fn run(&self) -> &Solved {
        self.found.get_or_init(|| solve(self.view.clone(), &self.settings, &self.before, Effort::Whole))
    }
}

/// A study is itself only.
impl PartialEq for Study {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }
}

impl fmt::Debug for Study {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Study").field("robots", &self.view.robots.len()).finish_non_exhaustive()
    }
}
