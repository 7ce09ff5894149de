//! A bus of Linux (`/dev/i2c-N`) as the traits of `embedded-hal` want it.

use std::path::Path;

use embedded_hal::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use i2cdev::core::{I2CMessage as _, I2CTransfer as _};
use i2cdev::linux::{LinuxI2CBus, LinuxI2CError, LinuxI2CMessage};

/// A bus.
pub(super) struct LinuxBus(LinuxI2CBus);

impl LinuxBus {
    pub(super) fn open(path: &Path) -> Result<Self, LinuxI2CError> {
        LinuxI2CBus::new(path).map(Self)
    }
}

/// What the kernel says.
#[derive(Debug)]
pub(super) struct BusError(LinuxI2CError);

impl std::fmt::Display for BusError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.fmt(f)
    }
}

impl embedded_hal::i2c::Error for BusError {
    fn kind(&self) -> ErrorKind {
        // Documentation/i2c/fault-codes: nobody has answered the address.
        const ENXIO: i32 = 6;
        const EREMOTEIO: i32 = 121;
        match &self.0 {
            LinuxI2CError::Errno(ENXIO | EREMOTEIO) => ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address),
            LinuxI2CError::Io(error) if matches!(error.raw_os_error(), Some(ENXIO | EREMOTEIO)) => {
                ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address)
            }
            _ => ErrorKind::Other,
        }
    }
}

impl ErrorType for LinuxBus {
    type Error = BusError;
}

impl I2c for LinuxBus {
    /// One transfer with repeated starts, as the trait demands it.
    fn transaction(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), Self::Error> {
        let mut messages: Vec<LinuxI2CMessage<'_>> = operations
            .iter_mut()
            .map(|operation| match operation {
                Operation::Read(bytes) => LinuxI2CMessage::read(bytes),
                Operation::Write(bytes) => LinuxI2CMessage::write(bytes),
            })
            .map(|message| message.with_address(u16::from(address)))
            .collect();
        self.0.transfer(&mut messages).map(|_| ()).map_err(BusError)
    }
}
