//! A leaf: which of its triangles a segment meets.
//!
//! *Idea:* all four triangles are asked at once, in double precision, by the filter of [`SegmentTest::intersect`]. Few calls are close; those are
//! left to the exact test.
//!
//! *Guarantee:* the same answers as the exact test: the operations are the same, in the same order, and so are the error bounds.

use super::{
    lanes::Lanes,
    layout::{Leaf, WIDTH},
};
use crate::{SegmentTest, TriangleHit};

/// A segment as the leaves need it: see [`SegmentTest`].
#[derive(Clone, Copy)]
pub(super) struct LeafTest<L: Lanes> {
    lanes: L,
    /// The axis of the direction's largest component is the last.
    axes: [usize; 3],
    origin: [L::Doubles; 3],
    shear: [L::Doubles; 2],
    scale: L::Doubles,
    /// The largest error of an edge function and of `T`, with both signs.
    edge_error: [L::Doubles; 2],
    t_error: [L::Doubles; 2],
}

impl<L: Lanes> LeafTest<L> {
    #[inline(always)]
    pub(super) fn new(test: &SegmentTest, l: L) -> Self {
        let (p, axes) = (test.segment().p.to_array(), test.axes());
        let [x, y] = test.shear();
        let (edge_error, t_error) = (test.edge_error(), test.t_error());
        Self {
            lanes: l,
            axes,
            origin: [l.splat_double(p[axes[0]]), l.splat_double(p[axes[1]]), l.splat_double(p[axes[2]])],
            shear: [l.splat_double(x), l.splat_double(y)],
            scale: l.splat_double(test.scale()),
            edge_error: [l.splat_double(-edge_error), l.splat_double(edge_error)],
            t_error: [l.splat_double(-t_error), l.splat_double(t_error)],
        }
    }

    #[inline(always)]
    pub(super) fn lanes(&self) -> L {
        self.lanes
    }

    /// The vertices number `v`, sheared.
    #[inline(always)]
    fn sheared(&self, leaf: &Leaf, v: usize) -> [L::Doubles; 3] {
        let l = self.lanes;
        let [x, y, z] = [&leaf.vertices[self.axes[0]], &leaf.vertices[self.axes[1]], &leaf.vertices[self.axes[2]]];
        let z = l.sub_doubles(l.doubles(&z[v]), self.origin[2]);
        let x = l.sub_doubles(l.doubles(&x[v]), self.origin[0]);
        let y = l.sub_doubles(l.doubles(&y[v]), self.origin[1]);
        let x = l.sub_doubles(x, l.mul_doubles(self.shear[0], z));
        let y = l.sub_doubles(y, l.mul_doubles(self.shear[1], z));
        [x, y, l.mul_doubles(z, self.scale)]
    }
}

/// The edge function of two sheared vertices.
#[inline(always)]
fn edge<L: Lanes>(l: L, a: &[L::Doubles; 3], b: &[L::Doubles; 3]) -> L::Doubles {
    l.sub_doubles(l.mul_doubles(a[0], b[1]), l.mul_doubles(a[1], b[0]))
}

/// What is known of the triangles of a leaf, a bit for each.
#[derive(Clone, Copy)]
pub(super) struct Sieved<L: Lanes> {
    /// Those that the segment meets for certain.
    pub(super) hits: u32,
    /// Those of which only the exact test can tell.
    pub(super) close: u32,
    /// The edge functions and `T` of all.
    edges: [L::Doubles; 3],
    t: L::Doubles,
}

impl<L: Lanes> Sieved<L> {
    /// The edge functions and `T` of each.
    #[inline(always)]
    pub(super) fn numbers(&self, l: L) -> [[f64; WIDTH]; 4] {
        let [u, v, w] = self.edges;
        [l.array_of_doubles(u), l.array_of_doubles(v), l.array_of_doubles(w), l.array_of_doubles(self.t)]
    }
}

