//! Usable energy of a discharge that does not end at full power.
//!
//! A station's packs do not give out in the middle of a charge if the plan is good: the last robots'
//! currents taper off first, and at less current the voltage meets the end of discharge later. So what
//! is usable is what may be drawn at the working power such that the ending can still follow.

use std::sync::Arc;

use super::{POWER_SHARE_MIN, STEPS, discharge};
use crate::load::Terminals as _;
use crate::pack::Battery as _;
use crate::units::S_PER_H;
use crate::{Channel, Model, Pack, Start};

/// Halvings of the step in which the last moment for the ending lies.
const HALVINGS: u32 = 6;

/// A load that ends gently.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Draw {
    /// Power until the ending begins, W.
    pub power_w: f64,
    /// The ending: how long (s) and how much (W), in order.
    pub ending: Vec<(f64, f64)>,
}

impl Draw {
    /// The same power to the end.
    #[must_use]
    pub fn steady(power_w: f64) -> Self {
        Self { power_w, ending: Vec::new() }
    }

    /// Energy of the ending, Wh.
    #[must_use]
    pub fn ending_wh(&self) -> f64 {
        self.ending.iter().map(|(time_s, power_w)| time_s * power_w / S_PER_H).sum()
    }
}

/// How much more a full pack delivers to such a load than to its power alone, Wh: never less than nothing.
#[must_use]
pub fn gain_wh(model: &Arc<Model>, temperature_degc: f64, draw: &Draw) -> f64 {
    let full = Pack::new(Arc::clone(model), Start { temperature_degc, ..Start::at_soc(1.0) });
    delivered_wh(&full, draw) - discharge(&mut full.clone(), draw.power_w).energy_wh
}

/// Energy that a pack still delivers to such a load, Wh.
fn delivered_wh(pack: &Pack, draw: &Draw) -> f64 {
    let steady_wh = discharge(&mut pack.clone(), draw.power_w).energy_wh;
    if draw.ending.is_empty() {
        return steady_wh;
    }
    let facts = pack.model().battery();
    let drawn_w = draw.power_w.max(POWER_SHARE_MIN * facts.stored_wh());
    let mut dt_s = (steady_wh / drawn_w * S_PER_H / STEPS).max(1.0);
    let mut stops = vec![(0.0, pack.clone())];
    let mut run = pack.clone();
    let mut energy_wh = 0.0;
    while let Some(wh) = step(&mut run, drawn_w, dt_s) {
        energy_wh += wh;
        stops.push((energy_wh, run.clone()));
    }
    let with_ending = |(before_wh, stop): &(f64, Pack)| end(stop.clone(), &draw.ending).map(|wh| before_wh + wh);
    let Some((mut last, mut most_wh)) = stops.into_iter().rev().find_map(|stop| with_ending(&stop).map(|wh| (stop, wh))) else {
        return steady_wh;
    };
    for _ in 0..HALVINGS {
        dt_s /= 2.0;
        let (before_wh, mut run) = last.clone();
        if let Some(wh) = step(&mut run, drawn_w, dt_s) {
            let next = (before_wh + wh, run);
            if let Some(wh) = with_ending(&next) {
                (last, most_wh) = (next, wh);
            }
        }
    }
    most_wh.max(steady_wh)
}

fn end(mut run: Pack, ending: &[(f64, f64)]) -> Option<f64> {
    ending.iter().try_fold(0.0, |sum, &(time_s, power_w)| Some(sum + step(&mut run, power_w, time_s)?))
}

/// Energy of one step at constant power, Wh; none when the pack cannot.
fn step(run: &mut Pack, power_w: f64, dt_s: f64) -> Option<f64> {
    let before_v = run.channel(Channel::TerminalVoltageV);
    run.step_power(power_w, dt_s).ok()?;
    if run.is_empty() {
        return None;
    }
    // The step holds the current that gives this power at its end.
    let [current_a, voltage_v] = [Channel::TerminalCurrentA, Channel::TerminalVoltageV].map(|channel| run.channel(channel));
    Some(current_a * f64::midpoint(before_v, voltage_v) * dt_s / S_PER_H)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load_model;

    fn pack() -> Pack {
        let model = Arc::new(load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap());
        Pack::new(model, Start::at_soc(0.6))
    }

    #[test]
    fn what_an_ammeter_shows_changes_nothing_of_what_is_delivered() {
        let (draw, true_one) = (Draw { power_w: 40.0, ending: vec![(60.0, 80.0)] }, pack());
        let off = true_one.model().with("current_gain").unwrap();
        let values = off.parameters().iter().map(|own| if own.effect == "current_gain" { 1.05 } else { own.value }).collect::<Vec<_>>();
        let told = Pack::new(Arc::new(off.with_values(&values)), Start::at_soc(0.6));
        let [told_wh, true_wh] = [&told, &true_one].map(|pack| delivered_wh(pack, &draw));
        assert!((told_wh / true_wh - 1.0).abs() < 1e-6, "{told_wh} {true_wh}");
    }

    #[test]
    fn without_an_ending_it_is_a_steady_discharge() {
        let steady_wh = discharge(&mut pack(), 60.0).energy_wh;
        assert_eq!(delivered_wh(&pack(), &Draw::steady(60.0)), steady_wh);
    }

    /// An ending at the working power is no ending: only the resolution of the search is lost.
    #[test]
    fn an_ending_at_full_power_changes_nothing() {
        let draw = Draw { power_w: 60.0, ending: vec![(60.0, 60.0); 5] };
        let ratio = delivered_wh(&pack(), &draw) / delivered_wh(&pack(), &Draw::steady(60.0));
        assert!((1.0..1.003).contains(&ratio), "{ratio}");
    }

    /// Between a discharge at the working power and one at the ending's, and all that is drawn can be.
    #[test]
    fn a_gentle_ending_lets_more_be_drawn() {
        let ending: Vec<(f64, f64)> = (0..20).map(|minute| (60.0, 60.0 - 2.5 * f64::from(minute))).collect();
        let usable_wh = delivered_wh(&pack(), &Draw { power_w: 60.0, ending: ending.clone() });
        let [hard_wh, soft_wh] = [60.0, 10.0].map(|power_w| discharge(&mut pack(), power_w).energy_wh);
        assert!(hard_wh + 0.3 < usable_wh && usable_wh < soft_wh, "{hard_wh} {usable_wh} {soft_wh}");
        // Step by step in seconds: it holds with half a per cent less before the ending, and with one more it does not.
        let ending_wh: f64 = ending.iter().map(|(time_s, power_w)| time_s * power_w / S_PER_H).sum();
        let holds = |share: f64| {
            let mut run = pack();
            let before_s = ((usable_wh * share - ending_wh) / 60.0 * S_PER_H) as usize;
            let seconds = std::iter::repeat_n(60.0, before_s).chain(ending.iter().flat_map(|&(_, power_w)| [power_w; 60]));
            seconds.into_iter().all(|power_w| step(&mut run, power_w, 1.0).is_some())
        };
        assert!(holds(0.995) && !holds(1.01));
    }
}
