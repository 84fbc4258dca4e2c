#!/usr/bin/env python3
"""Times Embree and vdf on the very same visibility queries, in turns.

    pip install embreex numpy
    python embree.py --vdf ../../target/release/vdf --out /tmp/embree cbox_vol2 "cbox_vol4 --integrator raymarch --samples-per-segment 49"

Each argument is a scene and the options of `vdf report queries`. The queries are exported once; then Embree (robust, single rays,
`rtcOccluded1` in a loop of C through embreex) and vdf (`vdf report queries`, which checks every answer) take turns. Prints nanoseconds a
query, medians over the rounds, and ratios. All times are processor time of the thread, less what the loop takes: for Embree that of rays
that miss everything. Answers that differ are counted: Embree takes single precision, and its ends are not exact.
"""

import argparse
import csv
import pathlib
import shlex
import statistics
import subprocess
import time

import numpy as np
from embreex import rtcore_scene
from embreex.mesh_construction import TriangleMesh

CLASSES = {"spatial": 1, "superficial": 0}


def vdf_round(vdf, scene, method, out):
    """Nanoseconds of each class: the hierarchy, the method one by one, and in batches."""
    table = out / "vdf.csv"
    command = [vdf, "report", "queries", *scene, "--methods", method, "--passes", "3", "--csv", str(table), "--html", str(out / "vdf.html")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    values = {}
    with open(table, newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            values[row["method"], row["quantity"]] = float(row["value"])
    loop = values["none", "t_loop"]
    names = {"spatial": ("t_eff", "t_batch", "u", "t_query spatial"), "superficial": ("t_eff superficial", "t_batch superficial", "u superficial", "t_query superficial")}
    return {
        kind: {"single": values[method, single] - loop, "batch": values[method, batch] - loop, "u": values[method, u],
               "hierarchy": values["none", hierarchy] - loop}
        for kind, (single, batch, u, hierarchy) in names.items()
        if (method, single) in values
    }


class Embree:
    """The exported triangles and queries."""

    def __init__(self, folder):
        queries = np.fromfile(folder / "queries.bin", offset=80,
                              dtype=[("from", "<f8", 3), ("to", "<f8", 3), ("emitter", "<u4"), ("flags", "<u4")])
        triangles = np.fromfile(folder / "triangles.bin", offset=32, dtype=("<f4", (3, 3)))
        self.scene = rtcore_scene.EmbreeScene(robust=True)
        self.mesh = TriangleMesh(self.scene, triangles)
        self.far = np.float32(10 * (np.abs(triangles).max() + 1))
        self.classes = {}
        for kind, spatial in CLASSES.items():
            some = queries[(queries["flags"] & 1) == spatial]
            if len(some):
                # Single precision cannot start beside a surface and miss it: a ten-thousandth of the way is left out.
                ways = some["to"] - some["from"]
                origins = (some["from"] + 1e-4 * ways).astype("f4")
                directions = (0.9999 * ways).astype("f4")
                self.classes[kind] = origins, directions, (some["flags"] & 2) != 0

    def round(self):
        """Nanoseconds of each class, and how many answers differ."""
        result = {}
        for kind, (origins, directions, unoccluded) in self.classes.items():
            ones = np.ones(len(origins), "f4")
            # Rays that miss the box of everything.
            _, loop = self.ask(origins + self.far, np.abs(directions) + 1, ones)
            answers, seconds = self.ask(origins, directions, ones)
            differ = int(np.sum((answers == 0) == unoccluded)) if answers.dtype != bool else int(np.sum(answers == unoccluded))
            result[kind] = {"ns": 1e9 * (seconds - loop) / len(origins), "differ": differ, "queries": len(origins)}
        return result

    def ask(self, origins, directions, lengths):
        start = time.thread_time()
        answers = self.scene.run(origins, directions, dists=lengths, query="OCCLUDED")
        return answers, time.thread_time() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--vdf", default="vdf")
    parser.add_argument("--method", default="lb")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    print("| scene, queries | u % | Embree ns | hierarchy ns | one by one ns | batches ns | Embree / hierarchy | Embree / one by one | Embree / batches | differ |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for text in arguments.scenes:
        scene = shlex.split(text)
        command = [arguments.vdf, "report", "queries", *scene, "--methods", arguments.method, "--passes", "1", "--export", str(arguments.out),
                   "--html", str(arguments.out / "vdf.html")]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        embree = Embree(arguments.out)
        rounds = [(embree.round(), vdf_round(arguments.vdf, scene, arguments.method, arguments.out)) for _ in range(arguments.rounds)]
        counts = {kind: rounds[0][0][kind]["queries"] for kind in embree.classes}
        for kind, parts in [*((k, [k]) for k in counts), *([("all", list(counts))] if len(counts) > 1 else [])]:
            n = sum(counts[part] for part in parts)
            # Of all queries by their numbers, round by round.
            median = lambda which, name: statistics.median(sum(r[which][part][name] * counts[part] for part in parts) / n for r in rounds)
            peer, hierarchy, single, batch = median(0, "ns"), median(1, "hierarchy"), median(1, "single"), median(1, "batch")
            differ = sum(rounds[0][0][part]["differ"] for part in parts)
            print(f"| {text}, {kind} | {100 * median(1, 'u'):.2f} | {peer:.1f} | {hierarchy:.1f} | {single:.1f} | {batch:.1f} "
                  f"| {peer / hierarchy:.2f} | {peer / single:.2f} | {peer / batch:.2f} | {differ} |", flush=True)

if __name__ == "__main__":
    main()
