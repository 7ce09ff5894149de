//! The benchmark itself is sound: cases are what they say, and the scorer punishes what is wrong.

mod generator;
