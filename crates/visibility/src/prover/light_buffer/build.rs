//! Building a light buffer: from the top, tile by tile.
//!
//! A tile of 64 × 64 texels gets the triangles whose bounds on the face meet it. It is divided in sixteen, down to texels; each part gets those of the
//! triangles that may meet its rectangle and are not certainly behind what covers it. A texel with a long list is divided
//! further, twice at most, where that makes the lists shorter.
//!
//! *Guarantee.* The result does not depend on the number of threads. *Cost.* About linear in the texels and in the triangles; while it
//! builds some 8 bytes a triangle and a megabyte a thread besides the result. Where thousands of triangles lie behind each other in every
//! direction lists would be without bound; then it stops at the limit of memory.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::DVec3;
use rayon::prelude::*;
use vdf_geometry::Triangle;

use super::{
    Entry, LightBuffer, Refusal, Tag, Texel,
    cone::Cone,
    frame::{DepthCode, Face, NEVER, Rect, TILE, Window},
    place::{self, Cube},
    record::Record,
    sheets,
    tables::Tables,
};

/// Texels of a tile.
pub(super) const TILE_TEXELS: usize = (TILE * TILE) as usize;

/// A list that is longer is divided, if that is possible.
const LONG: usize = 32;

/// A texel is divided at most so often.
const DIVISIONS: u32 = 1;

/// Along each side a square of texels is divided into so many, and so is a texel.
pub(super) const PARTS: u32 = 4;

/// The parts of a square.
const COUNT: usize = (PARTS * PARTS) as usize;

/// A light that is so many diagonals of the geometry away sees it in a few hundredths of a degree; single precision does not tell its
/// triangles apart any more.
const FARTHEST: f64 = 1000.0;

/// What all triangles together say.
#[derive(Clone, Copy)]
struct Extent {
    on_occluder: bool,
    nearest: f64,
    farthest: f64,
    /// For each face the bounds of all triangles on it.
    faces: [Option<[f64; 4]>; 6],
}

impl Extent {
    const NOTHING: Self = Self { on_occluder: false, nearest: f64::INFINITY, farthest: 0.0, faces: [None; 6] };

    fn with(mut self, triangle: &Triangle, light: DVec3) -> Self {
        let Some(cone) = Cone::new(triangle, light) else {
            self.on_occluder |= triangle.holds(light);
            return self;
        };
        self.nearest = self.nearest.min(cone.distance());
        let largest = |v: DVec3| v.abs().max_element();
        self.farthest = cone.vertices.iter().fold(self.farthest, |far, v| far.max(largest(*v)));
        for face in Face::ALL {
            if let Some(bounds) = cone.on(face).bounds() {
                let of_face = &mut self.faces[face.index()];
                *of_face = Some(of_face.map_or(bounds, |all| join(all, bounds)));
            }
        }
        self
    }

    fn and(self, other: Self) -> Self {
        let mut faces = self.faces;
        for (all, more) in faces.iter_mut().zip(other.faces) {
            *all = match (*all, more) {
                (Some(a), Some(b)) => Some(join(a, b)),
                (a, b) => a.or(b),
            };
        }
        Self {
            on_occluder: self.on_occluder | other.on_occluder,
            nearest: self.nearest.min(other.nearest),
            farthest: self.farthest.max(other.farthest),
            faces,
        }
    }
}

impl Extent {
    /// Whether geometry fills half of all directions or more.
    fn is_around(&self) -> bool {
        let area = |[u0, u1, v0, v1]: &[f64; 4]| (u1 - u0) * (v1 - v0);
        self.faces.iter().flatten().map(area).sum::<f64>() > 12.0
    }

