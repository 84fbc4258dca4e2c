#!/usr/bin/env python3
"""Render the reference images of tests/mitsuba with Mitsuba 3.

For every scene and depth below: many independent seeds of Mitsuba's `volpath`
at 64x64, then per pixel the mean over the seeds and the variance *of that
mean*, both summed in float64 and written as RGB float32 OpenEXR (ZIP):

    references/SCENE_dDEPTH_mean.exr
    references/SCENE_dDEPTH_var.exr

How they were made and the noise reached stand in references/references.json.
See README.md for how to run it and how to compare against them.
"""

import argparse
import datetime
import json
import os
import sys
import time

import drjit
import mitsuba as mi
import numpy as np
import OpenEXR

HERE = os.path.dirname(os.path.abspath(__file__))
SCENES = os.path.normpath(os.path.join(HERE, "..", "..", "scenes"))
SIZE = 64
BLOCK = 8

# (scene, max_depth) -> (seeds, samples per pixel and seed). The median
# relative standard error of an 8x8 block comes to about 0.3 % or less, for
# cbox_vol4 at depth 8 to 0.9 %. Not above 1024 per seed, because Mitsuba sums
# a seed in single precision.
PLAN = {
    ("cbox_vol2", 2): (128, 256),
    ("cbox_vol3", 2): (128, 256),
    ("cbox_vol4", 2): (128, 1024),
    ("cbox_vol6", 2): (128, 256),
    ("cbox_vol2", 8): (128, 256),
    ("cbox_vol3", 8): (64, 256),
    ("cbox_vol4", 8): (256, 1024),
    ("cbox_vol6", 8): (64, 256),
}


def write_exr(path, rgb):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = np.ascontiguousarray(rgb, dtype=np.float32)
    with OpenEXR.File(header, {c: np.ascontiguousarray(pixels[..., i]) for i, c in enumerate("RGB")}) as f:
        f.write(path)


def blocks(image):
    """Mean over BLOCK x BLOCK pixels; leading axes are kept."""
    n = SIZE // BLOCK
    lead = image.shape[:-3]
    return image.reshape(*lead, n, BLOCK, n, BLOCK, 3).mean((-4, -2))


def render(name, depth, seeds, spp):
    scene = mi.load_file(
        os.path.join(SCENES, name + ".xml"),
        width=SIZE, height=SIZE, spp=spp, max_depth=depth, rr_depth=depth,
    )
    images = np.empty((seeds, SIZE, SIZE, 3))  # float64
    for i in range(seeds):
        images[i] = np.array(mi.render(scene, seed=i + 1, spp=spp))
    if not np.isfinite(images).all():
        sys.exit(f"{name} depth {depth}: a pixel is not finite")
    mean = images.mean(0)
    var = images.var(0, ddof=1) / seeds
    # The noise of a block from the blocks of the seeds themselves.
    per_seed = blocks(images)
    error = per_seed.std(0, ddof=1) / np.sqrt(seeds) / per_seed.mean(0)
    whole = images.mean((1, 2, 3))
    return mean, var, error, whole.std(ddof=1) / np.sqrt(seeds) / whole.mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--out", default=os.path.join(HERE, "references"))
    parser.add_argument("--only", metavar="SCENE_dDEPTH", nargs="*", help="only these, for instance cbox_vol2_d8")
    parser.add_argument("--seeds", type=int, help="instead of the plan's; at least 64 for a usable variance")
    parser.add_argument("--spp", type=int, help="per seed, instead of the plan's")
    args = parser.parse_args()

    known = [f"{name}_d{depth}" for name, depth in PLAN]
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

    for (name, depth), (seeds, spp) in PLAN.items():
        key = f"{name}_d{depth}"
        if args.only and key not in args.only:
            continue
        seeds, spp = args.seeds or seeds, args.spp or spp
        start = time.time()
        mean, var, error, whole = render(name, depth, seeds, spp)
        write_exr(os.path.join(args.out, key + "_mean.exr"), mean)
        write_exr(os.path.join(args.out, key + "_var.exr"), var)
        record[key] = {
            "mitsuba": mi.__version__,
            "drjit": drjit.__version__,
            "variant": args.variant,
            "integrator": "volpath",
            "width": SIZE,
            "height": SIZE,
            "max_depth": depth,
            "rr_depth": depth,
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
        r = record[key]
        print(
            f"{key}: {seeds} x {spp} spp, {r['seconds']} s; 8x8 block relative standard error: "
            f"median {np.median(error):.2%}, 95 % {r['block_rel_se_p95']:.2%}, max {r['block_rel_se_max']:.2%}; "
            f"image {whole:.3%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
