//! What people and programs read: terminal tables and JSON structures.

pub mod comparison;
pub mod effects;
pub mod fitted;
pub mod html;
pub mod prediction;
pub mod proposal;
pub mod quantity;
pub mod table;
