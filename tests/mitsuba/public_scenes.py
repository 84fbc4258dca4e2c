#!/usr/bin/env python3
"""Try the Mitsuba 3 scenes of a folder that you name: which of them vdf loads, unedited, and what each of the others lacks.

    public_scenes.py FOLDER...                  a table: loads, or everything that is missing
    public_scenes.py --compare FOLDER...        and a z-test against Mitsuba for each scene that loads

The folder is not part of this project; clone it from where it is published, for instance

    git clone --depth 1 https://github.com/mitsuba-renderer/mitsuba-data

Files without a sensor of their own are parts of other scenes and are only counted.

The comparison renders both with the same settings, those of the file, and --seeds seeds of --spp samples each. The film is cut into 8 x 8 blocks of
three channels; z = (ours - theirs) / sqrt(variance of both means), the variances from the seeds. Blocks that are black in both are left out, and
those whose reference has a relative standard error above 1 % as well. With n seeds z follows a t distribution with about 2 (n - 1) degrees of freedom; "by chance" is
what that expects beyond 3, if blocks were independent (the three channels of one are not). A scene fails if a block is beyond 6, the mean z^2 is above 1 + 6 sqrt(6 / blocks), where three
channels count as one, or the whole image is beyond 5: by chance less than once in 10,000 scenes.

Loading needs Python alone; --compare needs requirements.txt.
"""

import argparse
import math
import os
import re
import subprocess
import sys
import tempfile

GRID = 8  # blocks along each side
ROOT = os.path.normpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))


def scenes_below(folder):
    """The XML files with <scene> as their root that no other one includes, and how many others there are."""
    texts = {}
    for path, folders, files in os.walk(folder):
        folders.sort()
        for name in sorted(files):
            if name.endswith(".xml"):
                with open(os.path.join(path, name), encoding="utf-8", errors="replace") as f:
                    text = re.sub(r"<!--.*?-->", "", f.read(), flags=re.S)
                if re.match(r"\s*(<\?xml.*?\?>\s*)?<scene\b", text, flags=re.S):
                    texts[os.path.join(path, name)] = text
    # Relative to the including file, to the scene, or to a folder of a <path>: the end of the path is what they share.
    included = {os.path.normpath(name) for text in texts.values() for name in re.findall(r"""<include\s+filename=["']([^"']+)""", text)}
    found = [path for path in texts if not any(("/" + path).endswith("/" + name) for name in included)]
    return found, len(texts) - len(found)


def render(vdf, scene, out, seed=None, spp=1, crop=None):
    command = [vdf, "render", scene, "--spp", str(spp), "-o", out]
    if crop is not None:
        command += ["--crop", crop]
    if seed is not None:
        command += ["--seed", str(seed)]
    return subprocess.run(command, capture_output=True, text=True, timeout=3600)


def what_is_missing(stderr):
    """The message of the error, on one line, without the folder and the help."""
    lines = [line for line in stderr.splitlines() if line.startswith("error:")]
    message = lines[0] if lines else stderr.strip().splitlines()[-1]
    return re.sub(r"^error: (.*?:\d+:\d+: )?", "", message)


def blocks(image):
    """Means over 8 x 8 blocks as even as the size allows."""
    import numpy as np

    rows = [band.mean(0) for band in np.array_split(image, GRID, axis=0)]
    return np.stack([np.stack([part.mean(0) for part in np.array_split(row, GRID, axis=0)]) for row in rows])


def beyond(limit, freedom):
    """The share of a t distribution outside of [-limit, limit]."""
    density = lambda t: (1 + t * t / freedom) ** (-(freedom + 1) / 2)
    steps = 20000
    inside = sum(density((i + 0.5) * limit / steps) for i in range(steps)) * limit / steps
    outside = sum(density(limit + (i + 0.5) * 100 / steps) for i in range(steps)) * 100 / steps
    return outside / (inside + outside)


