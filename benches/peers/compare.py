#!/usr/bin/env python3
"""Time and error of Mitsuba 3 and vdf on the same scene files, in one run.

    python compare.py --vdf ../../target/release/vdf --out results cbox_vol2.xml cbox_vol4.xml

The renderers take turns, in every other round backwards, with the same size, samples, depth, filter and threads. Errors are against one
reference: the mean of a long render by Mitsuba and a long one by vdf, which first have to agree. Exit code 1 if they do not, if a renderer's
mean differs from the other program's reference, or if the methods of vdf do not give the same image. See README.md for what each column is.
"""

import argparse
import csv
import json
import os
import platform
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
import OpenEXR

HERE = Path(__file__).resolve().parent
TARGET = 1e-2  # relMSE to reach
TRIMMED = 0.01  # share of the pixels with the largest errors that the robust figure leaves out
BLOCKS = 8  # along each side, where the references are compared
# A bias is reported below this p-value: with ten tests a scene one false alarm in a thousand scenes.
ALARM = 1e-4
TIMEOUT = 4 * 3600.0


class Renderer(NamedTuple):
    name: str
    program: str  # "mitsuba" or "vdf"
    variant: str  # of Mitsuba, or method of vdf
    way: str  # how vdf looks for light

    @property
    def other(self):
        return "vdf" if self.program == "mitsuba" else "mitsuba"


# Mitsuba's volpath draws distances by the transmittance alone, decides by chance whether light arrives through the fog, and draws all numbers
# independently. So does vdf in the way "alike"; the other is its default.
WAYS = {"alike": "--transmittance analog --estimator thesis --sampler independent".split(), "default": []}


def renderers(variants, methods):
    mitsuba = [Renderer(f"mitsuba {v}", "mitsuba", v, "") for v in variants]
    return mitsuba + [Renderer(f"vdf {m}, {way}", "vdf", m, way) for way in WAYS for m in methods]


class Job(NamedTuple):
    scene: Path
    size: int
    max_depth: int
    rr_depth: int
    threads: int
    vdf: str
    folder: Path


def run(command):
    """Seconds of the whole process, and what it printed."""
    start = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    seconds = time.perf_counter() - start
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\nfailed with exit code {done.returncode}:\n{done.stderr}")
    return seconds, done.stdout


def read(path):
    with OpenEXR.File(str(path)) as f:
        channels = f.channels()
        if "RGB" in channels:
            image = channels["RGB"].pixels
        else:
            image = np.stack([channels[c].pixels for c in "RGB"], -1)
    image = np.asarray(image, dtype=np.float64)
    if not np.isfinite(image).all():
        sys.exit(f"{path}: a pixel is not finite")
    return image


def render(job, renderer, spp, seeds):
    """Renders once for each seed: images, seconds of all of the process, seconds of rendering for each."""
    paths = [job.folder / f"{job.scene.stem}-{renderer.name.replace(' ', '_').replace(',', '')}-{spp}-{s}.exr" for s in seeds]
    if renderer.program == "mitsuba":
        whole, out = run(
            [sys.executable, HERE / "render_mitsuba.py", job.scene, "--variant", renderer.variant, "--spp", str(spp)]
            + ["--size", str(job.size), str(job.size), "--max-depth", str(job.max_depth), "--rr-depth", str(job.rr_depth)]
            + ["--threads", str(job.threads), "--seeds", *map(str, seeds), "--out", *paths]
        )
        # Mitsuba's own messages may come before.
        seconds = json.loads(out.strip().splitlines()[-1])["render"]
    else:
        whole, seconds = 0.0, []
        for seed, path in zip(seeds, paths):
            stats = path.with_suffix(".json")
            defines = {"width": job.size, "height": job.size, "max_depth": job.max_depth, "rr_depth": job.rr_depth}
            whole += run(
                [job.vdf, "render", job.scene, "--method", renderer.variant, *WAYS[renderer.way]]
                + ["--spp", str(spp), "--seed", str(seed), "-j", str(job.threads), "-q", "-o", path, "--stats", stats]
                + [word for name, value in defines.items() for word in ("-D", f"{name}={value}")]
            )[0]
            seconds.append(json.loads(stats.read_text())["t_render"])
            stats.unlink()
            path.with_suffix(".png").unlink()
    images = np.stack([read(p) for p in paths])
    for p in paths:
        p.unlink()
    return images, whole, seconds


