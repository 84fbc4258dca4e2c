//! The bodies that generated scenes are made of. Fronts look outwards.

use std::io;

use glam::DVec3;

use super::{mesh::MeshSink, random::circle};

/// Where an object stands: turned about the vertical axis, then moved.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    origin: DVec3,
    cos: f64,
    sin: f64,
}

impl Placement {
    /// `turns` full turns from z towards x, then to `origin`.
    pub(super) fn new(origin: DVec3, turns: f64) -> Self {
        let [cos, sin] = circle(turns);
        Self { origin, cos, sin }
    }

    /// Not turned.
    pub(super) const fn at(x: f64, y: f64, z: f64) -> Self {
        Self { origin: DVec3::new(x, y, z), cos: 1.0, sin: 0.0 }
    }

    /// The place in the scene of a point of the object.
    pub(super) fn point(&self, x: f64, y: f64, z: f64) -> DVec3 {
        self.origin + DVec3::new(self.cos * x + self.sin * z, y, self.cos * z - self.sin * x)
    }

    /// An object that stands at a point of this one, turned as this one.
    pub(super) fn moved(&self, x: f64, y: f64, z: f64) -> Self {
        Self { origin: self.point(x, y, z), ..*self }
    }
}

/// The box between two corners: 12 triangles.
pub(super) fn cuboid(sink: &mut dyn MeshSink, at: &Placement, min: [f64; 3], max: [f64; 3]) -> io::Result<()> {
    // Corner number: bit 0 is x, bit 1 is y, bit 2 is z.
    let mut corners = [0; 8];
    for (i, corner) in corners.iter_mut().enumerate() {
        let c = |axis: usize| if i >> axis & 1 == 0 { min[axis] } else { max[axis] };
        *corner = sink.vertex(at.point(c(0), c(1), c(2)))?;
    }
    for face in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
        quad(sink, face.map(|i| corners[i]))?;
    }
    Ok(())
}

/// Two triangles; the corners counter-clockwise seen from the front.
pub(super) fn quad(sink: &mut dyn MeshSink, [a, b, c, d]: [u32; 4]) -> io::Result<()> {
    sink.triangle([a, b, c])?;
    sink.triangle([a, c, d])
}

/// The surface of revolution of `profile`, pairs of radius and height from the bottom to the top, about the vertical axis. A radius
/// of 0 at an end closes it with a tip.
pub(super) fn lathe(sink: &mut dyn MeshSink, at: &Placement, profile: &[[f64; 2]], segments: u32) -> io::Result<()> {
    let mut below: Vec<u32> = Vec::new();
    for &[radius, height] in profile {
        let count = if radius == 0.0 { 1 } else { segments };
        let mut ring = Vec::with_capacity(count as usize);
        for i in 0..count {
            let [c, s] = circle(f64::from(i) / f64::from(segments));
            ring.push(sink.vertex(at.point(radius * c, height, radius * s))?);
        }
        if !below.is_empty() {
            band(sink, &below, &ring)?;
        }
        below = ring;
    }
    Ok(())
}

/// The surface between two rings, either of which may be a single point.
pub(super) fn band(sink: &mut dyn MeshSink, below: &[u32], above: &[u32]) -> io::Result<()> {
    let segments = below.len().max(above.len());
    for i in 0..segments {
        let j = (i + 1) % segments;
        if above.len() > 1 {
            sink.triangle([below[i % below.len()], above[i], above[j]])?;
        }
        if below.len() > 1 {
            sink.triangle([below[i], above[j % above.len()], below[j]])?;
        }
    }
    Ok(())
}

/// An open cone from `from` to `to`.
pub(super) fn tube(sink: &mut dyn MeshSink, [from, to]: [DVec3; 2], radii: [f64; 2], segments: u32) -> io::Result<()> {
    let axis = (to - from).normalize();
    let helper = if axis.y.abs() < 0.9 { DVec3::Y } else { DVec3::X };
    let u = axis.cross(helper).normalize();
    let v = u.cross(axis);
    let mut rings = [Vec::new(), Vec::new()];
    for ((ring, centre), radius) in rings.iter_mut().zip([from, to]).zip(radii) {
        for i in 0..segments {
            let [c, s] = circle(f64::from(i) / f64::from(segments));
            ring.push(sink.vertex(centre + (u * c + v * s) * radius)?);
        }
    }
    band(sink, &rings[0], &rings[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct Mesh {
        vertices: Vec<DVec3>,
        triangles: Vec<[DVec3; 3]>,
    }

    impl MeshSink for Mesh {
        fn vertex(&mut self, p: DVec3) -> io::Result<u32> {
            self.vertices.push(p);
            Ok(self.vertices.len() as u32 - 1)
        }

        fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()> {
            self.triangles.push(corners.map(|i| self.vertices[i as usize]));
            Ok(())
        }
    }

    impl Mesh {
        /// Positive if a closed mesh looks outwards (divergence theorem).
        fn volume(&self) -> f64 {
            self.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
        }
    }

    #[test]
    fn closed_bodies_look_outwards() {
        let at = Placement::new(DVec3::new(3.0, -2.0, 5.0), 0.3);
        let mut mesh = Mesh::default();
        cuboid(&mut mesh, &at, [0.0, 1.0, 2.0], [2.0, 4.0, 3.0]).unwrap();
        assert_eq!(mesh.triangles.len(), 12);
        assert!((mesh.volume() - 6.0).abs() < 1e-9, "{}", mesh.volume());

        let mut mesh = Mesh::default();
        lathe(&mut mesh, &at, &[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]], 64).unwrap();
        assert_eq!(mesh.triangles.len(), 64 * 4);
        assert!((mesh.volume() - std::f64::consts::TAU).abs() < 0.02, "{}", mesh.volume());
    }

    #[test]
    fn a_tube_looks_away_from_its_axis() {
        for to in [DVec3::Y, DVec3::new(0.3, -2.0, 0.5), DVec3::NEG_X] {
            let mut mesh = Mesh::default();
            tube(&mut mesh, [DVec3::ZERO, to], [0.2, 0.1], 7).unwrap();
            assert_eq!(mesh.triangles.len(), 14);
            for [a, b, c] in &mesh.triangles {
                let centre = (a + b + c) / 3.0;
                let outwards = centre - to * (centre.dot(to) / to.length_squared());
                assert!((b - a).cross(c - a).dot(outwards) > 0.0, "{to}");
            }
        }
    }
}
