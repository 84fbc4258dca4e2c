#!/usr/bin/env python3
"""Render the reference images of tests/mitsuba with Mitsuba 3.

For every scene and depth below: many independent seeds of Mitsuba's `volpath`,
then the mean over the seeds and the variance *of that mean*, both summed in
float64 and written as RGB float32 OpenEXR (ZIP):

    references/SCENE_dDEPTH_mean.exr
    references/SCENE_dDEPTH_var.exr

The built-in scenes (../../scenes) are kept pixel by pixel at 64x64, those of
scenes/ as 8x8 means over blocks. A depth of -1 is no limit. How they were made
and the noise reached stand in references/references.json. See README.md for
how to run it and how to compare against them.
"""

import argparse
import datetime
import json
import os
import sys
import time
from typing import NamedTuple

import drjit
import mitsuba as mi
import numpy as np
import OpenEXR

HERE = os.path.dirname(os.path.abspath(__file__))
BUILT_IN = os.path.normpath(os.path.join(HERE, "..", "..", "scenes"))
OWN = os.path.join(HERE, "scenes")
GRID = 8  # blocks along each side


class Case(NamedTuple):
    scene: str
    depth: int
    seeds: int
    spp: int  # of one seed
    folder: str = OWN
    # Columns and rows that are dropped on every side of the film.
    border: int = 0
    # With any other filter than a box, pixels share samples.
    pixels_are_independent: bool = True

    @property
    def key(self):
        return f"{self.scene}_d{self.depth}"

    @property
    def keeps_pixels(self):
        return self.folder == BUILT_IN

    @property
    def rr_depth(self):
        return self.depth if self.depth > 0 else 5

    @property
    def size(self):
        """Of the film, for the scenes that have it as a parameter."""
        return 64 if self.keeps_pixels else 48


# The median relative standard error of a block comes to about 0.5 % or less,
# for cbox_vol4 at depth 8 to several per cent: only its mean is compared. Not above 1024 samples per seed, because
# Mitsuba sums a seed in single precision.
PLAN = [
    Case("cbox_vol2", 2, 64, 64, BUILT_IN),
    Case("cbox_vol3", 2, 64, 64, BUILT_IN),
    Case("cbox_vol4", 2, 64, 512, BUILT_IN),
    Case("cbox_vol6", 2, 64, 64, BUILT_IN),
    Case("cbox_vol2", 8, 64, 128, BUILT_IN),
    Case("cbox_vol3", 8, 64, 128, BUILT_IN),
    Case("cbox_vol4", 8, 64, 256, BUILT_IN),
    Case("cbox_vol6", 8, 64, 512, BUILT_IN),
    Case("area_light", 2, 128, 256),
    Case("area_light", 8, 128, 256),
    Case("sky", 3, 128, 256),
    Case("sky", -1, 128, 256),
    Case("forward", 3, 128, 256),
    Case("forward", -1, 128, 256),
    Case("backward", 2, 128, 256),
    Case("backward", 8, 128, 256),
    Case("outside", 2, 128, 256),
    Case("outside", 8, 128, 256),
    Case("touching", 3, 128, 256),
    Case("touching", -1, 128, 256),
    Case("nested", 2, 128, 256),
    Case("nested", -1, 128, 256),
    Case("rock", 2, 128, 256),
    Case("rock", 8, 128, 256),
    Case("cropped", 3, 128, 256, border=4, pixels_are_independent=False),
    Case("curved", 8, 64, 128),
    Case("textures", 8, 64, 128),
    Case("grids", 8, 64, 128),
    Case("colours", 8, 64, 128),
    Case("metals_and_coats", -1, 64, 256),
    Case("glass_blocks", -1, 64, 256),
    Case("disney", 8, 64, 256),
    Case("turned", 4, 64, 128),
]


def write_exr(path, rgb):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = np.ascontiguousarray(rgb, dtype=np.float32)
    with OpenEXR.File(header, {c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate("RGB")}) as f:
        f.write(path)


