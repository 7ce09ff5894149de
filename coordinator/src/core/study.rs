//! A whole plan that takes longer than the core may: it is made beside the core, from what was believed
//! when it was asked for, and gives the same plan wherever and whenever it runs.

use std::fmt;
use std::sync::OnceLock;

use crate::models::Settings;
use crate::scheduler::{Plan, Solved, View, solve_side_by_side};

/// A plan to be made.
pub struct Study {
    /// At least one.
    views: Vec<View>,
    settings: Settings,
    before: Plan,
    found: OnceLock<Solved>,
}

impl Study {
    pub(super) fn new(views: Vec<View>, settings: Settings, before: Plan) -> Self {
        Self { views, settings, before, found: OnceLock::new() }
    }

    /// Makes the plan, the first time that it is asked for.
    pub fn run(&self) -> &Solved {
        self.found.get_or_init(|| solve_side_by_side(self.views.iter().cloned(), &self.settings, &self.before))
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
        f.debug_struct("Study").field("views", &self.views.len()).finish_non_exhaustive()
    }
}
