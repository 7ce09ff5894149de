//! What the planner promises, looked at from outside.

mod any;
mod checker;
mod costs;
mod degenerate;
mod mending;
mod promises;
mod proofs;
mod quality;
mod reasons;
