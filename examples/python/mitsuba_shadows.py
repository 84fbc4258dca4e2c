"""Shadow tests of Mitsuba 3 against those of vdf, on the same triangles and points: which answers differ, who is right, and what they cost.

    pip install . mitsuba                # and embreex, to have it compared, too
    python examples/python/mitsuba_shadows.py [MESH.ply | MESH.obj] [--cubes 300] [--points 1000000]

Mitsuba loads the mesh, or makes some cubes. vdf is given its triangles, and all are asked which random points see a light. Mitsuba and Embree
compute in single precision, so a few of their answers differ near edges; those are decided with rational numbers. Times are of the processor,
of all threads together, medians of rounds in which all take turns.
"""

import argparse
import statistics
import time
from fractions import Fraction

import mitsuba as mi
import numpy as np

import vdf

LOOP = 20_000  # So many are asked one by one in Python.
DECIDED = 50  # So many differences are decided with rationals.


def cubes(count):
    rng = np.random.default_rng(1)
    size = 0.5 / count ** (1 / 3)
    for i in range(count):
        place = mi.ScalarTransform4f().translate(rng.uniform(-1, 1, 3).tolist())
        yield f"cube{i}", {"type": "cube", "to_world": place.rotate([1, 2, 3], rng.uniform(0, 360)).scale(size)}


def triangles_of(scene):
    """All triangles of a scene of Mitsuba, of shape (n, 3, 3)."""
    params = mi.traverse(scene)
    parts = []
    for key in params.keys():
        if key.endswith(".vertex_positions"):
            vertices = np.array(params[key], dtype=np.float32).reshape(-1, 3)
            faces = np.array(params[key.replace("vertex_positions", "faces")], dtype=np.int64).reshape(-1, 3)
            parts.append(vertices[faces])
    return np.concatenate(parts)


def exactly(triangles, point, light):
    """Whether the closed segment meets no triangle, with rationals; None where it lies in a triangle's plane."""

    def sub(a, b):
        return [x - y for x, y in zip(a, b)]

    def cross(a, b):
        return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b))

    p, q = ([Fraction(float(x)) for x in end] for end in (point, light))
    d = sub(q, p)
    # Only triangles whose box the segment's box touches can be met.
    low, high = np.minimum(point, light), np.maximum(point, light)
    near = (triangles.min(axis=1) <= high).all(axis=1) & (triangles.max(axis=1) >= low).all(axis=1)
    decided = True
    for triangle in triangles[near]:
        a, b, c = ([Fraction(float(x)) for x in vertex] for vertex in triangle)
        n = cross(sub(b, a), sub(c, a))
        det, height = dot(n, d), dot(n, sub(a, p))
        if det == 0:
            decided = decided and height != 0
            continue
        t = height / det
        x = [pi + t * di for pi, di in zip(p, d)]
        if 0 <= t <= 1 and all(dot(cross(sub(w, v), sub(x, v)), n) >= 0 for v, w in ((a, b), (b, c), (c, a))):
            return False
    return True if decided else None


def mitsuba_loop(scene, points, light):
    """Mitsuba's own test, from a loop as a script has it."""
    sees = np.empty(len(points), dtype=bool)
    for i, point in enumerate(points):
        way = light - point
        length = float(np.linalg.norm(way))
        ray = mi.Ray3f(
            o=mi.Point3f(*map(float, point)), d=mi.Vector3f(*map(float, way / length)), maxt=length, time=0, wavelengths=[]
        )
        sees[i] = not scene.ray_test(ray)
    return sees


def mitsuba_wavefront(shapes):
    """Mitsuba's own test of all rays at once, by Dr.Jit and LLVM, or None without LLVM."""
    try:
        mi.set_variant("llvm_ad_rgb")
        scene = mi.load_dict({"type": "scene", **shapes})
        mi.Float(1.0) + mi.Float([1.0, 2.0])
    except Exception as error:
        print(f"no test by LLVM: {error}")
        return None
    finally:
        mi.set_variant("scalar_rgb")

    def ask(points, light):
        mi.set_variant("llvm_ad_rgb")
        # Without normalization: maxt 1 is the light.
        ray = mi.Ray3f(o=mi.Point3f(points.T), d=mi.Vector3f((light - points).T), maxt=1.0, time=0.0, wavelengths=[])
        sees = ~np.array(scene.ray_test(ray))
        mi.set_variant("scalar_rgb")
        return sees

    return ask


def embree(triangles):
    """Embree's test of many rays at once, or None without embreex."""
    try:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene
    except ImportError:
        return None
    scene = EmbreeScene()
    mesh = TriangleMesh(scene, triangles)
    # The mesh has to live as long as the scene. 0 is a hit, -1 none; the length of the direction is that of the segment.
    return lambda points, light, mesh=mesh: scene.run(
        points, light - points, dists=np.ones(len(points), dtype=np.float32), query="OCCLUDED"
    ) < 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh", nargs="?")
    parser.add_argument("--cubes", type=int, default=300)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    mi.set_variant("scalar_rgb")
    if given.mesh:
        shapes = {"mesh": {"type": "ply" if given.mesh.endswith(".ply") else "obj", "filename": given.mesh}}
    else:
        shapes = dict(cubes(given.cubes))
    scene = mi.load_dict({"type": "scene", **shapes})
    triangles = triangles_of(scene)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    # In single precision, so that all are asked the same question.
    points = np.random.default_rng(2).uniform(low, high, (given.points, 3)).astype(np.float32)
    light = (low + (high - low) * np.array([0.5, 0.9, 0.4])).astype(np.float32)
    doubles = points.astype(np.float64)

    begun = time.process_time()
    visibility = vdf.Visibility(triangles, light[None].astype(np.float64))
    built = time.process_time() - begun
    print(f"{len(triangles)} triangles; vdf by {visibility.method}, built in {built:.2f} s of processor time")
    contestants = {
        "vdf, at once": lambda: visibility.unoccluded(doubles, light=0),
        "vdf, one by one": lambda: np.array([visibility.unoccluded(p[None], light=0)[0] for p in doubles[:LOOP]]),
        "Mitsuba, one by one": lambda: mitsuba_loop(scene, points[:LOOP], light),
    }
    for name, test in {"Mitsuba by LLVM, at once": mitsuba_wavefront(shapes), "embreex, at once": embree(triangles)}.items():
        if test is not None:
            contestants[name] = lambda test=test: test(points, light)
    times = {name: [] for name in contestants}
    answers = {}
    for _ in range(given.rounds):
        for name, ask in contestants.items():
            begun = time.process_time()
            answers[name] = ask()
            times[name].append(time.process_time() - begun)

    ours = answers["vdf, at once"]
    print(f"{ours.mean():.1%} of {len(points)} points see the light; proved without the hierarchy: ", end="")
    print(f"{visibility.statistics['proved'] / visibility.statistics['queries']:.2%}\n")
    print("| who | queries per second of processor time | answers that differ from vdf's | of them decided | vdf wrong |")
    print("| --- | --- | --- | --- | --- |")
    for name in contestants:
        count = len(answers[name])
        differ = np.flatnonzero(answers[name] != ours[:count])
        decided = {i: exactly(triangles, points[i], light) for i in differ[:DECIDED]}
        known = [i for i, sees in decided.items() if sees is not None]
        wrong = sum(decided[i] != ours[i] for i in known)
        speed = count / statistics.median(times[name])
        print(f"| {name} | {speed:,.0f} | {len(differ)} of {count} | {len(known)} | {wrong} |")


if __name__ == "__main__":
    main()
