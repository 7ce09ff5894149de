//! A tree of rails: which converter, regulator or switch feeds which loads.
//!
//! ```text
//!   battery ──┬── 5 V, switching ──┬── loads of constant current, power, resistance
//!             │                    └── 3.3 V, linear ── loads
//!             └── 5 V, linear ── loads
//! ```
//!
//! Kottas, Fig. 4.1 ("two cascaded power conversion stages"). [`PowerTree::solve`] gives the
//! battery's current and every rail's loss, or names the rail that cannot deliver.

use crate::document::hint;
use crate::power::{Consumer, Ldo, SwitchMode};

/// Most rails that a tree may have: solving one keeps them on the stack.
pub const RAILS_MAX: usize = 16;

/// The name under which rails call the battery.
pub const BATTERY: &str = "battery";

/// A load switch or a plain wire: the input's voltage, less what its resistance takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Switch {
    /// Resistance, ohm, >= 0.
    pub resistance_ohm: f64,
}

/// What stands between a rail and what feeds it.
#[derive(Debug, Clone, PartialEq)]
pub enum RailKind {
    /// A switch-mode converter.
    Switching(SwitchMode),
    /// A linear regulator.
    Linear(Ldo),
    /// A switch or wire.
    Switch(Switch),
}

/// A supply line with its loads.
#[derive(Debug, Clone, PartialEq)]
pub struct Rail {
    /// Name in files.
    pub id: String,
    /// What feeds it: [`BATTERY`] or another rail's id.
    pub from: String,
    /// How.
    pub kind: RailKind,
    /// Most current that it delivers, A; infinite when not limited.
    pub current_a_max: f64,
    /// What hangs on it, beside other rails.
    pub loads: Vec<Consumer>,
    /// Where its numbers come from, for people.
    pub source: Option<String>,
}

/// A checked tree, each rail after the one that feeds it.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerTree {
    rails: Vec<Rail>,
    /// For each rail the place of the rail that feeds it; none for the battery.
    parents: Vec<Option<usize>>,
}

impl PowerTree {
    /// Puts rails in order and checks that each hangs, over others, on the battery.
    ///
    /// # Errors
    /// The place of the rail at fault in `rails`, and what is wrong with it.
    pub fn new(rails: Vec<Rail>) -> Result<Self, (usize, String)> {
        if let Some(extra) = rails.get(RAILS_MAX) {
            return Err((RAILS_MAX, format!("rail `{}` is one too many: a tree has at most {RAILS_MAX}", extra.id)));
        }
        let names = || std::iter::once(BATTERY).chain(rails.iter().map(|rail| rail.id.as_str()));
        for (index, rail) in rails.iter().enumerate() {
            if names().take(index + 1).any(|name| name == rail.id) {
                return Err((index, format!("a second rail `{}`; each id, and `{BATTERY}`, is given once", rail.id)));
            }
            if !names().any(|name| name == rail.from) {
                let known = names().collect::<Vec<_>>().join(", ");
                let message = format!("rail `{}` hangs on `{}`, which is not there{}", rail.id, rail.from, hint(&rail.from, names()));
                return Err((index, format!("{message} Known: {known}")));
            }
        }
        // Round by round, whatever hangs on something already placed.
        let mut order: Vec<usize> = Vec::with_capacity(rails.len());
        while order.len() < rails.len() {
            let placed = |name: &str| name == BATTERY || order.iter().any(|&index| rails[index].id == name);
            let next: Vec<usize> = (0..rails.len()).filter(|index| !order.contains(index) && placed(&rails[*index].from)).collect();
            if next.is_empty() {
                let index = (0..rails.len()).find(|index| !order.contains(index)).expect("some rail is not placed");
                return Err((index, format!("rail `{}` hangs on itself, over `{}`", rails[index].id, rails[index].from)));
            }
            order.extend(next);
        }
        let mut unordered: Vec<Option<Rail>> = rails.into_iter().map(Some).collect();
        let rails: Vec<Rail> = order.into_iter().filter_map(|index| unordered[index].take()).collect();
        let parents = rails.iter().map(|rail| rails.iter().position(|other| other.id == rail.from)).collect();
        Ok(Self { rails, parents })
    }

    /// The rails, each after the one that feeds it.
    #[must_use]
    pub fn rails(&self) -> &[Rail] {
        &self.rails
    }

    /// The place of a rail in [`PowerTree::rails`].
    #[must_use]
    pub fn find(&self, id: &str) -> Option<usize> {
        self.rails.iter().position(|rail| rail.id == id)
    }

    /// The tree with each load that is only roughly known one deviation above and one below its
    /// value: one pair for each.
    pub fn deviations(&self) -> impl Iterator<Item = [PowerTree; 2]> + '_ {
        let places = self.rails.iter().enumerate().flat_map(|(rail, at)| (0..at.loads.len()).map(move |load| (rail, load)));
        places.filter(|&(rail, load)| self.rails[rail].loads[load].sigma > 0.0).map(|(rail, load)| {
            [1.0, -1.0].map(|sign| {
                let mut changed = self.clone();
                let known = &mut changed.rails[rail].loads[load];
                // A resistance stays above zero.
                known.value = (known.value + sign * known.sigma).max(1e-9);
                changed
            })
        })
    }

    /// The place of the rail that feeds a rail; none when that is the battery.
    #[must_use]
    pub fn parent(&self, index: usize) -> Option<usize> {
        self.parents[index]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wire(id: &str, from: &str) -> Rail {
        Rail {
            id: id.to_owned(),
            from: from.to_owned(),
            kind: RailKind::Switch(Switch { resistance_ohm: 0.0 }),
            current_a_max: f64::INFINITY,
            loads: Vec::new(),
            source: None,
        }
    }

    #[test]
    fn rails_may_be_written_in_any_order() {
        let tree = PowerTree::new(vec![wire("c", "b"), wire("b", "a"), wire("a", "battery")]).unwrap();
        assert_eq!(tree.rails().iter().map(|rail| rail.id.as_str()).collect::<Vec<_>>(), ["a", "b", "c"]);
        assert_eq!([tree.parent(0), tree.parent(1), tree.parent(2)], [None, Some(0), Some(1)]);
    }

    #[test]
    fn a_rail_that_hangs_on_nothing_on_itself_or_twice_is_named() {
        let refused = |rails: &[(&str, &str)]| PowerTree::new(rails.iter().map(|(id, from)| wire(id, from)).collect()).unwrap_err();
        let (index, message) = refused(&[("main", "battery"), ("logic", "maim")]);
        assert_eq!(index, 1);
        assert!(message.contains("`logic` hangs on `maim`") && message.contains("did you mean `main`?"), "{message}");
        assert!(refused(&[("a", "b"), ("b", "a")]).1.contains("rail `a` hangs on itself, over `b`"));
        assert!(refused(&[("a", "a")]).1.contains("hangs on itself"));
        assert_eq!(refused(&[("a", "battery"), ("a", "battery")]).0, 1);
        assert_eq!(refused(&[("battery", "battery")]).0, 0);
        let many: Vec<Rail> = (0..=RAILS_MAX).map(|index| wire(&format!("r{index}"), "battery")).collect();
        assert!(PowerTree::new(many).unwrap_err().1.contains("at most 16"));
    }
}
