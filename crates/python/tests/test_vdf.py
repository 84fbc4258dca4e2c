"""vdf from Python: the bytes of the command line, proofs against a slow obvious twin, what is refused, and Ctrl-C."""

import ast
import inspect
import multiprocessing
import os
import pathlib
import signal
import subprocess
import threading
import time

import numpy as np
import pytest

import vdf

SIZE = {"width": 24, "height": 20}


@pytest.fixture(scope="module")
def scene():
    return vdf.load("cbox_vol2", **SIZE)


def test_a_render_is_an_array_and_a_dictionary(scene):
    r = scene.render(spp=3, method="amr-sn", layers=["depth", "normal", "albedo"])
    assert r.image.shape == (20, 24, 3) and r.image.dtype == np.float32
    assert r.image.max() > 0 and np.isfinite(r.image).all()
    assert list(r.layers) == ["albedo", "normal", "depth"]
    assert r.layers["normal"].shape == (20, 24, 3) and r.layers["depth"].shape == (20, 24, 1)
    assert (np.linalg.norm(r.layers["normal"], axis=2) <= 1.0001).all() and r.layers["depth"].max() > 100
    s = r.statistics
    assert (s["method"], s["spp"], s["paths"], s["refused"]) == ("amr-sn", 3, 3 * 24 * 20, 0)
    assert 0 < s["proved"] <= s["spatial"] <= s["queries"]
    # Another method, the same bytes; and again without building.
    assert np.array_equal(r.image, scene.render(spp=3, method="none").image)
    assert np.array_equal(r.image, scene.render(spp=3, method="none", threads=1).image)
    assert not np.array_equal(r.image, scene.render(spp=3, seed=9).image)
    part = scene.render(spp=3, crop=(5, 6, 9, 8)).image
    assert np.array_equal(part, r.image[6:8, 5:9])


@pytest.mark.parametrize(
    "options",
    [
        {"spp": 5, "seed": 3, "method": "amr-xsn", "crop": (2, 3, 22, 19), "layers": ["normal", "depth", "variance"]},
        {"spp": 2, "integrator": "raymarch", "samples_per_segment": 5, "estimator": "lit", "sampler": "sobol"},
        {"spp": 64, "integrator": "raymarch", "samples_per_segment": "auto", "noise": 0.3},
        {"spp": 3, "transmittance": "analog", "roulette": "thesis", "voxel": 16.0, "method": "ndf"},
    ],
)
def test_a_render_has_the_bytes_of_the_command_line(options, tmp_path):
    program = os.environ.get("VDF") or pytest.skip("$VDF does not name the program")
    theirs = tmp_path / "theirs.exr"
    command = [program, "render", "cbox_vol2", "--exr-format", "float", "-q", "-o", theirs]
    for name, value in SIZE.items():
        command += ["-D", f"{name}={value}"]
    for name, value in options.items():
        name = "aov" if name == "layers" else name.replace("_", "-")
        command += [f"--{name}", ",".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)]
    subprocess.run(command, check=True)
    rendering = vdf.load("cbox_vol2", **SIZE).render(**options)
    assert vdf.read_exr(theirs).tobytes() == rendering.image.tobytes()


def test_errors_say_what_is_wrong(scene, tmp_path):
    for options, part in [
        ({"method": "best"}, "unknown method"),
        ({"spp": 0}, "spp must be at least 1"),
        ({"threads": 0}, "threads must be at least 1"),
        ({"voxel": float("nan")}, "voxel must be a positive finite number"),
        ({"sampler": "halton"}, "sampler must be one of independent, sobol"),
        ({"samples_per_segment": 3}, "raymarch only"),
        ({"samples_per_segment": "many", "integrator": "raymarch"}, "samples_per_segment must be a number from 1 on, or auto"),
        ({"noise": 0.0}, "noise must be a positive number"),
        ({"layers": ["colour"]}, "unknown layer; the layers are albedo"),
        ({"crop": (0, 0, 99, 1)}, "crop"),
    ]:
        with pytest.raises(ValueError, match=part):
            scene.render(**options)
    with pytest.raises(FileNotFoundError, match="no such file, nor a built-in scene"):
        vdf.load("nothing.xml")
    with pytest.raises(ValueError, match="colour"):
        vdf.load("cbox_vol2", colour="red")
    broken = tmp_path / "broken.xml"
    broken.write_text("<scene version='3.0.0'>\n  <fog/>\n</scene>")
    with pytest.raises(ValueError, match="broken.xml:2:3: .*fog"):
        vdf.load(broken)
    with pytest.raises(FileNotFoundError, match="cannot read .*no.exr"):
        vdf.read_exr(tmp_path / "no.exr")
    with pytest.raises(ValueError, match="broken.xml"):
        vdf.read_exr(broken)
    with pytest.raises(OSError, match="cannot write .*a.exr"):
        vdf.write_exr(tmp_path / "no" / "a.exr", np.zeros((2, 2, 3), np.float32))