def blocks(image):
    """Mean over the blocks; leading axes are kept."""
    *lead, height, width, _ = image.shape
    return image.reshape(*lead, GRID, height // GRID, GRID, width // GRID, 3).mean((-4, -2))


def render(case, seeds, spp):
    parameters = {"spp": spp, "max_depth": case.depth, "rr_depth": case.rr_depth}
    if case.border == 0:
        parameters |= {"width": case.size, "height": case.size}
    scene = mi.load_file(os.path.join(case.folder, case.scene + ".xml"), **parameters)
    rows, columns = (slice(case.border, n - case.border) for n in reversed(scene.sensors()[0].film().crop_size()))
    images = np.stack([np.array(mi.render(scene, seed=i + 1, spp=spp))[rows, columns] for i in range(seeds)], dtype=np.float64)
    if not np.isfinite(images).all():
        sys.exit(f"{case.key}: a pixel is not finite")
    return images


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--out", default=os.path.join(HERE, "references"))
    parser.add_argument("--only", metavar="SCENE_dDEPTH", nargs="*", help="only these, for instance cbox_vol2_d8")
    parser.add_argument("--seeds", type=int, help="instead of the plan's; at least 64 for a usable variance")
    parser.add_argument("--spp", type=int, help="per seed, instead of the plan's")
    args = parser.parse_args()

    known = [case.key for case in PLAN]
    for wanted in args.only or []:
        if wanted not in known:
            parser.error(f"{wanted}: not one of {', '.join(known)}")

    mi.set_variant(args.variant)
    os.makedirs(args.out, exist_ok=True)
    record_path = os.path.join(args.out, "references.json")
    record = {}
    if os.path.exists(record_path):
        with open(record_path) as f:
            record = json.load(f)

    for case in PLAN:
        if args.only and case.key not in args.only:
            continue
        seeds, spp = args.seeds or case.seeds, args.spp or case.spp
        start = time.time()
        images = render(case, seeds, spp)
        _, height, width, _ = images.shape
        per_seed = blocks(images)
        mean, var = images.mean(0), images.var(0, ddof=1) / seeds
        if not case.keeps_pixels:
            mean = blocks(mean)
            if case.pixels_are_independent:
                # The variance of a mean of n is the sum of theirs over n²: known better than from the blocks of the seeds.
                var = blocks(var) * GRID * GRID / (width * height)
            else:
                var = per_seed.var(0, ddof=1) / seeds
        write_exr(os.path.join(args.out, case.key + "_mean.exr"), mean)
        write_exr(os.path.join(args.out, case.key + "_var.exr"), var)
        # The noise of a block from the blocks of the seeds themselves; black ones have none.
        lit = per_seed.mean(0) > 0
        error = (per_seed.std(0, ddof=1) / np.sqrt(seeds))[lit] / per_seed.mean(0)[lit]
        whole = images.mean((1, 2, 3))
        whole = whole.std(ddof=1) / np.sqrt(seeds) / whole.mean()
        record[case.key] = {
            "mitsuba": mi.__version__,
            "drjit": drjit.__version__,
            "variant": args.variant,
            "integrator": "volpath",
            "width": width,
            "height": height,
            "max_depth": case.depth,
            "rr_depth": case.rr_depth,
            "seeds": f"1..{seeds}",
            "spp_per_seed": spp,
            "block_rel_se_median": float(f"{np.median(error):.3g}"),
            "block_rel_se_p95": float(f"{np.percentile(error, 95):.3g}"),
            "block_rel_se_max": float(f"{error.max():.3g}"),
            "image_rel_se": float(f"{whole:.3g}"),
            "seconds": round(time.time() - start, 1),
            "command": " ".join(["make_references.py", *sys.argv[1:]]),
            "date": datetime.datetime.now(datetime.timezone.utc).strftime("%Y-%m-%d"),
        }
        with open(record_path, "w") as f:
            json.dump(record, f, indent=2)
            f.write("\n")
        r = record[case.key]
        print(
            f"{case.key}: {seeds} x {spp} spp, {r['seconds']} s; block relative standard error: "
            f"median {np.median(error):.2%}, 95 % {r['block_rel_se_p95']:.2%}, max {r['block_rel_se_max']:.2%}; "
            f"image {whole:.3%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
