//! Packs that go to a depot and come back charged.

use energy::Channel;

use super::StationBody;
use crate::source::label;

impl StationBody {
    /// Lets packs go that are low and feed nothing, and puts those in that come.
    pub(super) fn exchange_packs(&mut self, dt_s: f64) {
        let Some(depot) = self.depot else { return };
        for pack in &mut self.packs {
            pack.away_s = pack.away_s.map(|left_s| left_s - dt_s);
            if pack.away_s.is_some_and(|left_s| left_s <= 0.0) {
                pack.body.exchange(depot.soc);
                (pack.away_s, pack.depleted) = (None, false);
                pack.exchanged = Some(label(depot.soc));
            }
        }
        let mut away = self.packs.iter().filter(|pack| pack.away_s.is_some()).count();
        for (index, pack) in self.packs.iter_mut().enumerate() {
            let feeds = index == self.active && self.powered;
            let low = pack.depleted || pack.body.truth(Channel::Soc) < depot.below_soc;
            if !feeds && low && pack.away_s.is_none() && away < depot.at_once as usize {
                pack.away_s = Some(depot.away_s);
                away += 1;
            }
        }
    }
}
