#!/usr/bin/env python3
"""CPU time times variance of Mitsuba 3 and vdf on several scene files, in one run: how much longer one takes for the same noise.

    python efficiency.py --vdf ../../target/release/vdf scene.xml ...

For each scene both render --seeds pictures of --spp samples, in turns; scene files take parameters for the size of the film (width and height, or --film). Time is the CPU time of rendering: for Mitsuba that of
its process around mi.render, after a first picture that compiles; for vdf user and system time of a process less that of one with a single sample, so that neither
loads. What is compared is what a user gets: vdf with its defaults, one variant of Mitsuba. The noise is the mean over pixels and channels of the variance of the pictures over
(mean² + 0.01 mean(mean)²), which needs no reference as neither is biased; the means are printed, too. The rows are medians of the times and the noise of all seeds. With few seeds the
noise of a scene with fireflies (point lights in fog) is itself noisy: --trim leaves out that share of the pixels that are noisiest. The last two columns are the same ratio for the mean squared
error, of the pixels that are kept and of all: that of relative noise counts dark pixels as much as bright ones.
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("scenes", nargs="+", metavar="SCENE.xml")
parser.add_argument("--vdf", required=True)
parser.add_argument("--variant", default="llvm_ad_rgb")
parser.add_argument("--size", type=int, default=64, help="width and height of the film")
parser.add_argument("--film", default="width,height", help="the scenes' parameters for them, where they are called otherwise")
parser.add_argument("--spp", type=int, default=64)
parser.add_argument("--seeds", type=int, default=5)
parser.add_argument("--threads", type=int, default=2)
parser.add_argument("--trim", type=float, default=0.01)
args = parser.parse_args()

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR

mi.set_variant(args.variant)
mi.set_log_level(mi.LogLevel.Error)
dr.set_thread_count(args.threads)


def ours(scene, seed, spp, out):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [args.vdf, "render", scene, "--spp", str(spp), "--seed", str(seed), "-j", str(args.threads), "-q", "-o", out]
    for name in args.film.split(","):
        command += ["-D", f"{name}={args.size}"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{done.stderr}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    with OpenEXR.File(out) as f:
        channels = f.channels()
        rgb = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
    return np.asarray(rgb, dtype=np.float64), after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def theirs(scene, seed, spp):
    start = time.process_time()
    image = np.array(mi.render(scene, seed=seed, spp=spp), dtype=np.float64)[..., :3]
    return image, time.process_time() - start


def noise(images):
    images = np.stack(images)
    mean = images.mean(0)
    variance = images.var(0, ddof=1)
    relative, squared = (np.sort(v.mean(-1).ravel()) for v in (variance / (mean**2 + 0.01 * mean.mean() ** 2), variance))
    kept = max(1, round(len(relative) * (1 - args.trim)))
    return np.array([relative[:kept].mean(), squared[:kept].mean(), squared.mean()])


print(f"{args.size} x {args.size}, {args.spp} samples, {args.seeds} seeds, {args.variant}; vdf {args.vdf}\n")
print("| scene | CPU s, Mitsuba | vdf | noise, Mitsuba | vdf | mean, vdf/Mitsuba | CPU s × noise, Mitsuba/vdf | × squared error | of all pixels |")
print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
for path in args.scenes:
    scene = mi.load_file(path, **{name: args.size for name in args.film.split(",")})
    theirs(scene, 0, args.spp)
    with tempfile.TemporaryDirectory() as folder:
        out = os.path.join(folder, "a.exr")
        pictures, seconds, idle = {"m": [], "v": []}, {"m": [], "v": []}, []
        for seed in range(1, args.seeds + 1):
            for who in ("mv", "vm")[seed % 2]:
                image, t = theirs(scene, seed, args.spp) if who == "m" else ours(path, seed, args.spp, out)
                pictures[who].append(image)
                seconds[who].append(t)
            idle.append(ours(path, seed, 1, out)[1])
    m = statistics.median(seconds["m"])
    # The process with one sample has rendered that.
    v = (statistics.median(seconds["v"]) - statistics.median(idle)) * args.spp / (args.spp - 1)
    ratio = np.mean(pictures["v"]) / np.mean(pictures["m"])
    nm, nv = noise(pictures["m"]), noise(pictures["v"])
    name = os.path.splitext(os.path.basename(path))[0]
    print(f"| `{name}` | {m:.2f} | {v:.2f} | {nm[0]:.3g} | {nv[0]:.3g} | {ratio:.3f} | {' | '.join(f'{x:.1f}' for x in m * nm / (v * nv))} |", flush=True)
