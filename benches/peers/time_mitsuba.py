#!/usr/bin/env python3
"""Render one scene with Mitsuba 3, to be timed from outside.

The whole process is what to compare with `vdf` (start, loading, rendering,
writing), so measure it from outside, for instance with /usr/bin/time -v.
The phases it prints are for understanding only: `import` is Python and
Mitsuba starting, and in an llvm variant `render` holds the compilation.

The depth is --max-depth, -1 for none. The scenes' own rr_depth is 5: with
-1 a path ends by Russian roulette (from the seventh segment on it survives
with probability min(largest throughput, 0.95)), by leaving the scene, or by
a throughput of zero. Give --rr-depth as well if vdf is given one.

Mitsuba's `volpath` decides transmittance to the light by chance (0 or 1),
vdf computes it, so equal --spp is not equal noise.
"""

import time

t0 = time.perf_counter()

import argparse
import sys

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("scene")
parser.add_argument("--variant", default="llvm_ad_rgb")
parser.add_argument("--spp", type=int, default=64)
parser.add_argument("--width", type=int, default=256)
parser.add_argument("--height", type=int, default=256)
parser.add_argument("--max-depth", type=int, default=-1)
parser.add_argument("--rr-depth", type=int, help="default: the scene's")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--out", default="/tmp/time_mitsuba.exr")
args = parser.parse_args()

import drjit as dr
import mitsuba as mi

mi.set_variant(args.variant)
# One pool serves the scalar variants too; the count includes this thread.
dr.set_thread_count(args.threads)
t1 = time.perf_counter()

params = dict(spp=args.spp, width=args.width, height=args.height, max_depth=args.max_depth)
if args.rr_depth is not None:
    params["rr_depth"] = args.rr_depth
scene = mi.load_file(args.scene, **params)
t2 = time.perf_counter()

image = mi.render(scene, seed=args.seed)
if not args.variant.startswith("scalar"):
    dr.eval(image)
    dr.sync_thread()
t3 = time.perf_counter()

# With a pool of one Mitsuba's OpenEXR writer waits for ever (3.9.1, drjit 1.5.0).
dr.set_thread_count(max(args.threads, 2))
mi.Bitmap(image).write(args.out)
t4 = time.perf_counter()

print(
    f"mitsuba {mi.__version__} {args.variant} threads={args.threads} {args.width}x{args.height} spp={args.spp} "
    f"max_depth={args.max_depth}: import {t1 - t0:.3f} load {t2 - t1:.3f} render {t3 - t2:.3f} write {t4 - t3:.3f} s",
    file=sys.stderr,
)
