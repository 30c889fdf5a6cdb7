//! The number of values in a JSON text, counted before it is parsed, since two bytes of text can take a hundred bytes
//! of memory.

/// The number of values in a text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JsonSize {
    /// Commas and colons outside strings.
    pub(crate) values: usize,
    /// Lists and objects.
    pub(crate) containers: usize,
}

impl JsonSize {
    /// Counts the values of the text, which need not be valid.
    pub(crate) fn of(text: &[u8]) -> Self {
        let (mut size, mut in_text, mut escaped) = (Self::default(), false, false);
        for byte in text {
            if in_text {
                in_text = escaped || *byte != b'"';
                escaped = !escaped && *byte == b'\\';
                continue;
            }
            match byte {
                b'"' => in_text = true,
                b',' | b':' => size.values += 1,
                b'[' | b'{' => size.containers += 1,
                _ => {}
            }
        }
        size
    }
}