    /// The windows of all faces, with so many texels along each side. Where geometry is all around they are whole faces, for the sake of quick look-ups.
    fn windows(&self, side: u32) -> [Window; 6] {
        let whole = self.is_around();
        let mut first = place::FIRST;
        self.faces.map(|bounds| {
            let window = match bounds {
                _ if whole => Window::whole(side, first),
                Some(bounds) => Window::new(bounds, side, first),
                None => return Window::NONE,
            };
            first += side * side;
            window
        })
    }
}

fn join(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [a[0].min(b[0]), a[1].max(b[1]), a[2].min(b[2]), a[3].max(b[3])]
}

/// What was built for one tile, its lists numbered from its own start.
struct Tile {
    texels: Vec<Texel>,
    parts: Vec<Texel>,
    entries: Vec<Entry>,
}

impl LightBuffer {
    /// Builds the buffer of a point light with `side` texels along each side of a face, a power of two of at least 64, which takes at most
    /// `max_bytes`. Runs on the current rayon pool.
    ///
    /// # Errors
    /// Why there is none.
    pub fn build(triangles: &[Triangle], light: DVec3, side: u32, max_bytes: u64) -> Result<Self, Refusal> {
        // Of what is no number nothing is known, and comparisons with it would be believed.
        if !(light.is_finite() && triangles.par_iter().all(Triangle::is_finite)) {
            return Err(Refusal::NotFinite);
        }
        // What is larger than this is refused.
        let side = side.min(1 << 20).next_power_of_two().max(TILE);
        let extent = triangles
            .par_iter()
            .with_min_len(1024)
            .fold(|| Extent::NOTHING, |extent, t| extent.with(t, light))
            .reduce(|| Extent::NOTHING, Extent::and);
        if extent.on_occluder {
            return Err(Refusal::OnOccluder);
        }
        // Nothing may cost more than its texels: faces are known now.
        let faces = if extent.is_around() { 6 } else { extent.faces.iter().flatten().count() as u64 };
        let texels = faces * u64::from(side) * u64::from(side);
        let bytes = texels * size_of::<Texel>() as u64;
        if bytes > max_bytes || texels > Tag::MOST as u64 || triangles.len() > Tag::MOST {
            return Err(Refusal::Memory);
        }
        let windows = extent.windows(side);
        let diagonal = vdf_geometry::Bounds::of_triangles(triangles).extent().length();
        if faces > 0 && extent.nearest > FARTHEST * diagonal {
            return Err(Refusal::FarAway);
        }
        if faces > 0 && !(1.0 / DepthCode::FARTHEST..DepthCode::FARTHEST).contains(&extent.farthest) {
            return Err(Refusal::Range);
        }
        let depths = DepthCode::new(extent.nearest.min(extent.farthest), extent.farthest);
        let bins = Bins::new(triangles, light, &windows);
        let spent = AtomicU64::new(bytes);
        let budget = Budget { spent: &spent, max_bytes };
        let tiles: Vec<Tile> = (0..bins.starts.len() - 1)
            .into_par_iter()
            .map_init(Vec::new, |scratch, tile| {
                let (face, x, y) = bins.tile(tile);
                TileBuilder {
                    window: &windows[face.index()],
                    depths: &depths,
                    cones: Vec::new(),
                    bounds: Vec::new(),
                    numbers: Vec::new(),
                    scratch,
                    out: Tile::new(),
                    budget,
                }
                .build(triangles, light, bins.of(tile), face, x, y)
            })
            .collect();
        if budget.exceeded() {
            return Err(Refusal::Memory);
        }
        let buffer = merge(triangles, Cube::new(light, &windows, depths, extent.farthest), &windows, &bins, tiles);
        if buffer.bytes() as u64 > max_bytes { Err(Refusal::Memory) } else { Ok(buffer) }
    }
}

/// The triangles of each tile.
struct Bins {
    /// For each tile where its triangles start; one more at the end.
    starts: Vec<u32>,
    triangles: Vec<u32>,
    /// The face of each group of tiles, which are rows of `tiles` each.
    faces: Vec<Face>,
    tiles: u32,
}

