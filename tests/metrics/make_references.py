#!/usr/bin/env python3
"""Make the image pairs of tests/metrics and the figures that the peers give for them.

Three pairs of 48x32 pixels: the image and the reference, as half-float EXR or
8-bit PNG. For each pair

    references/figures.json     MSE, MAE, relMSE, PSNR, SSIM, mean FLIP
    references/NAME_maps.exr    the error maps: R is LDR-FLIP, G is HDR-FLIP (0 for PNG), B is 0

FLIP is that of NVIDIA's flip-evaluator, SSIM and PSNR are those of
scikit-image, the rest is numpy in float64. See README.md for how to run it.
"""

import argparse
import importlib.metadata
import json
import os
import subprocess
import tempfile

import flip_evaluator
import numpy as np
import OpenEXR
from PIL import Image
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

HERE = os.path.dirname(os.path.abspath(__file__))
REFERENCES = os.path.join(HERE, "references")
WIDTH, HEIGHT = 48, 32
# flip-evaluator's default (a 0.7 m wide display of 3840 pixels at 0.7 m), and a lower one.
PIXELS_PER_DEGREE = {"default": None, "30": 30.0}


def path(name):
    return os.path.join(REFERENCES, name)


def write_exr(name, rgb):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {c: np.ascontiguousarray(rgb[..., i]) for i, c in enumerate("RGB")}) as f:
        f.write(path(name))


def read_exr(file):
    with OpenEXR.File(file, separate_channels=True) as f:
        return np.stack([f.channels()[c].pixels for c in "RGB"], -1).astype(np.float32)


def read(name):
    """Linear float32 for EXR, encoded float32 in [0, 1] for PNG."""
    if name.endswith(".exr"):
        return read_exr(path(name))
    return np.asarray(Image.open(path(name)), np.float32) / np.float32(255)


def make_noise(vdf):
    """Two renders of one scene, with few samples and with many."""
    with tempfile.TemporaryDirectory() as folder:
        for name, spp in (("image", 4), ("reference", 1024)):
            out = os.path.join(folder, "out.exr")
            size = ["-D", f"width={WIDTH}", "-D", f"height={HEIGHT}"]
            subprocess.run([vdf, "render", "cbox_vol2", *size, "--spp", str(spp), "-q", "-o", out], check=True)
            write_exr(f"noise_{name}.exr", read_exr(out).astype(np.float16))


def make_edges():
    """Saturated stripes, discs and a text-like pattern, and the same blurred and shifted in hue; PNG."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    palette = np.array([[0, 0, 255], [255, 255, 0], [255, 0, 0], [0, 255, 0], [255, 255, 255], [0, 0, 0]], float)
    image = palette[(x // 8).astype(int) % 6]
    disc = np.hypot(x - 23.5, y - 15.5) < 9
    image[disc] = palette[((x + 2 * y) // 3).astype(int) % 6][disc]
    image[(y > 26) & ((x.astype(int) ^ y.astype(int)) & 2 == 0)] = 128
    blurred = image.copy()
    for axis in (0, 1):
        blurred = (np.roll(blurred, 1, axis) + 2 * blurred + np.roll(blurred, -1, axis)) / 4
    left = x < WIDTH / 2
    blurred[left] = 0.9 * blurred[left] + 0.1 * blurred[left][:, [1, 2, 0]]
    Image.fromarray(np.rint(blurred).astype(np.uint8)).save(path("edges_image.png"), optimize=True)
    Image.fromarray(image.astype(np.uint8)).save(path("edges_reference.png"), optimize=True)


def make_highlights():
    """A dark gradient with highlights of 100; the other has them moved, dimmed and some speckle added."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    base = 0.02 * np.exp2(4 * x / WIDTH)[..., None] * np.array([1.0, 0.7, 0.4]) * (1 + 0.5 * np.sin(y / 4))[..., None]

    def lights(dx, gain):
        out = base.copy()
        for cx, cy, colour in ((10, 8, (100, 100, 100)), (30, 20, (100, 60, 10)), (40, 6, (5, 20, 100))):
            out += gain * np.exp(-((x - cx - dx) ** 2 + (y - cy) ** 2) / 3)[..., None] * np.array(colour, float)
        return out

    image = lights(0.5, 0.8)
    speckle = np.random.Generator(np.random.PCG64(7)).integers(0, 40, (HEIGHT, WIDTH)) == 0
    image[speckle] *= 6
    write_exr("highlights_image.exr", image.astype(np.float16))
    write_exr("highlights_reference.exr", lights(0, 1).astype(np.float16))


