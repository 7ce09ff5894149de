//! The mechanical side of a robot: what its wheels need, and what that costs its battery.
//!
//! ```text
//!   kinematics.rs   wheel speeds <-> speed and yaw rate; kinetic energy
//!   traction.rs     the force at the wheels, and the power it draws
//!   motor.rs        brushed motor and gear at rest of change: current, voltage, efficiency
//!   transient.rs    the same motor in time: current and speed, stepped exactly
//!   bridge.rs       the H-bridge before it: duty, ripple, conduction loss, supply current
//!   sheet.rs        from data sheets of these to the parameters of effects
//!   caster.rs       the actuated tail: geometry, centre of gravity, holding torque
//!   explorer.rs     the numbers of one robot for all of these
//!   travel.rs       energy per metre, most economical speed, energy of a way home
//! ```
//!
//! These are functions without state. The robot's effects call `traction.rs` and, of `caster.rs`,
//! `relative_hold`; `travel.rs` steps a robot's whole model. The others say what follows from a motor's
//! data sheet and a robot's measures, and tests hold the effects to it. SI units throughout; a torque
//! or current that drives the robot forward is positive. Kottas, section 4.2, chapter 5 and
//! appendix A.1.

pub mod bridge;
pub mod caster;
pub mod explorer;
pub mod kinematics;
pub mod motor;
pub mod sheet;
pub mod traction;
pub mod transient;
pub mod travel;