impl Bins {
    fn new(triangles: &[Triangle], light: DVec3, windows: &[Window; 6]) -> Self {
        let faces: Vec<_> = Face::ALL.into_iter().filter(|f| windows[f.index()].side() > 0).collect();
        let tiles = faces.first().map_or(0, |f| windows[f.index()].side() / TILE);
        let pairs: Vec<Vec<(u32, u32)>> = triangles
            .par_chunks(16_384)
            .enumerate()
            .map(|(chunk, some)| {
                let mut pairs = Vec::with_capacity(2 * some.len());
                for (number, triangle) in (chunk as u32 * 16_384..).zip(some) {
                    let Some(cone) = Cone::new(triangle, light) else { continue };
                    for (group, face) in (0..).zip(&faces) {
                        let cone = cone.on(*face);
                        let window = &windows[face.index()];
                        let Some(bounds) = cone.bounds() else { continue };
                        let [x0, x1, y0, y1] = window.tiles(bounds);
                        for (x, y) in (y0..=y1).flat_map(|y| (x0..=x1).map(move |x| (x, y))) {
                            let size = f64::from(TILE);
                            let rect = window.rect(f64::from(x) * size, f64::from(y) * size, size);
                            if (x0, y0) == (x1, y1) || cone.may_meet(&rect) {
                                pairs.push(((group * tiles + y) * tiles + x, number));
                            }
                        }
                    }
                }
                pairs
            })
            .collect();
        let count = faces.len() * (tiles * tiles) as usize;
        let mut starts = vec![0_u32; count + 1];
        for (tile, _) in pairs.iter().flatten() {
            starts[*tile as usize + 1] += 1;
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut sorted = vec![0; starts[count] as usize];
        for (tile, number) in pairs.iter().flatten() {
            let place = &mut next[*tile as usize];
            sorted[*place as usize] = *number;
            *place += 1;
        }
        Self { starts, triangles: sorted, faces, tiles }
    }

    fn of(&self, tile: usize) -> &[u32] {
        &self.triangles[self.starts[tile] as usize..self.starts[tile + 1] as usize]
    }

    /// The face of a tile, and its column and row.
    fn tile(&self, tile: usize) -> (Face, u32, u32) {
        let tiles = self.tiles as usize;
        let in_face = tile % (tiles * tiles);
        (self.faces[tile / (tiles * tiles)], (in_face % tiles) as u32, (in_face / tiles) as u32)
    }
}

/// A triangle that may be met in a rectangle.
#[derive(Clone, Copy)]
struct Candidate {
    cone: u32,
    /// Bounds of its depth there.
    near: f64,
    far: f64,
}

/// Builds one tile.
struct TileBuilder<'a> {
    window: &'a Window,
    depths: &'a DepthCode,
    /// Of the tile's triangles: in the axes of the face, their bounds there, their numbers.
    cones: Vec<Cone>,
    bounds: Vec<[f64; 4]>,
    numbers: Vec<u32>,
    /// Candidates of the rectangles that are being divided, the smallest last.
    scratch: &'a mut Vec<Candidate>,
    out: Tile,
    budget: Budget<'a>,
}

/// The memory that all tiles take together.
#[derive(Clone, Copy)]
struct Budget<'a> {
    spent: &'a AtomicU64,
    max_bytes: u64,
}

impl Budget<'_> {
    /// Takes so many bytes, of which there may be too few.
    fn spend(self, bytes: usize) {
        self.spent.fetch_add(bytes as u64, Ordering::Relaxed);
    }

    /// Whether more was taken than there is: then all that is built will be thrown away.
    fn exceeded(self) -> bool {
        self.spent.load(Ordering::Relaxed) > self.max_bytes
    }
}

impl Tile {
    const fn new() -> Self {
        Self { texels: Vec::new(), parts: Vec::new(), entries: Vec::new() }
    }
}

