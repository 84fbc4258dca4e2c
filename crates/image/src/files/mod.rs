//! Files that appear whole or not at all, and which names mean the same file.

mod identity;
mod place;
mod shown;
mod staged;
mod temporaries;

pub use identity::{Conflict, check_distinct, same_file};
pub use shown::shown;
pub use staged::{PersistError, StagedFile, check_writable, write_atomically};
pub use temporaries::remove_temporaries;
