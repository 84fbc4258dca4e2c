#!/usr/bin/env python3
"""Render one scene with Mitsuba 3, once for each seed, and print as JSON what took how long.

compare.py starts this as a process of its own, so that it can time the whole: start, loading, rendering, writing, as it times
vdf. Of the phases, `import` is Python and Mitsuba starting, and in an llvm variant `render` holds the tracing and the loading
(in the very first run: the compilation) of the kernel.

The depth is --max-depth, -1 for none. With -1 a path ends by Russian roulette, by leaving the scene, or by a throughput of zero.
"""

import time

t0 = time.perf_counter()

import argparse
import json

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("scene")
parser.add_argument("--variant", default="llvm_ad_rgb")
parser.add_argument("--spp", type=int, default=64)
parser.add_argument("--size", type=int, nargs=2, default=[256, 256], metavar=("WIDTH", "HEIGHT"))
parser.add_argument("--max-depth", type=int, default=-1)
parser.add_argument("--rr-depth", type=int, default=5)
parser.add_argument("--seeds", type=int, nargs="+", default=[0])
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--out", required=True, nargs="+", help="an EXR for each seed")
args = parser.parse_args()
if len(args.out) != len(args.seeds):
    parser.error("--out must name a file for each seed")

import drjit as dr
import mitsuba as mi

mi.set_variant(args.variant)
# One pool serves the scalar variants too; the count includes this thread.
dr.set_thread_count(args.threads)
t1 = time.perf_counter()

width, height = args.size
scene = mi.load_file(args.scene, spp=args.spp, width=width, height=height, max_depth=args.max_depth, rr_depth=args.rr_depth)
t2 = time.perf_counter()

images, seconds = [], []
for seed in args.seeds:
    start = time.perf_counter()
    image = mi.render(scene, seed=seed)
    if not args.variant.startswith("scalar"):
        dr.eval(image)
        dr.sync_thread()
    seconds.append(time.perf_counter() - start)
    images.append(image)
t3 = time.perf_counter()

# With a pool of one Mitsuba's OpenEXR writer waits for ever (3.9.1, drjit 1.5.0).
dr.set_thread_count(max(args.threads, 2))
for image, path in zip(images, args.out):
    mi.Bitmap(image).write(path)
t4 = time.perf_counter()

phases = {"import": t1 - t0, "load": t2 - t1, "render": seconds, "write": t4 - t3}
print(json.dumps({"mitsuba": mi.__version__, "drjit": dr.__version__, **phases}))
