//! The ways from a robot's work to its stations: what they cost, and what the robot does on them. The
//! same keys in scenarios and in the agent's configuration.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::Model;
use energy::drive::travel::{Pace, Segment, Trip, moments, trip};
use node::mission::{INPUT_MAX, LONG, Mission, Stretch, above, channels, within};
use proto::StationId;
use serde::{Deserialize, Serialize};

/// `[way]`: the ways from the work to stations, where they are more than a time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ways {
    /// Acceleration and deceleration, m/s² (above 0).
    #[serde(default = "default_accel_mps2")]
    pub accel_mps2: f64,
    /// Yaw rate of turns on the spot, rad/s (above 0).
    #[serde(default = "default_yaw_rate_radps")]
    pub yaw_rate_radps: f64,
    /// The pieces of each way, in order.
    pub to: BTreeMap<StationId, Vec<Piece>>,
}

/// A piece of a way.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// Length, m (0 for a turn alone).
    pub length_m: f64,
    /// Speed wanted, m/s (above 0).
    pub speed_mps: f64,
    /// Slope, uphill positive, rad.
    #[serde(default)]
    pub pitch_rad: f64,
    /// Class of the floor; 0 is the one that the load model's numbers were stated for.
    #[serde(default)]
    pub floor_class: u32,
    /// Angle turned on the spot before it, rad.
    #[serde(default)]
    pub turn_rad: f64,
    /// Load carried, kg.
    #[serde(default)]
    pub payload_kg: f64,
}

fn default_accel_mps2() -> f64 {
    0.5
}

fn default_yaw_rate_radps() -> f64 {
    1.0
}

impl Ways {
    /// Checks every number.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        above("way.accel_mps2", self.accel_mps2, 100.0)?;
        above("way.yaw_rate_radps", self.yaw_rate_radps, 100.0)?;
        for (station, pieces) in &self.to {
            for (index, piece) in pieces.iter().enumerate() {
                let key = |name: &str| format!("way.to.{station}[{index}].{name}");
                within(&key("length_m"), piece.length_m, 0.0, LONG)?;
                above(&key("speed_mps"), piece.speed_mps, 100.0)?;
                within(&key("pitch_rad"), piece.pitch_rad, -1.5, 1.5)?;
                within(&key("turn_rad"), piece.turn_rad, -100.0, 100.0)?;
                within(&key("payload_kg"), piece.payload_kg, 0.0, INPUT_MAX)?;
            }
        }
        Ok(())
    }

    fn pace(&self) -> Pace {
        Pace { accel_mps2: self.accel_mps2, yaw_rate_radps: self.yaw_rate_radps }
    }

    /// What the way to a station costs by a load model; none when there is no such way.
    ///
    /// # Errors
    /// When an input of the mission is no channel.
    pub fn trip(&self, to: &StationId, mission: &Mission, load: &Arc<Model>) -> anyhow::Result<Option<Trip>> {
        let Some(pieces) = self.to.get(to) else { return Ok(None) };
        let inputs = channels("mission.inputs", &mission.inputs)?;
        Ok(Some(trip(load, &inputs, self.pace(), &segments(pieces))))
    }

    /// The way to a station as stretches, and the way back, driven in the other direction. The
    /// distance to the coordinator's radio falls evenly to nothing: it stands at the station.
    ///
    /// # Errors
    /// When an input of the mission is no channel.
    pub fn stretches(&self, to: &StationId, mission: &Mission) -> anyhow::Result<Option<[Vec<Stretch>; 2]>> {
        let Some(pieces) = self.to.get(to) else { return Ok(None) };
        let base = channels("mission.inputs", &mission.inputs)?;
        let there = segments(pieces);
        let back: Vec<Segment> = there.iter().rev().map(|segment| Segment { pitch_rad: -segment.pitch_rad, ..*segment }).collect();
        let far_m = mission.distance_m;
        let follow = |way: &[Segment], homeward: bool| {
            let moments = moments(self.pace(), way);
            let whole_s: f64 = moments.iter().map(|moment| moment.time_s).sum();
            let mut gone_s = 0.0;
            let each = moments.iter().map(|moment| {
                let share = (gone_s + moment.time_s / 2.0) / whole_s;
                gone_s += moment.time_s;
                let mut inputs = base.clone();
                inputs.retain(|(channel, _)| moment.inputs.iter().all(|(own, _)| own != channel));
                inputs.extend(moment.inputs);
                Stretch { time_s: moment.time_s, distance_m: far_m * if homeward { 1.0 - share } else { share }, inputs }
            });
            each.collect::<Vec<_>>()
        };
        Ok(Some([follow(&there, true), follow(&back, false)]))
    }
}

fn segments(pieces: &[Piece]) -> Vec<Segment> {
    let segment = |piece: &Piece| {
        let Piece { length_m, speed_mps, pitch_rad, floor_class, turn_rad, payload_kg } = *piece;
        Segment { length_m, speed_mps, pitch_rad, floor_class, turn_rad, payload_kg }
    };
    pieces.iter().map(segment).collect()
}

#[cfg(test)]
mod tests {
    use energy::Channel;

    use super::*;

    fn explorer() -> Arc<Model> {
        Arc::new(energy::load_model("explorer-robot", &|_| unreachable!("built in")).unwrap())
    }

    #[test]
    fn a_speed_of_nothing_is_refused() {
        let refused = |text: &str| toml::from_str::<Ways>(text).unwrap().check().unwrap_err().to_string();
        assert!(refused("to.mds-1 = [{ length_m = 5, speed_mps = 0 }]").contains("way.to.mds-1[0].speed_mps = 0: must be above 0"));
        assert!(refused("accel_mps2 = -1\nto = {}").contains("way.accel_mps2 = -1: must be above 0"));
    }

    #[test]
    fn the_way_home_costs_its_climb_and_the_way_back_does_not() {
        let ways: Ways = toml::from_str("to.mds-1 = [{ length_m = 30, speed_mps = 0.3, pitch_rad = 0.1 }]").unwrap();
        let station = StationId::new("mds-1").unwrap();
        let mission = Mission { distance_m: 40.0, ..Mission::default() };
        let trip = ways.trip(&station, &mission, &explorer()).unwrap().unwrap();
        let [there, back] = ways.stretches(&station, &mission).unwrap().unwrap();
        let lasts = |way: &[Stretch]| way.iter().map(|stretch| stretch.time_s).sum::<f64>();
        // By hand: 30 m / 0.3 m/s + 0.3 m/s / 0.5 m/s².
        assert!((trip.time_s - 100.6).abs() < 1e-9 && (lasts(&there) - 100.6).abs() < 1e-9 && (lasts(&back) - 100.6).abs() < 1e-9);
        let pitch = |way: &[Stretch]| way[20].inputs.iter().find(|(channel, _)| *channel == Channel::PitchRad).unwrap().1;
        assert_eq!((pitch(&there), pitch(&back)), (0.1, -0.1));
        assert!(there[0].distance_m > 39.0 && there[there.len() - 1].distance_m < 1.0);
        assert!(trip.energy_wh.value > 0.0 && trip.energy_wh.sigma > 0.0);
        assert!(ways.trip(&StationId::new("other").unwrap(), &mission, &explorer()).unwrap().is_none());
    }
}
