//! Messages to bytes and back: one JSON object whose first field names the schema.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::message::MessageError;
use crate::plain::{plain, plain_json};

/// Longest message that is decoded, in bytes (16 MiB).
pub const MAX_MESSAGE_BYTES: usize = 16 * 1024 * 1024;

/// Something that travels on its own: it has a schema name and knows its allowed values.
pub trait Message: Serialize + DeserializeOwned {
    /// `tender.KIND/VERSION`, written as the field `schema`.
    const SCHEMA: &'static str;

    /// Checks that the values are within their ranges. [`decode`] always asks; senders
    /// may ask before they [`encode`].
    fn validate(&self) -> Result<(), MessageError> {
        Ok(())
    }
}

#[derive(Serialize)]
struct Envelope<'a, M> {
    schema: &'static str,
    #[serde(flatten)]
    body: &'a M,
}

impl<'a, M: Message> Envelope<'a, M> {
    fn around(body: &'a M) -> Self {
        Self { schema: M::SCHEMA, body }
    }
}

/// The message as compact JSON, `schema` first.
///
/// JSON has no NaN or infinity: such a number becomes `null`, which [`decode`] refuses.
/// Call [`Message::validate`] first where that can happen.
pub fn encode<M: Message>(message: &M) -> Vec<u8> {
    serde_json::to_vec(&Envelope::around(message)).expect("messages are objects with text keys, which JSON can always hold")
}

/// The same object as [`encode`] writes, indented for people.
pub fn encode_pretty<M: Message>(message: &M) -> String {
    serde_json::to_string_pretty(&Envelope::around(message)).expect("messages are objects with text keys, which JSON can always hold")
}

/// Why bytes are not the expected message.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CodecError {
    /// Longer than [`MAX_MESSAGE_BYTES`]; nothing of it was read.
    #[error("message of {bytes} bytes, allowed are at most {MAX_MESSAGE_BYTES}")]
    TooLong {
        /// Its length.
        bytes: usize,
    },
    /// Not a JSON object, or cut off.
    #[error("expected {expected} as a JSON object: {detail}")]
    NotJson {
        /// The schema asked for.
        expected: &'static str,
        /// What the parser objected to, with line and column.
        detail: String,
    },
    /// No text field `schema`.
    #[error("expected {expected}, but the object has no text field `schema`")]
    NoSchema {
        /// The schema asked for.
        expected: &'static str,
    },
    /// Another kind of message.
    #[error("expected {expected}, found `{found}`, which is another kind of message")]
    OtherKind {
        /// The schema asked for.
        expected: &'static str,
        /// The schema in the bytes.
        found: String,
    },
    /// The same kind of message in a version that this program does not speak.
    #[error("found `{found}`; the version supported here is {expected}")]
    OtherVersion {
        /// The schema asked for.
        expected: &'static str,
        /// The schema in the bytes.
        found: String,
    },
    /// A field is missing or of the wrong type.
    #[error("{schema}: {detail}")]
    Field {
        /// The schema of the message.
        schema: &'static str,
        /// Which field, what was found, what was expected, and where.
        detail: String,
    },
    /// A value is out of its range.
    #[error("{schema}: {source}")]
    Invalid {
        /// The schema of the message.
        schema: &'static str,
        /// Field, value and allowed range.
        source: MessageError,
    },
}

/// Reads one message of kind `M`; fields unknown to `M` are ignored, and control characters in its texts are given as their
/// escapes (`plain.rs`). Never panics.
pub fn decode<M: Message>(bytes: &[u8]) -> Result<M, CodecError> {
    if bytes.len() > MAX_MESSAGE_BYTES {
        return Err(CodecError::TooLong { bytes: bytes.len() });
    }
    let bytes = &plain_json(bytes);
    check_schema(bytes, M::SCHEMA)?;
    let message: M =
        serde_json::from_slice(bytes).map_err(|error| CodecError::Field { schema: M::SCHEMA, detail: field_detail(bytes, &error) })?;
    message.validate().map_err(|source| CodecError::Invalid { schema: M::SCHEMA, source })?;
    Ok(message)
}

/// Looks at the schema name alone, so that another version is refused as such and not by
/// whichever of its fields happens to differ.
fn check_schema(bytes: &[u8], expected: &'static str) -> Result<(), CodecError> {
    #[derive(Deserialize)]
    struct Header {
        schema: Option<serde_json::Value>,
    }
    let not_json = |detail: String| CodecError::NotJson { expected, detail };
    // serde would also take an array as a struct, field by field.
    match bytes.iter().find(|b| !b.is_ascii_whitespace()) {
        Some(b'{') => {}
        Some(_) => return Err(not_json("it does not start with `{`".to_owned())),
        None => return Err(not_json("it is empty".to_owned())),
    }
    let header: Header = serde_json::from_slice(bytes).map_err(|error| not_json(error.to_string()))?;
    let Some(serde_json::Value::String(mut found)) = header.schema else {
        return Err(CodecError::NoSchema { expected });
    };
    if found == expected {
        return Ok(());
    }
    let kind = |schema: &str| schema.split_once('/').map(|(kind, _)| kind.to_owned());
    let same_kind = kind(&found) == kind(expected);
    // A schema name of megabytes would otherwise end up in a log line.
    if let Some((end, _)) = found.char_indices().nth(80) {
        found.truncate(end);
    }
    Err(match same_kind {
        true => CodecError::OtherVersion { expected, found },
        false => CodecError::OtherKind { expected, found },
    })
}

/// The parser's words, the bytes just before the place it means, and a hint on `null`.
fn field_detail(bytes: &[u8], error: &serde_json::Error) -> String {
    let mut detail = error.to_string();
    // Our own encoder writes one line; for other layouts the column alone says too little.
    if error.line() == 1 && error.column() > 0 {
        let end = error.column().min(bytes.len());
        let near = &bytes[end.saturating_sub(48)..end];
        detail.push_str(&format!(", near `{}`", plain(&String::from_utf8_lossy(near))));
    }
    if detail.contains("invalid type: null") {
        detail.push_str(
            "; a number that is not finite has no JSON form and is written as null, \
             so the sender computed NaN or infinity",
        );
    }
    detail
}
