//! Inputs that a model asks for and a log lacks: they count as zero, and whoever fits the model should know.

use std::sync::Arc;

use energy::{Channel, Model, Run, Start, System, catalogue};

use super::{needed_inputs, predicted_channels};
use crate::measurement::Log;

/// What is to be said about inputs that the model's predictions go by and these logs lack, which count as zero. Of batteries everything that an
/// effect goes by is a column that it needs.
#[must_use]
pub fn counted_as_zero(model: &Model, logs: &[Log]) -> Option<String> {
    let read = if model.system == System::Battery { Vec::new() } else { read(model) };
    let lacked: Vec<Channel> = read.into_iter().filter(|channel| logs.iter().any(|log| !log.channels.contains_key(channel))).collect();
    let who = |channel: Channel| {
        let lacks: Vec<&str> = logs.iter().filter(|log| !log.channels.contains_key(&channel)).map(|log| log.name.as_str()).collect();
        if lacks.len() == logs.len() { channel.name().to_owned() } else { format!("{} (in {})", channel.name(), lacks.join(", ")) }
    };
    let names: Vec<String> = lacked.into_iter().map(who).collect();
    (!names.is_empty()).then(|| {
        format!(
            "the model goes by {}, of which there is no column: counted as 0. Where that is not so, what is left may look like an effect",
            names.join(", ")
        )
    })
}

/// Inputs of a robot or station that the model's predictions change with, where all others are one.
fn read(model: &Model) -> Vec<Channel> {
    let predicted = predicted_channels(model);
    let mut inputs: Vec<Channel> =
        catalogue().iter().filter(|effect| effect.spec().system == model.system).flat_map(|effect| effect.spec().needs).copied().collect();
    inputs.sort_unstable();
    inputs.dedup();
    let computed = |channel: Channel| predicted.contains(&channel) || model.system.computed().contains(&channel);
    // Without one that an effect cannot do without there is no answer at all.
    let needed = needed_inputs(model);
    inputs.retain(|&channel| !computed(channel));
    let model = Arc::new(model.clone());
    let with = |channel: Channel, value: f64| {
        let mut run = Run::new(Arc::clone(&model), Start::at_soc(0.0));
        inputs.iter().for_each(|&input| run.channels[input] = 1.0);
        run.channels[channel] = value;
        run.step(1.0);
        predicted.iter().map(|&channel| run.channels[channel]).collect::<Vec<f64>>()
    };
    let optional = inputs.iter().copied().filter(|channel| !needed.iter().any(|(needed, _)| needed == channel));
    optional.filter(|&channel| with(channel, 0.0) != with(channel, 1.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{LogFacts, read_log};
    use crate::model_source::load_model;

    #[test]
    fn what_a_robots_power_goes_by_is_told_where_it_is_not_logged() {
        let robot = load_model("roomba-robot").unwrap().model;
        let log = |columns: &str| {
            read_log(
                "run.csv",
                format!("time_s,speed_mps{columns}\n0,1{0}\n1,1{0}\n", ",0".repeat(columns.matches(',').count())).as_bytes(),
                LogFacts::default(),
            )
            .unwrap()
        };
        let told = counted_as_zero(&robot, &[log("")]).unwrap();
        assert!(["pitch_rad", "accel_mps2", "payload_kg"].iter().all(|name| told.contains(name)), "{told}");
        assert!(!told.contains("gps") && !told.contains("speed_mps"), "{told}");
        // Of several logs one lacks it.
        let told = counted_as_zero(&robot, &[log(",pitch_rad"), log("")]).unwrap();
        assert!(told.contains("pitch_rad (in run)"), "{told}");
    }

    #[test]
    fn a_battery_needs_what_it_goes_by() {
        let cell = load_model("enertech-lco-2280mah").unwrap().model;
        let log = read_log("run.csv", "time_s,current_a\n0,1\n1,1\n".as_bytes(), LogFacts::default()).unwrap();
        assert_eq!(counted_as_zero(&cell, &[log]), None);
    }
}
