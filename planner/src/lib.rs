//! Tender's planner.

mod bits;
pub mod book;
pub mod construct;
pub mod draft;
pub mod guide;
pub mod instance;
pub mod optimise;
pub mod prices;
pub mod problem;
pub mod search;
pub mod supply;
pub mod way;
