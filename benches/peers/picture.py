#!/usr/bin/env python3
"""Mitsuba 3 and vdf beside each other, after the same time of the processor.

    python picture.py --vdf ../../target/release/vdf --out beside.png cbox_vol2.xml

Mitsuba renders with --spp samples per pixel; vdf, whose defaults are used, with as many as take it as long. Both have whole processes timed, on all their threads, less what each
takes for one sample, so that only rendering counts; the second number is printed, too. The left half of the picture is Mitsuba's, the right one vdf's; both are whole renders.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent


def processor_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--vdf", required=True)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--size", type=int, nargs=2, default=[320, 240], metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--max-depth", type=int, default=-1)
    parser.add_argument("--threads", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, required=True, help="a PNG")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        theirs, ours = Path(folder) / "mitsuba.exr", Path(folder) / "vdf.exr"

        def mitsuba(spp):
            size = ["--size", *args.size, "--max-depth", args.max_depth, "--threads", args.threads]
            script = [sys.executable, HERE / "render_mitsuba.py", args.scene, "--variant", args.variant]
            return processor_seconds([*script, "--spp", spp, *size, "--out", theirs])

        def vdf(spp):
            defines = {"width": args.size[0], "height": args.size[1], "max_depth": args.max_depth}
            words = [word for name, value in defines.items() for word in ("-D", f"{name}={value}")]
            return processor_seconds([args.vdf, "render", args.scene, "--spp", spp, "-j", args.threads, "-q", "-o", ours, *words])

        # Once without a clock: Mitsuba compiles its kernels.
        mitsuba(args.spp)
        seconds = mitsuba(args.spp) - mitsuba(1)
        one = vdf(1)
        trial = 4 * args.spp
        spp = max(1, round(seconds / (vdf(trial) - one) * (trial - 1)))
        taken = vdf(spp) - one
        mitsuba(args.spp)
        print(f"Mitsuba {args.variant}: {args.spp} samples per pixel in {seconds:.2f} s; vdf: {spp} in {taken:.2f} s")
        write(theirs, ours, args.out)


def write(left, right, out):
    """Both pictures in sRGB, with a line between them."""
    import mitsuba as mi
    import numpy as np

    mi.set_variant("scalar_rgb")
    pixels = []
    for path in (left, right):
        bitmap = mi.Bitmap(str(path)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, srgb_gamma=True)
        pixels.append(np.array(bitmap))
    line = np.full((pixels[0].shape[0], 4, 3), 255, dtype=np.uint8)
    mi.Bitmap(np.hstack([pixels[0], line, pixels[1]])).write(str(out))


if __name__ == "__main__":
    main()