impl TileBuilder<'_> {
    fn build(mut self, triangles: &[Triangle], light: DVec3, numbers: &[u32], face: Face, x: u32, y: u32) -> Tile {
        self.out.texels = vec![Texel::EMPTY; TILE_TEXELS];
        for &number in numbers {
            if let Some(cone) = Cone::new(&triangles[number as usize], light).map(|c| c.on(face))
                && let Some(bounds) = cone.bounds()
            {
                self.cones.push(cone.with_keys());
                self.bounds.push(bounds);
                self.numbers.push(number);
            }
        }
        self.scratch.clear();
        self.scratch.extend((0..self.cones.len() as u32).map(|cone| Candidate { cone, near: 0.0, far: 0.0 }));
        self.divide(x * TILE, y * TILE, TILE, 0);
        self.out
    }

    /// Divides a square of texels whose candidates are those from `start`, in sixteen.
    fn divide(&mut self, x: u32, y: u32, size: u32, start: usize) {
        if self.budget.exceeded() {
            return;
        }
        let part = size / PARTS;
        let end = self.scratch.len();
        let starts = self.sort_into_parts(x, y, part, start);
        let sorted = self.scratch.len();
        for (i, of_part) in (0..).zip(starts.windows(2)) {
            let (x, y) = (x + i % PARTS * part, y + i / PARTS * part);
            let covered =
                self.choose(&self.window.rect(f64::from(x), f64::from(y), f64::from(part)), of_part[0], of_part[1]);
            if self.scratch.len() > sorted {
                if self.scratch.len() == sorted + 1 && covered < f64::INFINITY {
                    self.fill(x, y, part, self.scratch[sorted].cone);
                } else if part > 1 {
                    self.divide(x, y, part, sorted);
                } else {
                    let texel = self.texel(f64::from(x), f64::from(y), 1.0, 0, sorted, covered);
                    self.out.texels[place::in_tile(x, y)] = texel;
                }
            }
            self.scratch.truncate(sorted);
        }
        self.scratch.truncate(end);
    }

    /// Adds the candidates from `start` once more for each part of a square that their bounds meet, part by part: where those of each start,
    /// and their end.
    fn sort_into_parts(&mut self, x: u32, y: u32, part: u32, start: usize) -> [usize; COUNT + 1] {
        let end = self.scratch.len();
        let parts = |c: &Candidate| self.window.parts(&self.bounds[c.cone as usize], x, y, part);
        let mut next = [0; COUNT + 1];
        for candidate in &self.scratch[start..end] {
            parts(candidate).for_each(|i| next[i + 1] += 1);
        }
        next[0] = end;
        for i in 0..COUNT {
            next[i + 1] += next[i];
        }
        let starts = next;
        self.scratch.resize(starts[COUNT], Candidate { cone: 0, near: 0.0, far: 0.0 });
        for i in start..end {
            let candidate = self.scratch[i];
            for i in self.window.parts(&self.bounds[candidate.cone as usize], x, y, part) {
                self.scratch[next[i]] = candidate;
                next[i] += 1;
            }
        }
        starts
    }

    /// Fills a square of texels that one triangle covers, behind which nothing matters.
    fn fill(&mut self, x: u32, y: u32, size: u32, cone: u32) {
        let (cone, tag) = (&self.cones[cone as usize], Tag::cover(self.numbers[cone as usize]));
        for (x, y) in (y..y + size).flat_map(|y| (x..x + size).map(move |x| (x, y))) {
            if let Some([near, far]) = cone.depths(&self.window.rect(f64::from(x), f64::from(y), 1.0)) {
                self.out.texels[place::in_tile(x, y)] =
                    Texel::new(self.depths.lower(near), self.depths.upper(far), tag);
            }
        }
    }

    /// Puts those of the candidates in `start..end` that may decide something in the rectangle behind them, and says beyond which depth it
    /// is covered.
    fn choose(&mut self, rect: &Rect, start: usize, end: usize) -> f64 {
        let first = self.scratch.len();
        let mut covered = f64::INFINITY;
        let (u0, u1) = (rect.u - rect.half_u, rect.u + rect.half_u);
        let (v0, v1) = (rect.v - rect.half_v, rect.v + rect.half_v);
        for i in start..end {
            let number = self.scratch[i].cone;
            let bounds = &self.bounds[number as usize];
            if bounds[0] > u1 || bounds[1] < u0 || bounds[2] > v1 || bounds[3] < v0 {
                continue;
            }
            let cone = &self.cones[number as usize];
            if !cone.may_meet(rect) {
                continue;
            }
            let Some([near, far]) = cone.depths(rect) else { continue };
            if near > covered {
                continue;
            }
            if far < covered && cone.covers(rect) {
                covered = far;
            }
            self.scratch.push(Candidate { cone: number, near, far });
        }
        self.drop_behind(first, covered);
        let members = self.scratch.len() - first;
        if (2..=sheets::MOST).contains(&members) {
            let cones = &self.cones;
            let sheet = self.scratch[first..].iter().map(|c| (&cones[c.cone as usize], c.far));
            let beyond = sheets::covered_beyond(sheet, rect);
            if beyond < covered {
                covered = beyond;
                self.drop_behind(first, covered);
            }
        }
        covered
    }

    /// Drops the candidates from `start` that are behind what covers their rectangle.
    fn drop_behind(&mut self, start: usize, covered: f64) {
        let mut kept = start;
        for i in start..self.scratch.len() {
            let candidate = self.scratch[i];
            if candidate.near <= covered {
                self.scratch[kept] = candidate;
                kept += 1;
            }
        }
        self.scratch.truncate(kept);
    }

    /// The texel of this place and size whose candidates are those from `start`, covered beyond this depth.
    fn texel(&mut self, x: f64, y: f64, size: f64, divisions: u32, start: usize, covered: f64) -> Texel {
        let count = self.scratch.len() - start;
        let occluded = self.depths.upper(covered);
        let lower = |near| self.depths.lower(near);
        if let [only] = self.scratch[start..] {
            let number = self.numbers[only.cone as usize];
            let covers = self.cones[only.cone as usize].covers(&self.window.rect(x, y, size));
            let tag = if covers { Tag::cover(number) } else { Tag::single(number) };
            return Texel::new(lower(only.near), occluded, tag);
        }
        if count == 0 {
            return Texel::EMPTY;
        }
        let lit = self.scratch[start..].iter().map(|c| lower(c.near)).min().unwrap_or(NEVER);
        if count > LONG
            && divisions < DIVISIONS
            && let Some(first) = self.parts(x, y, size, divisions, start)
        {
            return Texel::new(lit, occluded, Tag::parts(first));
        }
        self.budget.spend(count * size_of::<Entry>());
        let first = self.out.entries.len();
        let numbers = &self.numbers;
        let entry = |c: &Candidate| Entry { triangle: numbers[c.cone as usize], nearest: lower(c.near), last: 0 };
        self.out.entries.extend(self.scratch[start..].iter().map(entry));
        let list = &mut self.out.entries[first..];
        list.sort_unstable_by_key(|e| (e.nearest, e.triangle));
        list[count - 1].last = 1;
        Texel::new(lit, occluded, Tag::list(first))
    }
}

