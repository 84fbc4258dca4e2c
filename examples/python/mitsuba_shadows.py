"""Shadow tests of Mitsuba 3 against those of vdf: which agree, and what a million cost.

    pip install mitsuba numpy .          # and embreex, to have it compared, too
    python examples/python/mitsuba_shadows.py [MESH.ply|MESH.obj] [--points 1000000]

The mesh is loaded by Mitsuba, its triangles are handed to vdf, and both are asked which random points see a light. Mitsuba's rays begin and end a little
off the ends of the segment and are in single precision, so a few answers near edges differ; each of those is decided again with exact arithmetic on rationals.
"""

import argparse
import time
from fractions import Fraction

import mitsuba as mi
import numpy as np

import vdf


def triangles_of(scene):
    """All triangles of a scene of Mitsuba, of shape (n, 3, 3)."""
    params = mi.traverse(scene)
    parts = []
    for key in params.keys():
        if key.endswith(".vertex_positions"):
            vertices = np.array(params[key], dtype=np.float32).reshape(-1, 3)
            faces = np.array(params[key.replace("vertex_positions", "faces")], dtype=np.int64).reshape(-1, 3)
            parts.append(vertices[faces])
    return np.ascontiguousarray(np.concatenate(parts))


def exactly(triangles, point, light):
    """Whether the closed segment meets no triangle, with rationals."""
    def sub(a, b): return [x - y for x, y in zip(a, b)]
    def cross(a, b): return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    def dot(a, b): return sum(x * y for x, y in zip(a, b))
    p, q = ([Fraction(float(x)) for x in end] for end in (point, light))
    d = sub(q, p)
    # Only triangles whose box the segment's box touches can be met.
    low, high = np.minimum(point, light), np.maximum(point, light)
    near = (triangles.min(axis=1) <= high).all(axis=1) & (triangles.max(axis=1) >= low).all(axis=1)
    for triangle in triangles[near]:
        a, b, c = ([Fraction(float(x)) for x in vertex] for vertex in triangle)
        n = cross(sub(b, a), sub(c, a))
        det = dot(n, d)
        if det == 0:
            continue  # Seen edge-on: met only if the segment crosses a neighbour or touches an edge.
        t = dot(n, sub(a, p)) / det
        if not 0 <= t <= 1:
            continue
        x = [pi + t * di for pi, di in zip(p, d)]
        if all(dot(cross(sub(w, v), sub(x, v)), n) >= 0 for v, w in ((a, b), (b, c), (c, a))):
            return False
    return True


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("mesh", nargs="?")
    arguments.add_argument("--points", type=int, default=1_000_000)
    arguments = arguments.parse_args()
    mi.set_variant("scalar_rgb")
    if arguments.mesh:
        kind = "ply" if arguments.mesh.endswith(".ply") else "obj"
        shapes = {"mesh": {"type": kind, "filename": arguments.mesh}}
    else:
        rng = np.random.default_rng(1)
        shapes = {}
        for i in range(300):
            to_world = mi.ScalarTransform4f().translate(rng.uniform(-1, 1, 3).tolist()).rotate([0, 0, 1], rng.uniform(0, 360)).scale(0.07)
            shapes[f"cube{i}"] = {"type": "cube", "to_world": to_world}
    scene = mi.load_dict({"type": "scene", **shapes})
    triangles = triangles_of(scene)
    low, high = triangles.reshape(-1, 3).min(axis=0), triangles.reshape(-1, 3).max(axis=0)
    rng = np.random.default_rng(2)
    # In single precision, so that all are asked the same question.
    points = rng.uniform(low, high, (arguments.points, 3)).astype(np.float32)
    light = (low + (high - low) * np.array([0.5, 0.9, 0.4])).astype(np.float32)
    n = len(points)
    print(f"{len(triangles)} triangles, {n} points")

    cpu = time.process_time
    start = cpu()
    visibility = vdf.Visibility(triangles, light[None].astype(np.float64))
    built = cpu()
    ours = visibility.unoccluded(points.astype(np.float64), light=0)
    asked = cpu()
    print(f"vdf ({visibility.method})    {asked - built:8.2f} s of processor time, {built - start:.2f} s to build; {ours.mean():.1%} see the light")

    some = min(n, 20_000)
    start = cpu()
    theirs = np.empty(some, dtype=bool)
    for i in range(some):
        d = light - points[i]
        length = float(np.linalg.norm(d))
        # The segment itself, from end to end.
        ray = mi.Ray3f(o=mi.Point3f(*map(float, points[i])), d=mi.Vector3f(*map(float, d / length)), maxt=length, time=0, wavelengths=[])
        theirs[i] = not scene.ray_test(ray)
    seconds = (cpu() - start) * n / some
    print(f"mitsuba loop {seconds:8.2f} s ({some} asked one by one, as a loop in Python does)")
    differ = np.flatnonzero(theirs != ours[:some])
    print(f"             {len(differ)} of {some} answers differ")
    wrong = 0
    for i in differ[:50]:
        wrong += exactly(triangles, points[i], light) != ours[i]
    print(f"             of {min(len(differ), 50)} of those, decided with rationals, vdf has {wrong} wrong")

    try:
        import embreex.rtcore_scene
        from embreex.mesh_construction import TriangleMesh
    except ImportError:
        return
    embree = embreex.rtcore_scene.EmbreeScene()
    TriangleMesh(embree, triangles)
    start = cpu()
    hit = embree.run(points, light - points, dists=np.ones(n, dtype=np.float32), query="OCCLUDED")
    print(f"embreex      {cpu() - start:8.2f} s, single rays from an array; {np.count_nonzero((hit < 0) != ours)} answers differ")


if __name__ == "__main__":
    main()
