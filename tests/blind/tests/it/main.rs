//! The benchmark itself is sound: cases are what they say, and the scorer punishes what is wrong.
//! A small part of the cases is put to the lab as well.

mod generator;
mod names;
mod quick;
mod scorer;
mod stand_ins;
