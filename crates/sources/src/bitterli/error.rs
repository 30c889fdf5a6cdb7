//! Errors of the reader of Mitsuba XML.

/// Why XML is not a Mitsuba scene, has no usable camera, or exceeds a limit.
#[derive(Debug, thiserror::Error)]
pub enum BitterliError {
    /// The text is not well-formed XML.
    #[error("expected well-formed XML: {reason}")]
    NotXml {
        /// The parser's reason.
        reason: roxmltree::Error,
    },
    /// Elements are nested too deeply.
    #[error("line {line}: expected elements nested at most {most} deep, found deeper ones")]
    TooDeep {
        /// The line.
        line: usize,
        /// The greatest depth allowed.
        most: usize,
    },
    /// Substituting variables makes the text too large.
    #[error("line {line}: the scene with its variables substituted is too large")]
    TooLarge {
        /// The line.
        line: usize,
    },
    /// The root element is not `<scene>`.
    #[error("expected a Mitsuba scene, whose root element is <scene>, found <{found}>")]
    NotAScene {
        /// The root element's tag.
        found: String,
    },
    /// The scene has no sensor.
    #[error("expected a <sensor>, found none")]
    NoSensor,
    /// The sensor is not a perspective camera.
    #[error("line {line}: the sensor '{kind}' is not supported; expected 'perspective' (a pinhole camera)")]
    OtherSensor {
        /// The sensor's line.
        line: usize,
        /// Its type.
        kind: String,
    },
    /// An included file cannot be read.
    #[error("line {line}: <include>: {reason}")]
    Include {
        /// The element's line.
        line: usize,
        /// Why not.
        reason: String,
    },
    /// The sensor's focal length is not a positive number of millimetres.
    #[error("line {line}: focal_length of the sensor: {reason}")]
    FocalLength {
        /// The sensor's line.
        line: usize,
        /// What was expected and what was found.
        reason: ValueError,
    },
    /// The sensor's transform cannot be read.
    #[error("line {line}: expected a readable to_world of the sensor, found one with a faulty step")]
    SensorTransform {
        /// The sensor's line.
        line: usize,
    },
    /// The sensor's transform is singular.
    #[error("line {line}: expected an invertible to_world of the sensor, found a singular one")]
    SingularSensor {
        /// The sensor's line.
        line: usize,
    },
}

/// Why the text of a parameter is not the value that is wanted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    /// It is not a finite number.
    #[error("expected a finite number, found '{found}'")]
    NotANumber {
        /// The beginning of the text.
        found: String,
    },
    /// It is a number out of range.
    #[error("expected {least} to {most}, found {found}")]
    OutOfRange {
        /// The least number allowed.
        least: f64,
        /// The greatest number allowed.
        most: f64,
        /// The number.
        found: f64,
    },
    /// It is not a positive number.
    #[error("expected a number above 0, found {found}")]
    NotPositive {
        /// The number.
        found: f64,
    },
    /// It is a list of another length.
    #[error("expected {expected} numbers, found {found}")]
    Count {
        /// The lengths allowed, as in `1 or 3`.
        expected: &'static str,
        /// The length of the list.
        found: usize,
    },
    /// It is a longer list than any value has.
    #[error("expected at most {most} numbers, found more")]
    TooManyNumbers {
        /// The greatest length allowed.
        most: usize,
    },
    /// It is neither `true` nor `false`.
    #[error("expected true or false, found '{found}'")]
    NotABoolean {
        /// The beginning of the text.
        found: String,
    },
    /// It is not a hexadecimal colour.
    #[error("expected # and six hexadecimal digits, found '{found}'")]
    NotHex {
        /// The beginning of the text.
        found: String,
    },
    /// It is not a pair of a wavelength and a value.
    #[error("expected wavelength:value, found '{found}'")]
    NotAPair {
        /// The beginning of the text.
        found: String,
    },
    /// Its pairs are not those of a spectrum.
    #[error("expected two or more wavelengths, each above the one before")]
    NotASpectrum,
    /// A parameter of the spectrum is missing.
    #[error("expected '{name}', found none")]
    Missing {
        /// The parameter.
        name: &'static str,
    },
    /// The file of the spectrum cannot be read.
    #[error("{reason}")]
    File {
        /// Why not.
        reason: String,
    },
    /// The element is the emission of a black body, where a reflectance is wanted.
    #[error("expected a reflectance, found the emission of a black body")]
    NotAReflectance,
    /// The element does not describe a colour.
    #[error("expected a colour, found <{found}>")]
    NotAColor {
        /// The element's tag.
        found: String,
    },
}
