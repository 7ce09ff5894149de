//! Regimes: the conditions under which rows were taken, to see where the error lies.

use energy::{Channel, Facts, Model};

use crate::predict::Prediction;
use crate::prepare::Prepared;

/// One way to sort rows into bands.
#[derive(Debug, Clone, PartialEq)]
pub struct Dimension {
    /// Name for people and in JSON.
    pub name: &'static str,
    /// Name of each band.
    pub bands: Vec<String>,
    /// Sets of bands that can be said in a few words: the bands and the words.
    pub groups: Vec<(Vec<usize>, String)>,
    /// Band of every row; none when the row lies in no band.
    pub of_row: Vec<Option<usize>>,
}

/// Edges between the bands of state of charge, %: dense near empty, where models fail first.
const SOC_EDGES_PERCENT: [f64; 5] = [5.0, 10.0, 20.0, 40.0, 70.0];
/// Edges between the bands of current, in multiples of the capacity per hour (C-rate).
const RATE_EDGES: [f64; 2] = [0.3, 0.8];
/// Below this C-rate a battery rests.
const REST_RATE: f64 = 0.005;
/// Below this speed a robot stands still, m/s.
const STILL_MPS: f64 = 0.01;

/// Every way to sort the rows of this log that makes sense for the model's system.
#[must_use]
pub fn dimensions(model: &Model, prepared: &Prepared, prediction: &Prediction) -> Vec<Dimension> {
    let input = |channel| prepared.inputs.iter().find(|(known, _)| *known == channel).map(|(_, values)| values.as_slice());
    match &model.facts {
        Facts::Battery(facts) => {
            let current = input(Channel::CurrentA).map(|current_a| current(current_a, facts.capacity_ah));
            std::iter::once(soc(&prediction.soc)).chain(current).collect()
        }
        Facts::Robot(_) => input(Channel::SpeedMps)
            .map(|speed_mps| two("motion", ["standing still", "driving"], speed_mps, |speed| speed.abs() >= STILL_MPS))
            .into_iter()
            .collect(),
        Facts::Station => [
            input(Channel::ChargePowerW).map(|power_w| two("charging", ["no robot charging", "charging robots"], power_w, |w| w > 0.0)),
            input(Channel::LiftActive).map(|active| two("lift", ["lift at rest", "lift moving"], active, |active| active > 0.0)),
        ]
        .into_iter()
        .flatten()
        .collect(),
    }
}

fn soc(soc: &[f64]) -> Dimension {
    let edges = SOC_EDGES_PERCENT;
    let last = edges.len();
    let band = |index: usize| match index {
        0 => format!("0-{} %", edges[0]),
        index if index == last => format!("{}-100 %", edges[last - 1]),
        index => format!("{}-{} %", edges[index - 1], edges[index]),
    };
    let below = (1..=last).map(|end| ((0..end).collect(), format!("below {} % SoC", edges[end - 1])));
    let above = (1..=last).map(|begin| ((begin..=last).collect(), format!("above {} % SoC", edges[begin - 1])));
    let between = (1..last).map(|index| (vec![index], format!("between {} and {} % SoC", edges[index - 1], edges[index])));
    let of_row = soc.iter().map(|soc| Some(edges.partition_point(|&edge| edge <= soc * 100.0)));
    Dimension {
        name: "soc",
        bands: (0..=last).map(band).collect(),
        groups: below.chain(above).chain(between).collect(),
        of_row: of_row.collect(),
    }
}

fn current(current_a: &[f64], capacity_ah: f64) -> Dimension {
    let [low, high] = RATE_EDGES;
    let sizes = [format!("< {low}C"), format!("{low}-{high}C"), format!("> {high}C")];
    let mut bands = vec!["rest".to_owned()];
    bands.extend(sizes.iter().map(|size| format!("discharge {size}")));
    bands.extend(sizes.iter().map(|size| format!("charge {size}")));
    let words = |index: usize| if index == 0 { "at rest".to_owned() } else { format!("at {}", bands[index]) };
    let single = (0..bands.len()).map(|index| (vec![index], words(index)));
    let both = [(vec![1, 2, 3], "in discharge".to_owned()), (vec![4, 5, 6], "in charge".to_owned())];
    let groups = single.chain(both).collect();
    let of_row = current_a.iter().map(|current_a| {
        let rate = current_a / capacity_ah;
        let size = RATE_EDGES.partition_point(|&edge| edge <= rate.abs());
        Some(match rate {
            rate if rate.abs() < REST_RATE => 0,
            rate if rate > 0.0 => 1 + size,
            _ => 4 + size,
        })
    });
    Dimension { name: "current", of_row: of_row.collect(), bands, groups }
}

fn two(name: &'static str, bands: [&str; 2], values: &[f64], second: impl Fn(f64) -> bool) -> Dimension {
    Dimension {
        name,
        bands: bands.map(str::to_owned).to_vec(),
        groups: bands.iter().enumerate().map(|(index, band)| (vec![index], format!("with {band}"))).collect(),
        of_row: values.iter().map(|&value| Some(usize::from(second(value)))).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soc_falls_into_its_band_even_outside_0_to_1() {
        let dimension = soc(&[-0.02, 0.049, 0.05, 0.69, 0.7, 1.01]);
        assert_eq!(dimension.bands, ["0-5 %", "5-10 %", "10-20 %", "20-40 %", "40-70 %", "70-100 %"]);
        assert_eq!(dimension.of_row, [0, 0, 1, 4, 5, 5].map(Some));
        assert!(dimension.groups.contains(&(vec![0, 1], "below 10 % SoC".to_owned())));
    }

    #[test]
    fn current_is_sorted_by_sign_and_c_rate() {
        let dimension = current(&[0.0, 0.2, 1.0, 2.0, -0.2, -1.0, -2.0], 2.0);
        assert_eq!(dimension.of_row, [0, 1, 2, 3, 4, 5, 6].map(Some));
        assert_eq!(dimension.bands[3], "discharge > 0.8C");
    }
}
