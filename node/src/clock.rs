//! The clock of a process: real time, or real time made faster for a demonstration.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use proto::Timestamp;
use serde::{Deserialize, Serialize};

/// `[clock]` in a configuration: processes of one fleet share it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockConfig {
    /// Seconds of fleet time per real second; 1 for real robots.
    pub speed: f64,
    /// Instant at which fleet time and real time agree, Unix milliseconds.
    pub origin_unix_ms: i64,
}

impl ClockConfig {
    /// Checks that time passes, forwards and not beyond what can be counted.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        anyhow::ensure!(
            (SPEED_MIN..=SPEED_MAX).contains(&self.speed),
            "clock.speed = {}: must be between {SPEED_MIN} and {SPEED_MAX}",
            self.speed
        );
        Ok(())
    }
}

/// Slowest and fastest fleet time.
const SPEED_MIN: f64 = 0.01;
const SPEED_MAX: f64 = 10_000.0;

/// Tells fleet time.
#[derive(Debug, Clone, Copy)]
pub struct Clock {
    config: ClockConfig,
}

impl Clock {
    /// A clock as configured; real time when nothing is said.
    #[must_use]
    pub fn new(config: Option<ClockConfig>) -> Self {
        Self { config: config.unwrap_or(ClockConfig { speed: 1.0, origin_unix_ms: 0 }) }
    }

    /// Fleet time now.
    #[must_use]
    pub fn now(&self) -> Timestamp {
        self.at(unix_ms())
    }

    fn at(&self, unix_ms: i64) -> Timestamp {
        let ClockConfig { speed, origin_unix_ms } = self.config;
        let since_ms = (unix_ms - origin_unix_ms) as f64 * speed;
        Timestamp::from_unix_ms(origin_unix_ms + since_ms.round() as i64)
    }

    /// Seconds of fleet time that pass during so much real time.
    #[must_use]
    pub fn fleet_s(&self, real: Duration) -> f64 {
        real.as_secs_f64() * self.config.speed
    }

    /// Real time that passes during `fleet_s` seconds of fleet time.
    #[must_use]
    pub fn real(&self, fleet_s: f64) -> Duration {
        Duration::from_secs_f64((fleet_s / self.config.speed).max(0.0))
    }
}

/// Real time, Unix milliseconds.
#[must_use]
#[allow(clippy::disallowed_methods, reason = "this is the shell's clock")]
pub fn unix_ms() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |elapsed| elapsed.as_millis() as i64)
}

/// Time since some instant before this process began, by a clock that nobody sets and that does not stop while the machine sleeps.
#[must_use]
pub fn uptime() -> Duration {
    #[cfg(target_os = "linux")]
    let id = rustix::time::ClockId::Boottime;
    #[cfg(not(target_os = "linux"))]
    let id = rustix::time::ClockId::Monotonic;
    let rustix::time::Timespec { tv_sec, tv_nsec } = rustix::time::clock_gettime(id);
    Duration::new(tv_sec.cast_unsigned(), tv_nsec as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_agrees_at_its_origin_and_runs_ahead_from_there() {
        let clock = Clock::new(Some(ClockConfig { speed: 60.0, origin_unix_ms: 10_000 }));
        assert_eq!(clock.at(10_000).unix_ms(), 10_000);
        assert_eq!(clock.at(11_000).unix_ms(), 70_000);
        assert_eq!(clock.real(60.0), Duration::from_secs(1));
    }
}