def compare(args, scene):
    """The cells of the table for a scene that loads, and whether it passes."""
    import mitsuba as mi
    import numpy as np
    import OpenEXR

    if mi.variant() is None:
        mi.set_variant(args.variant)
    reference = mi.load_file(scene)
    ours, theirs = [], []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(args.seeds):
            out = os.path.join(folder, "ours.exr")
            done = render(args.vdf, scene, out, seed + 1, args.spp)
            if done.returncode != 0:
                return [what_is_missing(done.stderr)] + [""] * 5, False
            with OpenEXR.File(out) as f:
                channels = f.channels()
                rgb = channels["RGB"].pixels if "RGB" in channels else np.stack([channels[c].pixels for c in "RGB"], -1)
            ours.append(blocks(np.asarray(rgb, dtype=np.float64)))
            theirs.append(blocks(np.array(mi.render(reference, seed=seed + 1, spp=args.spp), dtype=np.float64)[..., :3]))
    ours, theirs = np.stack(ours), np.stack(theirs)
    n = args.seeds

    def z_of(a, b):
        return (a.mean(0) - b.mean(0)) / np.sqrt((a.var(0, ddof=1) + b.var(0, ddof=1)) / n)

    error = theirs.std(0, ddof=1) / math.sqrt(n)
    kept = (theirs.mean(0) > 0) & (error <= 0.01 * theirs.mean(0))
    if not kept.any():
        return ["no block is known to 1 %", "", "", "", "", ""], False
    with np.errstate(divide="ignore", invalid="ignore"):
        z = z_of(ours, theirs)
    # Blocks that see only the background have no noise; single precision may round them apart.
    exact = (ours.var(0) <= 1e-12 * ours.mean(0) ** 2) & (abs(ours.mean(0) - theirs.mean(0)) <= 1e-5 * theirs.mean(0))
    z[np.isnan(z) | exact] = 0
    z = z[kept]
    whole = z_of(ours.mean((1, 2, 3)), theirs.mean((1, 2, 3)))
    ratio = ours.mean() / theirs.mean()
    limit = 1 + 6 * math.sqrt(6 / z.size)
    passes = abs(z).max() < 6 and (z * z).mean() < limit and abs(whole) < 5
    chance = beyond(3, 2 * (n - 1)) * z.size
    cells = [f"{z.size}", f"{(abs(z) > 3).sum()} ({chance:.1f} by chance)", f"{abs(z).max():.2f}", f"{(z * z).mean():.2f} ({limit:.2f})", f"{ratio:.4f}", f"{whole:+.2f}"]
    return cells, passes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", metavar="FOLDER")
    parser.add_argument("--vdf", default=os.path.join(ROOT, "target", "release", "vdf"), help="the program [default: target/release/vdf]")
    parser.add_argument("--compare", action="store_true", help="z-test against Mitsuba")
    parser.add_argument("--variant", default="scalar_rgb", help="of Mitsuba [default: scalar_rgb]")
    parser.add_argument("--seeds", type=int, default=32)
    parser.add_argument("--spp", type=int, default=64, help="of one seed")
    args = parser.parse_args()
    if args.seeds < 8:
        parser.error("--seeds: fewer than 8 give no usable variance")

    loaded, failed, tried, parts = [], False, 0, 0
    print("| scene | loads | what it lacks |\n| --- | --- | --- |")
    for folder in args.folders:
        if not os.path.exists(folder):
            sys.exit(f"{folder}: there is no such folder")
        scenes, without_sensor = ([folder], 0) if os.path.isfile(folder) else scenes_below(folder)
        parts += without_sensor
        for scene in scenes:
            with tempfile.TemporaryDirectory() as out:
                done = render(args.vdf, scene, os.path.join(out, "a.exr"), crop="0,0,1,1")
            if done.returncode != 0 and "has no sensor" in done.stderr:
                parts += 1
                continue
            tried += 1
            if done.returncode == 0:
                loaded.append(scene)
            lacks = "" if done.returncode == 0 else what_is_missing(done.stderr).replace("|", "\\|")
            print(f"| `{scene}` | {'yes' if done.returncode == 0 else 'no'} | {lacks} |", flush=True)
    print(f"\n{len(loaded)} of {tried} scenes load; {parts} files are parts of scenes, without a sensor.")

    if args.compare and loaded:
        print(f"\n{args.seeds} seeds of {args.spp} samples a pixel each.\n")
        print("| scene | blocks × channels | beyond 3σ | worst, σ | mean z² (its limit) | ours/theirs | its z |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for scene in loaded:
            cells, passes = compare(args, scene)
            failed |= not passes
            print(f"| `{scene}` | {' | '.join(cells)} |{'' if passes else ' **fails**'}", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
