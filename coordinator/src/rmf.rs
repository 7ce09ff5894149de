//! A fleet of Open-RMF as a scenario of ours: its fleet configuration, and its navigation graph where
//! there is one, become a scenario file and the models that it names.
//!
//! ```text
//!   node.rs    a YAML text, asked for by path, every answer checked
//!   fleet.rs   the fleet configuration: battery, mechanics, power, limits, robots
//!   graph.rs   the navigation graph: chargers, and how far it is to them
//!   write.rs   scenario and models, with where each number came from and what was assumed
//! ```

mod fleet;
mod graph;
mod node;
mod write;

pub use fleet::Fleet;
pub use graph::Graph;
pub use write::{Import, Wishes, import};

#[cfg(test)]
mod tests;
