//! What can go wrong.

/// Why a scene cannot be traced.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TracerError {
    /// The scene contradicts itself; the message says where and what was expected.
    #[error("invalid scene: {0}")]
    Invalid(String),
    /// The scene or the settings are beyond what the tracer can do; the message says what and the limit.
    #[error("unsupported: {0}")]
    Unsupported(String),
}
