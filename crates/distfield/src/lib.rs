//! Distance fields.