impl TileBuilder<'_> {
    /// Divides a texel whose candidates are those from `start`: the first of its parts, or `None` if their lists would hardly be shorter.
    fn parts(&mut self, x: f64, y: f64, size: f64, divisions: u32, start: usize) -> Option<usize> {
        let (end, part) = (self.scratch.len(), size / f64::from(PARTS));
        let places = (0..PARTS * PARTS).map(|i| (x + f64::from(i % PARTS) * part, y + f64::from(i / PARTS) * part));
        let mut kept = 0;
        for (px, py) in places.clone() {
            self.choose(&self.window.rect(px, py, part), start, end);
            kept += self.scratch.len() - end;
            self.scratch.truncate(end);
        }
        if kept > COUNT * (end - start) / 2 || self.budget.exceeded() {
            return None;
        }
        self.budget.spend(COUNT * size_of::<Texel>());
        let first = self.out.parts.len();
        self.out.parts.resize(first + COUNT, Texel::EMPTY);
        for (i, (px, py)) in places.enumerate() {
            let covered = self.choose(&self.window.rect(px, py, part), start, end);
            let texel = self.texel(px, py, part, divisions + 1, end, covered);
            self.out.parts[first + i] = texel;
            self.scratch.truncate(end);
        }
        Some(first)
    }
}

