//! Tests of the lab: measured logs against an independent calculation, recovery of known
//! parameters from synthetic logs, and the command line.

mod cli;
mod commands;
mod measured;
mod recovery;
mod regimes;
mod report;
mod sets;
