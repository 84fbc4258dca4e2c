//! Attributes in the header of an EXR.

use ::exr::prelude as openexr;

/// Longer names of attributes break other programs (Nuke).
pub(super) const LONGEST_ATTRIBUTE_NAME: usize = 31;

/// The value of an attribute in the header of an EXR.
#[derive(Clone, Debug, PartialEq)]
pub enum AttributeValue {
    /// Text.
    Text(String),
    /// A number in double precision.
    Float(f64),
    /// A whole number. EXR has 32 bits only: a larger one is written as decimal text.
    Integer(i64),
    /// A matrix that acts on row vectors, row by row: the columns of one that acts on column vectors.
    Matrix([f32; 16]),
}

impl From<&str> for AttributeValue {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

impl From<String> for AttributeValue {
    fn from(value: String) -> Self {
        Self::Text(value)
    }
}

impl From<f64> for AttributeValue {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}

impl From<i64> for AttributeValue {
    fn from(value: i64) -> Self {
        Self::Integer(value)
    }
}

impl From<AttributeValue> for openexr::AttributeValue {
    fn from(value: AttributeValue) -> Self {
        // EXR strings are UTF-8 by convention; the crate's checked constructors know ASCII only.
        let text = |text: &str| Self::Text(openexr::Text::from_bytes_unchecked(text.bytes().collect()));
        match value {
            AttributeValue::Text(value) => text(&value),
            AttributeValue::Float(value) => Self::F64(value),
            AttributeValue::Matrix(value) => Self::Matrix4x4(value),
            AttributeValue::Integer(value) => i32::try_from(value).map_or_else(|_| text(&value.to_string()), Self::I32),
        }
    }
}
