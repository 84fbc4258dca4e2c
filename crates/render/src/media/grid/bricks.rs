//! Which parts of a grid are empty, and how far around them all is.

use vdf_distfield::Ndf;
use vdf_voxel::{Resolution, Voxel, VoxelSet};

/// Cells along a side of a brick, as a power of two.
const LOG_SIDE: u32 = 3;

/// A chessboard distance field over the bricks of a grid.
#[derive(Debug)]
pub(super) struct Bricks {
    /// `None` if it is not asked: no brick is empty.
    field: Option<Ndf>,
    resolution: [i64; 3],
}

impl Bricks {
    /// No brick is known to be empty.
    pub(super) const fn none() -> Self {
        Self { field: None, resolution: [0; 3] }
    }

    /// Bricks over so many cells; `is_empty` says of a range of cells along each axis whether nothing is in them.
    pub(super) fn new(cells: [i64; 3], is_empty: impl Fn([[i64; 2]; 3]) -> bool + Sync) -> Self {
        let sides = cells.map(|n| ((n + 7) >> LOG_SIDE) as u32);
        let range = |axis: usize, brick: u32| {
            let begin = i64::from(brick) << LOG_SIDE;
            [begin, (begin + 8).min(cells[axis])]
        };
        let occupied = VoxelSet::from_rows(Resolution::new(sides[0], sides[1], sides[2]), |j, k, row| {
            for i in 0..sides[0] {
                if !is_empty([range(0, i), range(1, j), range(2, k)]) {
                    row[i as usize / 64] |= 1 << (i % 64);
                }
            }
        });
        let all = sides.iter().map(|&n| n as usize).product::<usize>();
        let field = (occupied.count() < all).then(|| Ndf::build(&occupied));
        Self { field, resolution: sides.map(i64::from) }
    }

    /// The cells, from the first to the last along each axis, of a cube of empty bricks around this cell; `None` if its own is not empty.
    #[inline]
    pub(super) fn empty_around(&self, cell: [i64; 3]) -> Option<[[i64; 2]; 3]> {
        let field = self.field.as_ref()?;
        let brick = cell.map(|c| c >> LOG_SIDE);
        let [i, j, k] = brick.map(|b| b as u32);
        let distance = i64::from(field.distance(Voxel::new(i, j, k)));
        if distance == 0 {
            return None;
        }
        Some(std::array::from_fn(|axis| {
            let (low, high) = (brick[axis] - distance + 1, brick[axis] + distance);
            let last = if high >= self.resolution[axis] { i64::MAX } else { (high << LOG_SIDE) - 1 };
            [low.max(0) << LOG_SIDE, last]
        }))
    }

    /// True if two neighbouring cells, the second entered in the direction of `step`, are in different bricks.
    #[inline]
    pub(super) fn is_entered(cell: i64, step: i64) -> bool {
        cell & 7 == if step > 0 { 0 } else { 7 }
    }
}