def test_images_are_compared_and_kept(scene, tmp_path):
    a, b = (scene.render(spp=2, seed=seed).image for seed in (1, 2))
    same = vdf.compare(a, a)
    assert same["identical"] and same["mse"] == 0 and same["psnr"] is None
    other = vdf.compare(a, b)
    assert not other["identical"]
    assert other["mse"] == pytest.approx(np.mean((a.astype(float) - b) ** 2), rel=1e-6)
    with pytest.raises(ValueError, match="differ in size"):
        vdf.compare(a, b[1:])
    with pytest.raises(TypeError, match="reference must be of float32, not float64"):
        vdf.compare(a, b.astype(np.float64))
    path = tmp_path / "a.exr"
    # Views of any layout.
    vdf.write_exr(path, a[::-1], layers={"depth": a[:, :, :1], "mine": np.asfortranarray(a)})
    assert np.array_equal(vdf.read_exr(path), a[::-1])
    assert b"depth.Z" in path.read_bytes() and b"mine.2" in path.read_bytes()
    with pytest.raises(ValueError, match="layer mine has 23 x 20 pixels, and the image 24 x 20"):
        vdf.write_exr(path, a, layers={"mine": a[:, 1:]})
    with pytest.raises(ValueError, match=r"image must be of shape \(height, width, 3\), not \(20, 24\)"):
        vdf.write_exr(path, a[:, :, 0])


def triangles_and_points(rng):
    centres = rng.uniform(-1, 1, (200, 1, 3))
    triangles = (centres + rng.normal(0, 0.15, (200, 3, 3))).astype(np.float32)
    return triangles, rng.uniform(-1.2, 1.2, (3000, 3)), rng.uniform(-1, 1, (3, 3))


def twin(triangles, points, light):
    """Every segment against every triangle (Möller and Trumbore), and how far the closest call was from being another."""
    a, b, c = (triangles[:, i].astype(np.float64) for i in range(3))
    d = (light - points)[:, None, :]
    e1, e2 = b - a, c - a
    p = np.cross(d, e2[None])
    det = (p * e1).sum(-1)
    t0 = points[:, None, :] - a
    u = (t0 * p).sum(-1) / det
    q = np.cross(t0, e1[None])
    v = (d * q).sum(-1) / det
    t = (e2 * q).sum(-1) / det
    least = np.minimum.reduce([u, v, 1 - u - v, t, 1 - t])
    return ~(least >= 0).any(axis=1), np.abs(least).min(axis=1)


@pytest.mark.parametrize("method", [None, "lb", "amr-xsn", "ndf-sn", "dsz", "none"])
def test_points_see_lights_as_the_twin_says(method):
    rng = np.random.default_rng(7)
    triangles, points, lights = triangles_and_points(rng)
    visibility = vdf.Visibility(triangles, lights, method=method)
    answers = visibility.unoccluded(points)
    assert answers.shape == (3000, 3) and answers.dtype == bool
    checked = 0
    for i, light in enumerate(lights):
        expected, margin = twin(triangles, points, light)
        # The twin rounds; ours does not. Where its figures are close to a border it says nothing.
        sure = margin > 1e-9
        assert np.array_equal(answers[sure, i], expected[sure])
        assert np.array_equal(visibility.unoccluded(points, light=i), answers[:, i])
        checked += sure.sum()
    assert checked > 8900 and 0.05 < answers.mean() < 0.95
    statistics = visibility.statistics
    assert statistics["queries"] == 18000 and statistics["lights"] == 3
    assert (statistics["proved"] > 0) == (method != "none")