class Reference:
    """A long render: mean, variance of the mean of each value, and means of its parts."""

    def __init__(self, images):
        self.images = len(images)
        self.mean = images.mean(0)
        self.variance = images.var(0, ddof=1) / len(images)
        self.means = images.mean((1, 2, 3))
        n, height, width, _ = images.shape
        rows, columns = height // BLOCKS * BLOCKS, width // BLOCKS * BLOCKS
        blocks = images[:, :rows, :columns].reshape(n, BLOCKS, rows // BLOCKS, BLOCKS, columns // BLOCKS, 3)
        self.blocks = blocks.mean((2, 4, 5))


def p_value(t, freedom):
    """Probability that |Student's t| is larger: the integral of the density, with x = tan(angle)."""
    angle = np.linspace(np.arctan(abs(t) / np.sqrt(freedom)), np.pi / 2, 20001)
    density = np.cos(angle) ** (freedom - 1)
    whole = np.linspace(0, np.pi / 2, 20001)
    return float(np.trapezoid(density, angle) / np.trapezoid(np.cos(whole) ** (freedom - 1), whole))


def compared(a, b):
    """Welch's test of two samples along their first axis: relative difference of the means, z, p-value."""
    va, vb = a.var(0, ddof=1) / len(a), b.var(0, ddof=1) / len(b)
    z = (a.mean(0) - b.mean(0)) / np.sqrt(va + vb)
    relative = a.mean(0) / b.mean(0) - 1
    if np.ndim(z):
        return relative, z, None
    freedom = (va + vb) ** 2 / (va**2 / (len(a) - 1) + vb**2 / (len(b) - 1))
    return float(relative), float(z), p_value(z, freedom)


def relative_errors(image, reference):
    """Mean of the relative squared errors of each pixel, as `vdf compare` defines them."""
    floor = 1e-2 * reference.mean() ** 2
    return ((image - reference) ** 2 / (reference**2 + floor)).mean(-1).ravel()


def trimmed(errors):
    return np.sort(errors)[: round(len(errors) * (1 - TRIMMED))].mean()


def compare(args, scene):
    """Everything about one scene: a dictionary for JSON, and what is wrong."""
    job = Job(scene, args.size, args.max_depth, args.rr_depth, args.threads, args.vdf, args.out)
    chosen = renderers(args.variants, args.methods)
    seeds = range(1, args.seeds + 1)
    wrong = []

    def say(what):
        if not args.quiet:
            print(f"{time.strftime('%H:%M:%S')} {scene.stem}: {what}", file=sys.stderr, flush=True)

    long = range(1001, 1001 + args.reference_seeds)
    references = {}
    for program, variant in (("mitsuba", args.variants[-1]), ("vdf", args.methods[-1])):
        say(f"reference by {program}, {len(long)} x {args.reference_spp} samples")
        renderer = Renderer(f"reference {program}", program, variant, "" if program == "mitsuba" else "default")
        references[program] = Reference(render(job, renderer, args.reference_spp, long)[0])
    m, v = references["mitsuba"], references["vdf"]
    bias, z, p = compared(m.means, v.means)
    lit = (m.blocks.std(0) > 0) & (v.blocks.std(0) > 0)
    block_z = compared(m.blocks[:, lit], v.blocks[:, lit])[1]
    agreement = {
        "relative_difference": bias,
        "z": z,
        "p": p,
        "blocks": int(lit.sum()),
        "block_z_sd": float(block_z.std()),
        "block_z_max": float(abs(block_z).max()),
    }
    if p < ALARM:
        wrong.append(f"{scene.stem}: the references differ by {bias:.2%}, z = {z:.1f}")
    reference = 0.5 * (m.mean + v.mean)
    floor = 1e-2 * reference.mean() ** 2
    # What the noise of the reference adds to every squared error.
    noise = float((0.25 * (m.variance + v.variance) / (reference**2 + floor)).mean())

    # Once without a clock: files come into the caches, Mitsuba compiles its kernels.
    for r in chosen:
        say(f"warm-up {r.name}")
        render(job, r, args.spp[0], [0])
    found = {(r, spp): {"whole": [], "render": [], "error": [], "trimmed": [], "means": []} for r in chosen for spp in args.spp}
    for i, seed in enumerate(seeds):
        for spp in args.spp:
            say(f"round {i + 1} of {len(seeds)}, {spp} samples")
            images = {}
            for r in chosen if i % 2 == 0 else reversed(chosen):
                image, whole, seconds = render(job, r, spp, [seed])
                errors = relative_errors(image[0], reference)
                f = found[r, spp]
                f["whole"].append(whole)
                f["render"].append(seconds[0])
                f["error"].append(float(errors.mean()))
                f["trimmed"].append(float(trimmed(errors)))
                f["means"].append(float(image.mean()))
                if r.program == "vdf":
                    same = images.setdefault(r.way, image)
                    if not np.array_equal(same, image):
                        wrong.append(f"{scene.stem}: {r.name} does not give the image of {args.methods[0]}, {spp} samples, seed {seed}")

    rows = []
    for (r, spp), f in found.items():
        bias, z, p = compared(np.array(f["means"]), references[r.other].means)
        if p < ALARM:
            wrong.append(f"{scene.stem}: {r.name} with {spp} samples differs from the reference by {r.other} by {bias:.2%}, z = {z:.1f}")
        whole, rendering = statistics.median(f["whole"]), statistics.median(f["render"])
        error = max(statistics.mean(f["error"]) - noise, 0.0)
        rows.append(
            {
                "scene": scene.stem,
                "renderer": r.name,
                "way": r.way,
                "spp": spp,
                "whole_s": whole,
                "render_s": rendering,
                "render_least_s": min(f["render"]),
                "render_most_s": max(f["render"]),
                "rel_mse": error,
                "rel_mse_least": min(f["error"]) - noise,
                "rel_mse_most": max(f["error"]) - noise,
                "rel_mse_trimmed": statistics.median(f["trimmed"]),
                "efficiency": 1 / (rendering * error) if error > 0 else None,
                "efficiency_trimmed": 1 / (rendering * statistics.median(f["trimmed"])),
                "time_to_target_s": whole - rendering + rendering * error / TARGET,
                "bias": bias,
                "bias_z": z,
                "bias_p": p,
            }
        )
    return {"scene": str(scene), "reference_noise": noise, "references": agreement, "rows": rows}, wrong


COLUMNS = [
    ("renderer", "renderer", "{}"),
    ("spp", "spp", "{}"),
    ("whole s", "whole_s", "{:.2f}"),
    ("render s", "render_s", "{:.3f}"),
    ("relMSE", "rel_mse", "{:.3g}"),
    ("trimmed", "rel_mse_trimmed", "{:.3g}"),
    ("1/(t·relMSE)", "efficiency", "{:.3g}"),
    ("1/(t·trimmed)", "efficiency_trimmed", "{:.3g}"),
    (f"s to {TARGET:g}", "time_to_target_s", "{:.3g}"),
    ("bias", "bias", "{:+.2%}"),
    ("z", "bias_z", "{:+.1f}"),
]


def markdown(results, provenance):
    lines = ["# Mitsuba 3 and vdf", ""]
    lines += [f"- {name}: {value}" for name, value in provenance.items()]
    lines += [
        "- columns: benches/peers/README.md",
        "- a point light in fog makes the variance infinite: where relMSE differs wildly between equal renderers, compare by the trimmed error",
    ]
    for result in results:
        a = result["references"]
        lines += [
            "",
            f"## {Path(result['scene']).stem}",
            "",
            f"References: Mitsuba's mean is {a['relative_difference']:+.3%} from vdf's, z = {a['z']:+.1f}, p = {a['p']:.2g}; "
            f"z of {a['blocks']} blocks: standard deviation {a['block_z_sd']:.2f}, largest {a['block_z_max']:.1f}. "
            f"Their noise, relMSE {result['reference_noise']:.2g}, is subtracted from the column relMSE.",
            "",
            "| " + " | ".join(c[0] for c in COLUMNS) + " |",
            "| --- |" + " ---: |" * (len(COLUMNS) - 1),
        ]
        for row in result["rows"]:
            cells = [form.format(row[key]) if row[key] is not None else "–" for _, key, form in COLUMNS]
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def processor():
    try:
        with open("/proc/cpuinfo") as f:
            return next(line.split(":", 1)[1].strip() for line in f if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()


def numbers(text):
    values = [int(n) for n in text.split(",")]
    if min(values) < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return values


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=Path, help="with parameters spp, seed, width, height, max_depth, rr_depth, as vdf scene write makes them")
    parser.add_argument("--vdf", required=True, help="the program, a release build")
    parser.add_argument("--out", required=True, type=Path, help="folder for peers.md, peers.csv, peers.json")
    parser.add_argument("--size", type=int, default=256, help="side of the images in pixels")
    parser.add_argument("--spp", type=numbers, default=[16, 64], help="samples per pixel, separated by commas")
    parser.add_argument("--seeds", type=int, default=5, help="rounds, each with another seed; at least 2")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--max-depth", type=int, default=-1, help="-1: no limit")
    parser.add_argument("--rr-depth", type=int, default=5)
    parser.add_argument("--reference-spp", type=int, default=256, help="of one of the reference's renders")
    parser.add_argument("--reference-seeds", type=int, default=16, help="renders of a reference; at least 4")
    parser.add_argument("--variants", type=lambda t: t.split(","), default=["scalar_rgb", "llvm_ad_rgb"], help="of Mitsuba; the last makes its reference")
    parser.add_argument("--methods", type=lambda t: t.split(","), default=["none", "lb"], help="of vdf; the last makes its reference")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    args = parser.parse_args()
    if args.seeds < 2 or args.reference_seeds < 4:
        parser.error("--seeds must be at least 2, --reference-seeds at least 4")
    if args.size < BLOCKS:
        parser.error(f"--size must be at least {BLOCKS}")
    for scene in args.scenes:
        if not scene.is_file():
            parser.error(f"{scene}: no such file; vdf scene write NAME makes one")
    args.out.mkdir(parents=True, exist_ok=True)

    start = time.perf_counter()
    results, wrong = [], []
    for scene in args.scenes:
        result, problems = compare(args, scene)
        results.append(result)
        wrong += problems
    from importlib.metadata import version

    provenance = {
        "command": " ".join(sys.argv),
        "vdf": run([args.vdf, "--version"])[1].strip(),
        "mitsuba": f"{version('mitsuba')}, drjit {version('drjit')}",
        "processor": f"{processor()}, {os.cpu_count()} logical",
        "settings": f"{args.size} x {args.size} pixels, max_depth {args.max_depth}, rr_depth {args.rr_depth}, {args.threads} threads, medians of {args.seeds}",
        "references": f"{args.reference_seeds} x {args.reference_spp} samples by each program",
        "took": f"{time.perf_counter() - start:.0f} s",
    }
    text = markdown(results, provenance)
    (args.out / "peers.md").write_text(text)
    (args.out / "peers.json").write_text(json.dumps({"provenance": provenance, "scenes": results, "wrong": wrong}, indent=2) + "\n")
    with open(args.out / "peers.csv", "w", newline="") as f:
        f.writelines(f"# {name}: {value}\n" for name, value in provenance.items())
        rows = [row for result in results for row in result["rows"]]
        writer = csv.DictWriter(f, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    print(text, end="")
    for problem in wrong:
        print(f"WRONG: {problem}", file=sys.stderr)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