/// Puts the tiles together: lists one after the other, records of the triangles that occur.
fn merge(triangles: &[Triangle], cube: Cube, windows: &[Window; 6], bins: &Bins, tiles: Vec<Tile>) -> LightBuffer {
    let mut occurs = vec![0_u32; triangles.len()];
    for tile in &tiles {
        let singles = tile.texels.iter().chain(&tile.parts).filter_map(|t| t.tag.as_single());
        for number in singles.chain(tile.entries.iter().map(|e| e.triangle)) {
            occurs[number as usize] = 1;
        }
    }
    let numbers: Vec<u32> = (0..triangles.len() as u32).filter(|&t| occurs[t as usize] == 1).collect();
    for (record, &number) in (0..).zip(&numbers) {
        occurs[number as usize] = record;
    }
    let record_of = occurs;
    // Texels of no face, those of the tiles, all that are divided.
    let texels_of_faces = place::FIRST as usize + tiles.len() * TILE_TEXELS;
    let mut part = texels_of_faces;
    let all_parts = tiles.iter().map(|tile| tile.parts.len()).sum::<usize>();
    let mut entry = 1;
    // One more at the end: who reads an entry may read the next.
    let all_entries = 1 + entry + tiles.iter().map(|tile| tile.entries.len()).sum::<usize>();
    let mut tables = Tables::zeroed(texels_of_faces, part + all_parts, all_entries, numbers.len());
    let mut view = tables.view_mut();
    view.records().par_iter_mut().zip(&numbers).for_each(|(record, &number)| {
        // Those that have no cone do not occur.
        if let Some(cone) = Cone::new(&triangles[number as usize], cube.light()) {
            *record = Record::numbers(&cone);
        }
    });
    view.put_texels(0, (0..place::FIRST).map(|i| if i == place::UNKNOWN { Texel::UNKNOWN } else { Texel::EMPTY }));
    view.put_entries(0, [Entry { triangle: 0, nearest: 0, last: 1 }].into_iter());
    let moved = |texel: &Texel, part, entry| Texel { tag: texel.tag.moved(&record_of, part, entry), ..*texel };
    for (number, tile) in tiles.iter().enumerate() {
        let (face, x, y) = bins.tile(number);
        let window = &windows[face.index()];
        // A tile's squares of texels are rows of eight, which are parts of the window's.
        for (j, squares) in (0..).zip(tile.texels.chunks((place::SQUARE * TILE) as usize)) {
            let first = place::in_window(x * TILE, y * TILE + j * place::SQUARE, window.side().ilog2());
            view.put_texels((window.first + first) as usize, squares.iter().map(|t| moved(t, part, entry)));
        }
        view.put_texels(part, tile.parts.iter().map(|t| moved(t, part, entry)));
        let of_all = |e: &Entry| Entry { triangle: record_of[e.triangle as usize], ..*e };
        view.put_entries(entry, tile.entries.iter().map(of_all));
        part += tile.parts.len();
        entry += tile.entries.len();
    }
    tables.fill_squares();
    LightBuffer { cube, tables }
}