def test_lit_intervals_are_where_points_see_lights():
    rng = np.random.default_rng(11)
    triangles, points, lights = triangles_and_points(rng)
    origins, ends = points[:1500], points[1500:]
    # Segments on triangles, through vertices, of no length.
    origins[:50], ends[:50] = triangles[:50, 0], triangles[:50, 1]
    origins[50:60] = ends[50:60]
    visibility = vdf.Visibility(triangles, lights)
    intervals, lit, offsets = visibility.lit_intervals(origins, ends)
    assert (intervals.dtype, lit.dtype, offsets.dtype) == (np.float64, bool, np.int64)
    assert intervals.shape == (len(lit), 2) and offsets.shape == (4501,) and offsets[-1] == len(lit)
    assert visibility.statistics["lit_segments"] == 4500
    # In [0, 1], in order.
    assert (0 <= intervals[:, 0]).all() and (intervals[:, 0] <= intervals[:, 1]).all() and (intervals[:, 1] <= 1).all()
    pair_of_row = np.repeat(np.arange(4500), np.diff(offsets))
    inner = pair_of_row[1:] == pair_of_row[:-1]
    assert (intervals[1:, 0] > intervals[:-1, 1])[inner].all()
    # At both ends of each, next to them, and anywhere.
    rows = np.concatenate([intervals, np.nextafter(intervals, [-1, 2])]).T.ravel()
    pairs = np.concatenate([np.tile(pair_of_row, 4), rng.integers(0, 4500, 20000)])
    t = np.concatenate([rows, rng.uniform(0, 1, 20000)])
    pairs, t = pairs[(0 <= t) & (t <= 1)], t[(0 <= t) & (t <= 1)]
    x = origins[pairs // 3] + (ends[pairs // 3] - origins[pairs // 3]) * t[:, None]
    sees = visibility.unoccluded(x)[np.arange(len(t)), pairs % 3]
    known_lit, covered = np.zeros(len(t), bool), np.zeros(len(t), bool)
    for i, (pair, at) in enumerate(zip(pairs, t)):
        of_pair = slice(offsets[pair], offsets[pair + 1])
        within = (intervals[of_pair, 0] <= at) & (at <= intervals[of_pair, 1])
        covered[i], known_lit[i] = within.any(), (within & lit[of_pair]).any()
    assert sees[known_lit].all() and not sees[~covered].any()
    assert known_lit.mean() > 0.1 and (~covered).mean() > 0.1
    # From anywhere to anywhere unknown is next to nothing.
    assert (intervals[:, 1] - intervals[:, 0])[~lit & (pair_of_row >= 180)].sum() < 1e-6
    # And by the twin, which knows nothing of intervals.
    for j, light in enumerate(lights):
        mine = pairs % 3 == j
        expected, margin = twin(triangles, x[mine][-3000:], light)
        sure = margin > 1e-9
        assert sure.mean() > 0.9
        assert np.array_equal(sees[mine][-3000:][sure], expected[sure])
    # One light has every third pair.
    of_one, lit_of_one, offsets_of_one = visibility.lit_intervals(origins, ends, light=1)
    assert np.array_equal(of_one, intervals[pair_of_row % 3 == 1])
    assert np.array_equal(lit_of_one, lit[pair_of_row % 3 == 1]) and len(offsets_of_one) == 1501
    with pytest.raises(ValueError, match="origins and ends must be as many, not 1500 and 1499"):
        visibility.lit_intervals(origins, ends[1:])


def test_arrays_of_all_layouts_are_read():
    rng = np.random.default_rng(8)
    triangles, points, lights = triangles_and_points(rng)
    visibility = vdf.Visibility(np.asfortranarray(triangles), lights[::-1])
    answers = visibility.unoccluded(points)
    assert np.array_equal(answers[:, ::-1], vdf.Visibility(triangles, lights).unoccluded(points))
    assert np.array_equal(answers, visibility.unoccluded(np.asfortranarray(points)))
    assert np.array_equal(answers[::2], visibility.unoccluded(points[::2]))
    assert visibility.unoccluded(np.empty((0, 3))).shape == (0, 3)
    none, lit, offsets = visibility.lit_intervals(np.empty((0, 3)), np.empty((0, 3)))
    assert none.shape == (0, 2) and lit.shape == (0,) and list(offsets) == [0]
    # A point on a triangle sees nothing.
    assert not visibility.unoccluded(triangles[:, 0].astype(np.float64)).any()
    # Without triangles all is seen; without lights there are no answers.
    assert vdf.Visibility(triangles[:0], lights).unoccluded(points).all()
    assert vdf.Visibility(triangles, lights[:0]).unoccluded(points).shape == (3000, 0)


def test_other_arrays_are_refused():
    rng = np.random.default_rng(8)
    triangles, points, lights = triangles_and_points(rng)
    visibility = vdf.Visibility(triangles, lights)
    unaligned = np.frombuffer(b"x" + bytes(24), dtype=np.float64, offset=1).reshape(1, 3)
    for wrong, error, part in [
        (np.zeros((3, 2)), ValueError, r"points must be of shape \(n, 3\), not \(3, 2\)"),
        (np.zeros(3), ValueError, r"points must be of shape \(n, 3\), not \(3,\)"),
        (np.array([[0, 0, 0], [0, 0, np.nan]]), ValueError, "points: number 1 is not finite"),
        (np.full((9, 3), -np.inf), ValueError, "points: number 0 is not finite"),
        (points.astype(np.float32), TypeError, r"points must be of float64, not float32; .astype\(numpy.float64\)"),
        (points.astype(">f8"), TypeError, "points must be of float64, not >f8"),
        (points.astype(complex), TypeError, "points must be of float64, not complex128"),
        (unaligned, ValueError, "not aligned"),
        ([[0.0, 0.0, 0.0]], TypeError, r"points must be a NumPy array of float64 of shape \(n, 3\), not .*list"),
        (None, TypeError, "points must be a NumPy array"),
    ]:
        with pytest.raises(error, match=part):
            visibility.unoccluded(wrong)
    with pytest.raises(ValueError, match="ends: number 0 is not finite"):
        visibility.lit_intervals(points[:1], np.full((1, 3), np.nan))
    for wrong, error, part in [
        (np.zeros((1, 2, 3), np.float32), ValueError, r"triangles must be of shape \(n, 3, 3\), not \(1, 2, 3\)"),
        (np.zeros((1, 3, 3)), TypeError, "triangles must be of float32, not float64"),
        (np.full((1, 3, 3), np.inf, np.float32), ValueError, "triangles: number 0 is not finite"),
    ]:
        with pytest.raises(error, match=part):
            vdf.Visibility(wrong, lights)
    for options, error, part in [
        ({"method": "best"}, ValueError, "unknown method"),
        ({"method": "amr", "voxel": 0.0}, ValueError, "voxel must be a positive finite number, not 0"),
        ({"method": "amr", "voxel": 1e-9}, ValueError, "the smallest usable voxel size is"),
        ({"threads": 0}, ValueError, "threads must be at least 1"),
    ]:
        with pytest.raises(error, match=part):
            vdf.Visibility(triangles, lights, **options)
    for light, error in [(3, IndexError), (-1, OverflowError)]:
        with pytest.raises(error):
            visibility.unoccluded(points, light=light)
    # More than any memory has room for.
    with pytest.raises(MemoryError, match="no memory for 17592186044416 x 3 numbers"):
        visibility.unoccluded(np.broadcast_to(points[0], (2**44, 3)))


class Asker:
    """Set before a fork, which takes it along."""

    visibility = points = None

    @classmethod
    def ask(cls):
        return cls.visibility.unoccluded(cls.points)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_asks_on():
    triangles, Asker.points, lights = triangles_and_points(np.random.default_rng(9))
    Asker.visibility = vdf.Visibility(triangles, lights)
    answers = Asker.ask()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        # Threads that were left behind in the parent would be waited for for ever.
        assert np.array_equal(pool.apply_async(Asker.ask).get(timeout=60), answers)


def long_queries():
    """So many queries that they take a minute without threads."""
    rng = np.random.default_rng(10)
    triangles = rng.uniform(-1, 1, (1000, 3, 3)).astype(np.float32)
    visibility = vdf.Visibility(triangles, rng.uniform(-1, 1, (1000, 3)), method="none")
    return lambda n: visibility.unoccluded(rng.uniform(-1, 1, (n, 3)))


def test_other_threads_run_meanwhile(scene):
    ticks = []
    done = threading.Event()

    def tick():
        while not done.wait(0.01):
            ticks.append(time.monotonic())

    queries = long_queries()
    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    for work in (lambda: scene.render(spp=200, method="none"), lambda: queries(1000)):
        start = time.monotonic()
        work()
        end = time.monotonic()
        # Held, the lock would let none of them come.
        assert sum(start < t < end for t in ticks) >= 2
    done.set()
    thread.join()


def test_ctrl_c_stops_a_render_and_queries(scene):
    # A shell lets what it starts in the background ignore the signal.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    queries = long_queries()
    for work in (lambda: scene.render(spp=10**8), lambda: queries(300_000)):
        timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            work()
    # And the scene is as good as before.
    assert scene.render(spp=1).image.max() > 0


def test_the_stubs_say_what_the_docstrings_say():
    stubs = ast.parse((pathlib.Path(vdf.__file__).parent / "__init__.pyi").read_text())
    documented = 0

    def compare(stub, thing, name):
        nonlocal documented
        assert ast.get_docstring(stub) == inspect.getdoc(thing), name
        documented += 1

    for stub in stubs.body:
        if isinstance(stub, (ast.FunctionDef, ast.ClassDef)):
            thing = getattr(vdf, stub.name)
            compare(stub, thing, stub.name)
            for member in stub.body if isinstance(stub, ast.ClassDef) else []:
                if isinstance(member, ast.FunctionDef) and member.name != "__new__":
                    compare(member, getattr(thing, member.name), f"{stub.name}.{member.name}")
    public = [name for cls in (vdf.Scene, vdf.Rendering, vdf.Visibility) for name in vars(cls) if name[0] != "_"]
    assert documented == len(vdf.__all__) - 1 + len(public)
