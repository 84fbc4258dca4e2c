"""vdf from Python: the same bytes as the command line, proofs against a slow obvious twin, and Ctrl-C."""

import os
import signal
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


def test_errors_say_what_is_wrong(scene):
    for options, part in [
        ({"method": "best"}, "unknown method"),
        ({"spp": 0}, "spp must be at least 1"),
        ({"sampler": "halton"}, "sampler must be one of independent, sobol"),
        ({"samples_per_segment": 3}, "raymarch only"),
        ({"layers": ["colour"]}, "unknown layer; the layers are albedo"),
        ({"crop": (0, 0, 99, 1)}, "crop"),
    ]:
        with pytest.raises(ValueError, match=part):
            scene.render(**options)
    with pytest.raises(ValueError, match="no such file, nor a built-in scene"):
        vdf.load("nothing.xml")
    with pytest.raises(ValueError, match="colour"):
        vdf.load("cbox_vol2", colour="red")


def test_images_are_compared_and_kept(scene, tmp_path):
    a, b = (scene.render(spp=2, seed=seed).image for seed in (1, 2))
    same = vdf.compare(a, a)
    assert same["identical"] and same["mse"] == 0 and same["psnr"] is None
    other = vdf.compare(a, b)
    assert not other["identical"]
    assert other["mse"] == pytest.approx(np.mean((a.astype(float) - b) ** 2), rel=1e-6)
    with pytest.raises(ValueError, match="differ in size"):
        vdf.compare(a, b[1:])
    path = tmp_path / "a.exr"
    vdf.write_exr(path, a, layers={"depth": a[:, :, :1].copy(), "mine": a})
    assert np.array_equal(vdf.read_exr(path), a)
    assert b"depth.Z" in path.read_bytes() and b"mine.2" in path.read_bytes()


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


def test_arrays_of_all_layouts_are_read():
    rng = np.random.default_rng(8)
    triangles, points, lights = triangles_and_points(rng)
    visibility = vdf.Visibility(np.asfortranarray(triangles), lights[::-1])
    answers = visibility.unoccluded(points)
    assert np.array_equal(answers, visibility.unoccluded(np.asfortranarray(points)))
    assert np.array_equal(answers[::2], visibility.unoccluded(points[::2]))
    assert visibility.unoccluded(np.empty((0, 3))).shape == (0, 3)
    # A point on a triangle sees nothing.
    assert not visibility.unoccluded(triangles[:, 0].astype(np.float64)).any()
    for wrong in (np.zeros((3, 2)), np.array([[0, 0, np.nan]])):
        with pytest.raises(ValueError, match="points"):
            visibility.unoccluded(wrong)
    with pytest.raises(ValueError, match="triangles"):
        vdf.Visibility(np.zeros((1, 2, 3), np.float32), lights)
    with pytest.raises(ValueError, match="triangles: number 0 is not finite"):
        vdf.Visibility(np.full((1, 3, 3), np.inf, np.float32), lights)
    with pytest.raises(IndexError, match="there are 3 lights"):
        visibility.unoccluded(points, light=3)


def test_other_threads_run_meanwhile(scene):
    ticks = []
    done = threading.Event()

    def tick():
        while not done.wait(0.01):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    scene.render(spp=200, method="none")
    end = time.monotonic()
    done.set()
    thread.join()
    # Held, the lock would let none of them come.
    assert sum(start < t < end for t in ticks) >= 2


def test_ctrl_c_stops_a_render(scene):
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        scene.render(spp=10**8)
    # And the scene is as good as before.
    assert scene.render(spp=1).image.max() > 0
