//! A pack's energy as a stack: promised to services, free for more, and reserve that the station
//! cannot draw at its working power.
//!
//! Services that have begun and planned ones are paid in the order in which packs are drained. What
//! is promised rests on the station's model, whose error all services share: sigmas of services are
//! added, not their squares, which is the most that they can come to.

use std::collections::BTreeMap;

use energy::Estimate;
use energy::units::S_PER_H;
use proto::{PackId, Schedule, ServiceStatus, StationId};
use serde::Serialize;

use crate::models::from_wire;
use crate::view::Basis;
use crate::web::number::{Quantity, quantity};

/// Where a pack's energy goes. `promised + free + reserve = remaining` of its gauge, as long as the
/// station can draw any of it.
#[derive(Debug, Clone, Serialize)]
pub struct Stack {
    /// Goes into services that have begun or are planned.
    pub promised: Quantity,
    /// Can go into further ones.
    pub free: Quantity,
    /// What is left in the pack when the station can draw no more.
    pub reserve: Quantity,
    /// From full to empty, by its gauge.
    pub full: Quantity,
    /// Left, by its gauge.
    pub remaining: Quantity,
}

/// The stacks of every pack of every station.
pub(super) type Stacks = BTreeMap<(StationId, PackId), Stack>;

pub(super) fn stacks(basis: &Basis<'_>, schedule: &Schedule) -> Stacks {
    let mut stacks = Stacks::new();
    for (id, models) in &basis.models.stations {
        let Some(station) = basis.fleet.stations.get(id) else { continue };
        let view = basis.station(id, models, Some(station));
        let planned = || schedule.services.iter().filter(|service| service.station == *id && service.status == ServiceStatus::Planned);
        // What the station itself takes, it takes until the last of them has ended.
        let ends_s = planned().map(|service| service.end.seconds_since(basis.now)).fold(view.committed_until_s, f64::max);
        let begun = view.owed().plus(&view.overhead_per_h.scaled(ends_s.max(0.0) / S_PER_H)).estimate();
        let planned_wh = planned().map(|service| from_wire(service.pack_energy_wh));
        let owed = planned_wh.fold(begun, |sum, next| Estimate::new(sum.value + next.value, sum.sigma + next.sigma));
        let usable: Vec<(&PackId, Estimate)> = view.packs.iter().map(|pack| (&pack.pack, pack.usable_wh)).collect();
        let shares = share_out(owed, &usable);
        for (pack, gauge) in &station.packs {
            let remaining = from_wire(gauge.remaining_wh);
            let none = (Estimate::exact(0.0), Estimate::exact(0.0));
            let (promised, usable) = shares.get(pack).copied().unwrap_or(none);
            let free = Estimate::new(usable.value - promised.value, usable.sigma.hypot(promised.sigma));
            // Gauge and forecast judge the same charge; what they have in common is not taken off, so
            // this sigma is rather too wide.
            let reserve = Estimate::new((remaining.value - usable.value).max(0.0), remaining.sigma.hypot(usable.sigma));
            let stack = Stack {
                promised: quantity(promised, "Wh"),
                free: quantity(free, "Wh"),
                reserve: quantity(reserve, "Wh"),
                full: quantity(from_wire(gauge.full_wh), "Wh"),
                remaining: quantity(remaining, "Wh"),
            };
            stacks.insert((id.clone(), pack.clone()), stack);
        }
    }
    stacks
}

/// What each pack pays of what is owed, and what it could give at most.
fn share_out<'a>(owed: Estimate, usable: &[(&'a PackId, Estimate)]) -> BTreeMap<&'a PackId, (Estimate, Estimate)> {
    let mut left_wh = owed.value;
    let pay = |&(pack, usable): &(&'a PackId, Estimate)| {
        let paid_wh = left_wh.min(usable.value).max(0.0);
        left_wh -= paid_wh;
        let sigma = if owed.value > 0.0 { owed.sigma * paid_wh / owed.value } else { 0.0 };
        (pack, (Estimate::new(paid_wh, sigma), usable))
    };
    usable.iter().map(pay).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packs_pay_in_turn_and_each_carries_its_share_of_the_doubt() {
        let (one, two): (PackId, PackId) = ("pack-1".parse().unwrap(), "pack-2".parse().unwrap());
        let usable = [(&one, Estimate::new(10.0, 1.0)), (&two, Estimate::new(50.0, 2.0))];
        let shares = share_out(Estimate::new(40.0, 4.0), &usable);
        assert_eq!(shares[&one].0, Estimate::new(10.0, 1.0));
        assert_eq!(shares[&two].0, Estimate::new(30.0, 3.0));
        // More than there is: everything is paid, nothing twice.
        let shares = share_out(Estimate::new(100.0, 4.0), &usable);
        assert_eq!(shares[&one].0.value + shares[&two].0.value, 60.0);
        assert_eq!(share_out(Estimate::exact(0.0), &usable)[&two].0, Estimate::exact(0.0));
    }
}
