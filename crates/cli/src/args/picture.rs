//! How a picture is written.

use clap::{Args, ValueEnum};
use vdf_image::{ComponentFormat, Compression};

/// The options of the EXR.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "The EXR")]
pub(crate) struct PictureArgs {
    /// How the picture's numbers are stored [default: as the scene says]
    #[arg(long, value_enum, value_name = "FORMAT")]
    pub(crate) exr_format: Option<FormatName>,
    /// How the pixels are compressed, without loss
    #[arg(long, value_enum, value_name = "HOW", default_value_t = CompressionName::Zip)]
    pub(crate) exr_compression: CompressionName,
    /// Leave times, method and counters out of the EXR, so that the same render is the same file
    #[arg(long)]
    pub(crate) reproducible: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    /// 16 bits
    Half,
    /// 32 bits
    Float,
}

impl From<FormatName> for ComponentFormat {
    fn from(name: FormatName) -> Self {
        match name {
            FormatName::Half => Self::Half,
            FormatName::Float => Self::Float,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum CompressionName {
    Zip,
    Piz,
    Rle,
    None,
}

impl From<CompressionName> for Compression {
    fn from(name: CompressionName) -> Self {
        match name {
            CompressionName::Zip => Self::Zip,
            CompressionName::Piz => Self::Piz,
            CompressionName::Rle => Self::Rle,
            CompressionName::None => Self::Uncompressed,
        }
    }
}
