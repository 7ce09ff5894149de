//! What people and programs read: terminal tables and JSON structures.

pub mod addition;
pub mod comparison;
pub mod discovery;
pub mod drive;
pub mod effects;
pub mod first;
pub mod fitted;
pub mod html;
pub mod prediction;
pub mod proposal;
pub mod quantity;
pub mod table;
