//! The bits of the random numbers on standard output, for batteries of tests that read a stream.
//!
//! `cargo run --release --example random_stream -- --bytes 4e9 | dieharder -a -g 200`, or `… | RNG_test stdin32` (PractRand). Each number has 53
//! random bits; of these 32 are written, the highest or the lowest. `--way` says along which of its arguments the generator is walked.

use std::io::{BufWriter, ErrorKind, Write, stdout};

use clap::{Parser, ValueEnum};
use vdf::render::Sampler;

/// Writes random bits to standard output.
#[derive(Parser)]
struct Arguments {
    /// How many bytes to write; without it, until the pipe is closed.
    #[arg(long)]
    bytes: Option<f64>,
    /// What changes from number to number.
    #[arg(long, value_enum, default_value_t = Way::Film)]
    way: Way,
    /// Which 32 of the 53 bits.
    #[arg(long, value_enum, default_value_t = Bits::High)]
    bits: Bits,
    /// The seed, where that is not what changes.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

#[derive(Clone, Copy, ValueEnum)]
enum Way {
    /// Eight dimensions of four samples of each pixel of films of 2¹⁶ columns, as a renderer takes them.
    Film,
    /// The dimensions of one sample.
    Dimensions,
    /// The first number of each column.
    Columns,
    /// The first number of each row.
    Rows,
    /// The first number of each sample of one pixel.
    Samples,
    /// The first number of each seed.
    Seeds,
}

#[derive(Clone, Copy, ValueEnum)]
enum Bits {
    High,
    Low,
}

fn main() -> anyhow::Result<()> {
    let Arguments { bytes, way, bits, seed } = Arguments::parse();
    let numbers: Box<dyn Iterator<Item = f64>> = match way {
        Way::Film => Box::new((0_u64..).flat_map(move |i| {
            let (pixel, sample) = (i / 4, (i % 4) as u32);
            let mut sampler = Sampler::new(seed, (pixel % 65_536) as u32, (pixel / 65_536) as u32, sample);
            std::array::from_fn::<_, 8, _>(|_| sampler.next_1d())
        })),
        Way::Dimensions => {
            let mut sampler = Sampler::new(seed, 0, 0, 0);
            Box::new(std::iter::repeat_with(move || sampler.next_1d()))
        }
        // Behind the last of 2³² the next row or column goes on.
        Way::Columns => Box::new((0_u64..).map(move |i| Sampler::new(seed, i as u32, (i >> 32) as u32, 0).next_1d())),
        Way::Rows => Box::new((0_u64..).map(move |i| Sampler::new(seed, (i >> 32) as u32, i as u32, 0).next_1d())),
        Way::Samples => Box::new((0_u64..).map(move |i| Sampler::new(seed, (i >> 32) as u32, 0, i as u32).next_1d())),
        Way::Seeds => Box::new((0_u64..).map(|i| Sampler::new(i, 0, 0, 0).next_1d())),
    };
    let words = bytes.map_or(usize::MAX, |b| (b / 4.0) as usize);
    let mut out = BufWriter::with_capacity(1 << 16, stdout().lock());
    for x in numbers.take(words) {
        let x = (x * 9_007_199_254_740_992.0) as u64;
        let word = match bits {
            Bits::High => (x >> 21) as u32,
            Bits::Low => x as u32,
        };
        match out.write_all(&word.to_le_bytes()) {
            // The reader has enough.
            Err(e) if e.kind() == ErrorKind::BrokenPipe => return Ok(()),
            result => result?,
        }
    }
    Ok(())
}