impl Leaf {
    /// Which of the first `count` triangles the segment meets, as far as the filter of [`SegmentTest::intersect`] can tell.
    #[inline(always)]
    pub(super) fn sieve<L: Lanes>(&self, count: u32, test: &LeafTest<L>) -> Sieved<L> {
        let l = test.lanes;
        let all = (1 << count) - 1;
        let (a, b, c) = (test.sheared(self, 0), test.sheared(self, 1), test.sheared(self, 2));
        let (u, v, w) = (edge(l, &c, &b), edge(l, &a, &c), edge(l, &b, &a));
        // One that is not a number may be passed over: then another one is the least or the greatest, of which the same is true.
        let (least, greatest) = (l.min_doubles(l.min_doubles(u, v), w), l.max_doubles(l.max_doubles(u, v), w));
        let [below, above] = test.edge_error;
        let apart = l.less_doubles(least, below) & l.less_doubles(above, greatest);
        let near = !apart & all;
        if near == 0 {
            return Sieved { hits: 0, close: 0, edges: [u, v, w], t: u };
        }
        let inside = l.less_doubles(above, least) | l.less_doubles(greatest, below);
        let det = l.add_doubles(l.add_doubles(u, v), w);
        let t = l.add_doubles(l.mul_doubles(u, a[2]), l.mul_doubles(v, b[2]));
        let t = l.add_doubles(t, l.mul_doubles(w, c[2]));
        // Of a triangle that is seen from behind both have the other sign.
        let zero = l.splat_double(0.0);
        let behind = l.less_doubles(det, zero);
        let beyond = l.sub_doubles(t, det);
        let [less, more] = test.t_error;
        let (low, high) = (l.less_doubles(t, less), l.less_doubles(more, t));
        let (short, far) = (l.less_doubles(beyond, less), l.less_doubles(more, beyond));
        let (before, after) = (low & !behind | high & behind, far & !behind | short & behind);
        let (begun, ended) = (high & !behind | low & behind, short & !behind | far & behind);
        let hits = inside & begun & ended & near;
        Sieved { hits, close: near & !hits & !(inside & (before | after)), edges: [u, v, w], t }
    }

    /// The exact answer for one triangle.
    #[inline(always)]
    pub(super) fn intersect(&self, i: usize, test: &SegmentTest) -> Option<TriangleHit> {
        let i = i & (WIDTH - 1);
        let along = |axis: usize| {
            let vertices = &self.vertices[axis];
            [f64::from(vertices[0][i]), f64::from(vertices[1][i]), f64::from(vertices[2][i])]
        };
        let [x, y, z] = test.axes();
        test.intersect_coordinates([along(x), along(y), along(z)], || self.triangle(i))
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use pulp::{Arch, Scalar};

    use super::*;
    use crate::{
        Segment, Triangle,
        hierarchy::lanes::{self, InLanes},
    };

    struct Sieve<'a>(&'a Leaf, &'a SegmentTest);

    impl InLanes for Sieve<'_> {
        type Output = (u32, u32, [[f64; WIDTH]; 4]);

        fn run(self, lanes: impl Lanes) -> Self::Output {
            let sieved = self.0.sieve(4, &LeafTest::new(self.1, lanes));
            (sieved.hits, sieved.close, sieved.numbers(lanes))
        }
    }

    /// Segments to vertices, edges, inner points and to places a little beside, from near, from far and from the triangle itself: what is
    /// said to be a hit is one, what is neither hit nor close is none, few are close, and all registers say the same.
    #[test]
    fn what_is_sieved_is_what_the_exact_test_says() {
        let mut noise = fastrand::Rng::with_seed(11);
        let mut counts = [0; 3];
        for i in 0..30_000 {
            let size = [0.5, 0.05, 0.005][i % 3];
            let mut uniform = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * noise.f64() - 1.0)));
            let mut any = || {
                let (o, a, b) = (uniform(1.0 - size), uniform(size), uniform(size));
                Triangle { vertices: [o, o + a, o + b].map(|v| v.as_vec3()) }
            };
            let triangles = [any(), any(), any(), any()];
            let leaf = Leaf::new(&triangles, &[0, 1, 2, 3]);
            let [a, b, c] = triangles[i / 12 % 4].vertices_f64();
            let inside = (a + b + c) / 3.0;
            let target = [a, a + (b - a) * 0.375, inside, a + (a - b) * 0.1 + (a - c) * 0.1][i / 3 % 4];
            let from = uniform(1.0);
            let p = [from, target + (from - target) * size, inside, inside + (from - inside) * 1e-9][i / 48 % 4];
            let q = [p + (target - p) * 1.5, p + (target - p) * 0.999_999, target, from][i / 192 % 4];
            let test = SegmentTest::new(Segment::new(p, q), DVec3::NEG_ONE, DVec3::ONE);
            let (hits, close, numbers) = lanes::dispatch(Arch::new(), Sieve(&leaf, &test));
            assert_eq!((hits, close, numbers), Sieve(&leaf, &test).run(Scalar));
            assert!(hits & close == 0 && (hits | close) < 16);
            for (k, triangle) in triangles.iter().enumerate() {
                let hit = test.intersect(triangle);
                let met = hit.is_some();
                if hits >> k & 1 == 1 {
                    let [u, v, w, t] = numbers.map(|n| n[k]);
                    assert_eq!(hit, Some(test.certain_hit([u, v, w], t, || *triangle)));
                }
                assert!(if met { hits | close } else { !hits } >> k & 1 == 1, "{test:?} {triangle:?}");
                counts[0] += u32::from(met);
                counts[1] += hits >> k & 1;
                counts[2] += close >> k & 1;
            }
        }
        let [met, hits, close] = counts;
        assert!(met > 10_000 && hits > 1500 && close < 30_000, "{counts:?}");
    }
}
