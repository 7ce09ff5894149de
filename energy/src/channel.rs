//! The quantities that systems and effects exchange, under their canonical names.

use std::ops::{Index, IndexMut};

use crate::real::Real;

macro_rules! channels {
    ($($(#[$doc:meta])* $variant:ident = $name:literal,)*) => {
        /// A quantity with a unit. The name is the column name in logs and the key in files.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum Channel { $($(#[$doc])* $variant,)* }

        impl Channel {
            /// Every channel, in a fixed order.
            pub const ALL: &'static [Channel] = &[$(Channel::$variant,)*];

            /// The canonical name, with its unit.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Channel::$variant => $name,)* }
            }
        }
    };
}

channels! {
    // Battery: at the pack's terminals.
    /// Current out of the pack, A (charging is negative).
    CurrentA = "current_a",
    /// Terminal voltage, V.
    VoltageV = "voltage_v",
    /// Cell temperature, °C.
    TemperatureDegc = "temperature_degc",
    /// Temperature of the surroundings, °C.
    AmbientDegc = "ambient_degc",
    /// Power: out of a pack, or drawn by a robot from its pack, W.
    PowerW = "power_w",
    /// State of charge, 0..1.
    Soc = "soc",
    /// Full cycles that the battery has seen.
    CycleCount = "cycle_count",
    /// Days since the battery was made.
    AgeDays = "age_days",
    /// How the charge at the start was reached: 1 by discharge, -1 by charge, 0 when not known.
    History = "history",
    /// Current that truly flows at the terminals, whatever its sensor shows, A.
    TerminalCurrentA = "terminal_current_a",
    /// Voltage that is truly at the terminals, whatever its sensor shows, V.
    TerminalVoltageV = "terminal_voltage_v",
    /// Voltage of the cell with the lowest, V.
    CellMinV = "cell_min_v",
    /// Voltage of the cell with the highest, V.
    CellMaxV = "cell_max_v",
    // Battery: inside one cell.
    /// Charge that a full pack holds now, Ah.
    CapacityAh = "capacity_ah",
    /// Current through one cell, with losses that never reach the terminals, A.
    CellCurrentA = "cell_current_a",
    /// Charge lost inside one cell per time, A: it drains the cell without passing its resistances.
    LostCurrentA = "lost_current_a",
    /// Share of the cell's charge that one ampere moves in this step, 1/A.
    SocPerA = "soc_per_a",
    /// Voltage of one cell, V: the mean of a series string.
    CellVoltageV = "cell_voltage_v",
    /// Temperature inside the cell, °C.
    CellDegc = "cell_degc",
    /// Open-circuit voltage of one cell, V.
    OcvV = "ocv_v",
    /// Change of a cell's equilibrium voltage with its temperature, V/K: also makes reversible heat.
    EntropyVPerK = "entropy_v_per_k",
    /// Sum of all voltage drops inside one cell, V (Kottas, Eq. C.1, taken under load).
    OverpotentialV = "overpotential_v",
    /// Heat made in one cell, W.
    HeatW = "heat_w",
    // Robot.
    /// Speed over ground, m/s.
    SpeedMps = "speed_mps",
    /// Acceleration along the path, m/s².
    AccelMps2 = "accel_mps2",
    /// Slope of the ground along the path, uphill positive, rad.
    PitchRad = "pitch_rad",
    /// Load carried, kg.
    PayloadKg = "payload_kg",
    /// Turn rate, anticlockwise positive, rad/s.
    YawRateRadps = "yaw_rate_radps",
    /// Clock of the computer, MHz.
    CpuMhz = "cpu_mhz",
    /// Share of time that the computer works, 0..1.
    CpuUtil = "cpu_util",
    /// Power that the radio sends with, dBm.
    RadioTxDbm = "radio_tx_dbm",
    /// Share of time that the radio sends, 0..1.
    RadioDuty = "radio_duty",
    /// 1 while the camera runs, else 0.
    CameraOn = "camera_on",
    /// Angle of the actuated tail, rad.
    TailAngleRad = "tail_angle_rad",
    /// Class of the floor: 0 is the one that the other numbers were stated for.
    FloorClass = "floor_class",
    /// Force that the wheels give along the path, N: found by the effects of motion.
    TractionN = "traction_n",
    /// Loss in the windings of the drive motors, W: found by the effects of motion.
    CopperW = "copper_w",
    // Station.
    /// Power into the batteries of all robots that charge here, W.
    ChargePowerW = "charge_power_w",
    /// Robots that are connected to a powered bay.
    RobotsDocked = "robots_docked",
    /// Robots whose batteries take charge.
    RobotsCharging = "robots_charging",
    /// Sum of the squares of all bay currents, A².
    BaySquaredCurrentA2 = "bay_squared_current_a2",
    /// Times that the selector switched to another pack during the step.
    SelectorEvents = "selector_events",
    /// Movements of the lift under way: 1 while it moves, else 0; the exchange of a robot's pack is one.
    LiftActive = "lift_active",
    /// Current out of the station's active pack, A.
    PackCurrentA = "pack_current_a",
    /// Voltage of the station's active pack, V.
    PackVoltageV = "pack_voltage_v",
    /// Power out of the station's active pack, W.
    PackPowerW = "pack_power_w",
    // Battery: what few models use, behind what every step of a cell touches.
    /// SoC of the table at which the cell, as it is now, is empty.
    OcvShiftEmpty = "ocv_shift_empty",
    /// SoC of the table, less 1, at which the cell, as it is now, is full.
    OcvShiftFull = "ocv_shift_full",
    /// Natural logarithm of how many times longer a cell's relaxations take than at the reference temperature.
    LogRelaxationTime = "log_relaxation_time",
}

impl Channel {
    /// How many channels there are.
    pub const COUNT: usize = Channel::ALL.len();

    /// The channel of that canonical name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Channel> {
        Channel::ALL.iter().copied().find(|channel| channel.name() == name)
    }
}

/// The value of every channel at one moment.
#[derive(Debug, Clone, Copy)]
pub struct Channels<S>([S; Channel::COUNT]);

impl<S: Copy> Channels<S> {
    /// All channels at the same value.
    pub fn filled(value: S) -> Self {
        Self([value; Channel::COUNT])
    }
}

impl<S: Real> Channels<S> {
    /// Adds a share to a channel.
    #[inline]
    pub fn add(&mut self, channel: Channel, share: S) {
        self.0[channel as usize] += share;
    }
}

impl<S> Index<Channel> for Channels<S> {
    type Output = S;
    #[inline]
    fn index(&self, channel: Channel) -> &S {
        &self.0[channel as usize]
    }
}

impl<S> IndexMut<Channel> for Channels<S> {
    #[inline]
    fn index_mut(&mut self, channel: Channel) -> &mut S {
        &mut self.0[channel as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_channel_is_found_by_its_name() {
        for &channel in Channel::ALL {
            assert_eq!(Channel::from_name(channel.name()), Some(channel));
        }
        assert_eq!(Channel::from_name("voltage"), None);
    }
}
