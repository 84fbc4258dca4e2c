//! Showing the picture while it is rendered, in tev or whoever speaks its protocol.
//!
//! A message is its length (u32, with these four bytes), an operation (u8) and its operands; all little-endian, strings end with a zero.

use std::{
    io::{self, Write as _},
    net::{TcpStream, ToSocketAddrs as _},
    sync::{Mutex, PoisonError},
    time::Duration,
};

use vdf_image::Image;

use crate::failure::say;

/// A viewer that does not read for so long is given up.
const PATIENCE: Duration = Duration::from_secs(5);
const CREATE: u8 = 4;
const UPDATE: u8 = 6;
const CHANNELS: [&str; 3] = ["R", "G", "B"];
/// Pixels of one message: some megabytes.
const PIXELS_PER_MESSAGE: u32 = 1 << 18;

/// A viewer, as long as it listens.
pub(super) struct Display {
    address: String,
    name: String,
    viewer: Mutex<Option<Viewer>>,
}

struct Viewer {
    stream: TcpStream,
    /// Whether it knows the picture.
    created: bool,
}

impl Display {
    /// A viewer at `address`. If there is none, that is told, and nothing is shown.
    pub(super) fn new(address: &str, name: &str) -> Self {
        let viewer = connect(address).map_err(|e| gone(address, &e)).ok();
        let viewer = Mutex::new(viewer.map(|stream| Viewer { stream, created: false }));
        Self { address: address.to_owned(), name: name.to_owned(), viewer }
    }

    /// Shows the picture. A viewer that has gone away is told of once.
    pub(super) fn show(&self, image: &Image) {
        let mut viewer = self.viewer.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = &mut *viewer
            && let Err(error) = at.show(&self.name, image)
        {
            gone(&self.address, &error);
            *viewer = None;
        }
    }
}

fn gone(address: &str, error: &io::Error) {
    say(format_args!("warning: --display {address}: {error}; the render goes on without it"));
}

fn connect(address: &str) -> io::Result<TcpStream> {
    let first = address.to_socket_addrs()?.next().ok_or(io::ErrorKind::AddrNotAvailable)?;
    let stream = TcpStream::connect_timeout(&first, PATIENCE)?;
    stream.set_write_timeout(Some(PATIENCE))?;
    Ok(stream)
}

impl Viewer {
    fn show(&mut self, name: &str, image: &Image) -> io::Result<()> {
        if !self.created {
            self.stream.write_all(&create(name, image))?;
            self.created = true;
        }
        let rows = (PIXELS_PER_MESSAGE / image.width).max(1);
        let mut y = 0;
        while y < image.height {
            let height = rows.min(image.height - y);
            self.stream.write_all(&update(name, image, y, height))?;
            y += height;
        }
        Ok(())
    }
}

/// The message, once its operands are known.
fn message(operation: u8, operands: &[u8]) -> Vec<u8> {
    let length = operands.len() as u32 + 5;
    [&length.to_le_bytes()[..], &[operation], operands].concat()
}

/// Whether to bring the window to the front, and the name.
fn start(name: &str) -> Vec<u8> {
    // A zero would end the name.
    let name: Vec<u8> = name.bytes().filter(|&b| b != 0).collect();
    [&[0][..], &name, &[0]].concat()
}

fn integers(numbers: &[u32], out: &mut Vec<u8>) {
    out.extend(numbers.iter().flat_map(|n| n.to_le_bytes()));
}

fn named_channels(out: &mut Vec<u8>) {
    out.extend((CHANNELS.len() as u32).to_le_bytes());
    CHANNELS.iter().for_each(|name| out.extend(name.bytes().chain([0])));
}

fn create(name: &str, image: &Image) -> Vec<u8> {
    let mut operands = start(name);
    integers(&[image.width, image.height], &mut operands);
    named_channels(&mut operands);
    message(CREATE, &operands)
}

/// Some rows of the picture.
fn update(name: &str, image: &Image, y: u32, height: u32) -> Vec<u8> {
    let mut operands = start(name);
    named_channels(&mut operands);
    integers(&[0, y, image.width, height], &mut operands);
    // Where each channel begins, and how far apart its numbers are.
    operands.extend([0_u64, 1, 2, 3, 3, 3].into_iter().flat_map(u64::to_le_bytes));
    let pixels = image.pixels.iter().skip((y * image.width) as usize).take((height * image.width) as usize);
    operands.extend(pixels.flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes));
    message(UPDATE, &operands)
}
