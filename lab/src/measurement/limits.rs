//! What a log may be at most. Beyond it a source is refused, so that an endless or foreign input
//! cannot eat the memory.

use std::io::{self, BufRead, Read as _};

use super::{LogError, Table};

/// Bytes of one source.
pub const BYTES_MAX: u64 = 8 << 30;
/// Cells of one log, 8 bytes each.
pub(super) const CELLS_MAX: usize = 100_000_000;
/// Columns of one log.
pub(super) const COLUMNS_MAX: usize = 4096;
/// Bytes of one line of text.
const LINE_BYTES_MAX: u64 = 1 << 20;

/// The lines of a text, one in memory at a time.
pub(super) struct Lines<'a> {
    file: &'a str,
    input: &'a mut dyn BufRead,
    bytes: u64,
    line: u64,
    buffer: Vec<u8>,
    /// A line that is no UTF-8, as what it means in Latin-1; empty before there was one.
    latin: String,
}

/// One line of text.
pub(super) struct Line<'a> {
    /// Counted from 1.
    pub number: u64,
    /// Without its end.
    pub text: &'a str,
    /// Whether it ends as lines do. Only the last one may not, which was then perhaps cut off.
    pub whole: bool,
}

impl<'a> Lines<'a> {
    pub(super) fn of(file: &'a str, input: &'a mut dyn BufRead) -> Self {
        Lines { file, input, bytes: 0, line: 0, buffer: Vec::new(), latin: String::new() }
    }

    fn error(&self, message: impl Into<String>) -> LogError {
        LogError::Row { file: self.file.to_owned(), line: self.line, message: message.into() }
    }

    /// Whether a line was no UTF-8. What else it may be, cyclers write Latin-1, in which every byte is a letter.
    pub(super) fn is_latin(&self) -> bool {
        !self.latin.is_empty()
    }

    pub(super) fn next(&mut self) -> Result<Option<Line<'_>>, LogError> {
        self.buffer.clear();
        self.line += 1;
        let read = (&mut *self.input).take(LINE_BYTES_MAX + 1).read_until(b'\n', &mut self.buffer);
        self.bytes += read.map_err(|error| read_error(self.file, &error))? as u64;
        if self.buffer.is_empty() {
            return Ok(None);
        }
        check_bytes(self.file, self.bytes)?;
        let whole = self.buffer.last() == Some(&b'\n');
        if !whole && self.buffer.len() as u64 > LINE_BYTES_MAX {
            return Err(self.error(format!("the line is longer than {LINE_BYTES_MAX} bytes; this is not a log")));
        }
        let mut bytes = self.buffer.as_slice();
        if self.line == 1 {
            if let Some(what) = foreign(bytes) {
                return Err(self.error(what));
            }
            bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        }
        let bytes = bytes.strip_suffix(b"\n").unwrap_or(bytes);
        let bytes = bytes.strip_suffix(b"\r").unwrap_or(bytes);
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text,
            // A last line may be cut off within a letter.
            Err(error) if !whole && error.error_len().is_none() => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
            Err(_) => {
                self.latin = bytes.iter().map(|&byte| char::from(byte)).collect();
                &self.latin
            }
        };
        match text {
            text if text.contains('\r') => Err(self.error("lines end with a carriage return only; save the log with line feeds")),
            text if text.contains('\0') => Err(self.error("holds zero bytes, so it is not text")),
            text => Ok(Some(Line { number: self.line, text, whole })),
        }
    }
}

/// Other formats that come under the name of a text.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    let known: [(&[u8], &str); 4] = [
        (b"\xff\xfe", "is UTF-16; save the log as UTF-8 text"),
        (b"\xfe\xff", "is UTF-16; save the log as UTF-8 text"),
        (b"\x1f\x8b", "is compressed with gzip; unpack it first"),
        (b"PK\x03\x04", "is a ZIP archive or a spreadsheet; unpack it, or export it as CSV"),
    ];
    known.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, what)| *what)
}

/// Refuses a source that has become too long.
pub(super) fn check_bytes(file: &str, bytes: u64) -> Result<(), LogError> {
    if bytes <= BYTES_MAX {
        return Ok(());
    }
    let message = format!("is longer than {} GiB, the most that is read as one log; cut it, or thin it out", BYTES_MAX >> 30);
    Err(LogError::Whole { file: file.to_owned(), message })
}

/// Refuses a table that has become too large.
pub(super) fn check_cells(file: &str, table: &Table) -> Result<(), LogError> {
    if table.lines.len().saturating_mul(table.names.len().max(1)) <= CELLS_MAX {
        return Ok(());
    }
    let message = format!(
        "has more than {} rows of {} columns; a log may have {CELLS_MAX} cells: cut it, thin it out, or leave out columns",
        table.lines.len() - 1,
        table.names.len()
    );
    Err(LogError::Whole { file: file.to_owned(), message })
}

/// What the system reported while reading.
pub(super) fn read_error(file: &str, error: &io::Error) -> LogError {
    LogError::Whole { file: file.to_owned(), message: format!("cannot be read: {error}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first(bytes: &[u8]) -> Result<String, String> {
        let mut input = bytes;
        let mut lines = Lines::of("a.csv", &mut input);
        lines.next().map(|line| line.map_or_else(String::new, |line| line.text.to_owned())).map_err(|error| error.to_string())
    }

    #[test]
    fn lines_come_without_mark_and_end() {
        assert_eq!(first(b"\xef\xbb\xbfa,b\r\n1,2").unwrap(), "a,b");
        assert_eq!(first(b"").unwrap(), "");
    }

    #[test]
    fn what_is_not_a_text_is_named() {
        assert!(first(b"\x1f\x8b\x08").unwrap_err().contains("gzip"));
        assert!(first(b"\xff\xfet\0").unwrap_err().contains("UTF-16"));
        assert_eq!(first(b"a\xb0C\n").unwrap(), "a\u{b0}C");
        assert!(first(b"a\0\n").unwrap_err().contains("zero bytes"));
        assert!(first(b"a,b\r1,2\r").unwrap_err().contains("carriage return"));
    }

    #[test]
    fn an_endless_line_is_refused_before_it_fills_the_memory() {
        let mut input = io::BufReader::new(io::repeat(b'7'));
        let error = Lines::of("a.csv", &mut input).next().err().unwrap().to_string();
        assert!(error.contains("longer than 1048576 bytes"), "{error}");
    }
}
