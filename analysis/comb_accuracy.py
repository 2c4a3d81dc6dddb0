#!/usr/bin/env python3
"""How accuracy depends on pixels per cell, noise, tilt and contrast: synthetic photographs, drawn, read and scored.

usage: comb_accuracy.py [--program target/release/combwright] [--cells 1500] [--seeds 2] [-o analysis/comb_accuracy]

Writes accuracy.csv (one row per photograph), accuracy.png and accuracy.svg. One quantity is varied at a time, about
difficulty 0.3 at 30 pixels per cell. Needs matplotlib (requirements.txt).
"""

import argparse
import csv
import json
import pathlib
import subprocess
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

BASE = {"pitch": 30, "difficulty": 0.3}
SCANS = {
    "pitch": ("pixels per cell", [12, 14, 17, 20, 25, 35, 60]),
    "noise": ("noise, grey values of 0 to 1", [0.0, 0.03, 0.06, 0.1, 0.15, 0.2]),
    "tilt": ("tilt, degrees", [0, 15, 30, 40, 50]),
    "fading": ("contrast lost", [0.0, 0.3, 0.6, 0.8, 0.9]),
    "difficulty": ("the dial", [0.0, 0.25, 0.5, 0.75, 1.0]),
}
LINES = [
    ("recall", "cells found", "#0072b2", "-"),
    ("sides_right", "sides right", "#d55e00", "-"),
    ("coverage", "share given as complete", "#009e73", "--"),
    ("sure_right", "right when 90 % sure", "#cc79a7", ":"),
]


def measure(program, cells, seed, options):
    """Draws, reads and scores one photograph. One that is refused scores nothing found and nothing said."""
    with tempfile.TemporaryDirectory() as home:
        flags = [f"--{key}={value}" for key, value in options.items()]
        draw = [program, "comb", "render", f"--cells={cells}", f"--seed={seed}", "--disorder=0.6", "-o", f"{home}/synth", *flags]
        subprocess.run(draw, check=True, capture_output=True)
        read = subprocess.run([program, "comb", f"{home}/synth/photo.png", "-o", f"{home}/out"], capture_output=True, check=False)
        if read.returncode != 0:
            return {"recall": 0.0, "coverage": 0.0, "sides_right": None, "sure_right": None, "refused": 1}
        command = [program, "comb", "score", f"{home}/out/photo/cells.csv", f"{home}/synth/truth.csv", "--json"]
        result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        return {**{k: v for k, v in result.items() if k != "wrong"}, "refused": 0}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "target/release/combwright")
    parser.add_argument("--cells", type=int, default=1500)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=root / "analysis/comb_accuracy")
    arguments = parser.parse_args()
    rows = []
    for scan, (_, values) in SCANS.items():
        for value in values:
            for seed in range(1, arguments.seeds + 1):
                result = measure(arguments.program, arguments.cells, seed, {**BASE, scan: value})
                rows.append({"scan": scan, "value": value, "seed": seed, **result})
    arguments.output.mkdir(parents=True, exist_ok=True)
    columns = list(max(rows, key=len))
    with open(arguments.output / "accuracy.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    plot(rows, arguments)


def plot(rows, arguments):
    plt.rcParams["svg.hashsalt"] = "combwright"
    figure, axes = plt.subplots(1, len(SCANS), figsize=(3.2 * len(SCANS), 3.4), sharey=True, layout="constrained")
    for axis, (scan, (label, values)) in zip(axes, SCANS.items()):
        for key, name, colour, style in LINES:
            means = []
            for value in values:
                found = [r[key] for r in rows if r["scan"] == scan and r["value"] == value and r[key] is not None]
                means.append(sum(found) / len(found) if found else float("nan"))
            axis.plot(values, means, style, color=colour, label=name, marker="o", markersize=3)
        axis.axhline(0.995, color="#9a9a9a", linewidth=0.7)
        axis.set_xlabel(label)
        axis.set_ylim(0.5, 1.005)
    axes[0].set_ylabel("share")
    axes[0].legend(loc="lower right", fontsize=8)
    for kind, metadata in (("png", None), ("svg", {"Date": None})):
        figure.savefig(arguments.output / f"accuracy.{kind}", dpi=130, metadata=metadata)


if __name__ == "__main__":
    main()
