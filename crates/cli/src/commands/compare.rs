//! `vdf compare`.

use std::io::Write as _;

use vdf_render::{RenderError, compare, read_exr};

use crate::{args::CompareArgs, failure::Failure};

pub(crate) fn run(args: &CompareArgs) -> Result<(), Failure> {
    let a = read_exr(&args.a).map_err(RenderError::from)?;
    let b = read_exr(&args.b).map_err(RenderError::from)?;
    let c = compare(&a, &b)?;
    let identical = if c.identical { "yes" } else { "no" };
    writeln!(std::io::stdout(), "mse: {:e}\nrelmse: {:e}\nidentical: {identical}", c.mse, c.rel_mse)?;
    Ok(())
}
