//! Tests of the lab: measured logs against an independent calculation, recovery of known
//! parameters from synthetic logs, and the command line.

mod beside;
mod calibration;
mod cli;
mod commands;
mod discovery;
mod first_model;
mod first_model_sensors;
mod gaps;
mod inputs;
mod known_together;
mod little_left;
mod made_up;
mod measured;
mod noisy_current;
mod noisy_speed;
mod other_numbers;
mod polarised;
mod propose;
mod real_logs;
mod recordings;
mod recovery;
mod regimes;
mod report;
mod robot_sheet;
mod rounded;
mod sets;
mod stored;
mod surroundings;
mod switches;
mod thinning;
mod together;
mod told;

mod unlike_columns;
mod unvisited;
mod worn;
