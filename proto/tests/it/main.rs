//! The wire contract from outside: what another implementation would rely on.

mod codec;
mod examples;
mod golden;
mod keys;
mod ranges;
mod wire_doc;