def srgb_encode(x):
    x = np.clip(x, 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def srgb_decode(x):
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def flip(image, reference, dynamic_range, srgb, pixels_per_degree):
    parameters = {} if pixels_per_degree is None else {"ppd": pixels_per_degree}
    error, _, used = flip_evaluator.evaluate(
        np.ascontiguousarray(reference), np.ascontiguousarray(image), dynamic_range, srgb, False, True, parameters
    )
    return error[..., 0], used


def figures(name, extension):
    stored = [read(f"{name}_{role}.{extension}") for role in ("image", "reference")]
    hdr = extension == "exr"
    linear = [s.astype(np.float64) if hdr else srgb_decode(s.astype(np.float64)) for s in stored]
    encoded = [srgb_encode(l) if hdr else s.astype(np.float64) for l, s in zip(linear, stored)]
    displayed = [np.clip(s, 0, 1) for s in stored]
    (a, b), (image, reference) = linear, encoded
    squared = (a - b) ** 2
    out = {
        "name": name,
        "image": f"{name}_image.{extension}",
        "reference": f"{name}_reference.{extension}",
        "mse": squared.mean(),
        "mae": np.abs(a - b).mean(),
        "relmse": (squared / (b**2 + 0.01 * b.mean() ** 2)).mean(),
        "psnr": peak_signal_noise_ratio(reference, image, data_range=1),
        "ssim": structural_similarity(
            reference,
            image,
            channel_axis=2,
            data_range=1,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
        ),
        "flip_ldr": {},
    }
    maps = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    for key, ppd in PIXELS_PER_DEGREE.items():
        error, _ = flip(*displayed, "LDR", not hdr, ppd)
        out["flip_ldr"][key] = error.mean(dtype=np.float64)
        if ppd is None:
            maps[..., 0] = error
    if hdr:
        out["flip_hdr"] = {}
        for key, ppd in PIXELS_PER_DEGREE.items():
            error, used = flip(*stored, "HDR", False, ppd)
            out["flip_hdr"][key] = error.mean(dtype=np.float64)
            if ppd is None:
                maps[..., 1] = error
                out["exposures"] = [used["startExposure"], used["stopExposure"], used["numExposures"]]
    write_exr(f"{name}_maps.exr", maps)
    return {k: float(v) if isinstance(v, np.floating) else v for k, v in out.items()}


def colours():
    """[error, red, green, blue] of some pixels of an error map, the colours as bytes."""
    pair = [np.ascontiguousarray(read(f"edges_{role}.png")) for role in ("reference", "image")]
    error = flip_evaluator.evaluate(*pair, "LDR", True, False, False)[0].reshape(-1)
    colour = np.rint(flip_evaluator.evaluate(*pair, "LDR", True, True, False)[0].reshape(-1, 3) * 255).astype(int)
    some = np.argsort(error)[:: error.size // 24]
    return [[float(error[i]), *map(int, colour[i])] for i in some]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vdf", metavar="PROGRAM", help="render the pair `noise` again with this vdf")
    arguments = parser.parse_args()
    os.makedirs(REFERENCES, exist_ok=True)
    if arguments.vdf:
        make_noise(arguments.vdf)
    make_edges()
    make_highlights()
    pairs = [figures("noise", "exr"), figures("edges", "png"), figures("highlights", "exr")]
    versions = {p: importlib.metadata.version(p) for p in ("flip-evaluator", "scikit-image", "numpy")}
    with open(path("figures.json"), "w") as f:
        json.dump({"made_with": versions, "pairs": pairs, "colours": colours()}, f, indent=2)
        f.write("\n")


if __name__ == "__main__":
    main()
