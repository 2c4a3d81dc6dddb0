#!/usr/bin/env python3
"""How accuracy depends on pixels per cell, noise, tilt and contrast: synthetic photographs, drawn, read and scored.

usage: comb_accuracy.py [--program target/release/combwright] [--cells 1500] [--seeds 2] [-o analysis/comb_accuracy]

Writes accuracy.csv (one row per photograph) and accuracy.png and .svg: one quantity is varied at a time, about difficulty 0.3 at
30 pixels per cell. Writes calibration.csv and calibration.png and .svg: of all cells with a number of sides in these photographs
(complete and uncertain ones), those of each stated confidence, and the share that is right. Needs matplotlib (requirements.txt).
"""

import argparse
import csv
import json
import math
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


# Stated confidence from .. to; the last bins are narrow since most cells are in them.
BINS = [0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 1.0]


def claims(cells, truth):
    """(confidence, whether right) of every cell that has a number of sides and lies on a whole true cell. Where a wall of the truth is too
    short to be seen, both numbers are right."""
    rows = list(csv.DictReader(open(truth, newline="", encoding="utf-8")))
    bins = {}
    for row in rows:
        if row["complete"] != "1":
            continue
        at = (float(row["x_px"]), float(row["y_px"]))
        bins.setdefault((int(at[0] // 64), int(at[1] // 64)), []).append((at, (row["sides"], row["other_sides"])))
    said = []
    for row in csv.DictReader(open(cells, newline="", encoding="utf-8")):
        if not row["sides"]:
            continue
        at = (float(row["x_px"]), float(row["y_px"]))
        width = math.sqrt(float(row["area_px2"]))
        near = [
            (math.dist(at, place), sides)
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
            for place, sides in bins.get((int(at[0] // 64) + i, int(at[1] // 64) + j), [])
        ]
        distance, sides = min(near, default=(math.inf, ()))
        if distance < 0.35 * width:
            said.append((float(row["confidence"]), row["sides"] in sides))
    return said


def measure(program, cells, seed, options):
    """Draws, reads and scores one photograph. One that is refused scores nothing found and nothing said."""
    with tempfile.TemporaryDirectory() as home:
        flags = [f"--{key}={value}" for key, value in options.items()]
        draw = [program, "comb", "render", f"--cells={cells}", f"--seed={seed}", "--disorder=0.6", "-o", f"{home}/synth", *flags]
        subprocess.run(draw, check=True, capture_output=True)
        read = subprocess.run([program, "comb", f"{home}/synth/photo.png", "-o", f"{home}/out"], capture_output=True, check=False)
        if read.returncode != 0:
            return {"recall": 0.0, "coverage": 0.0, "sides_right": None, "sure_right": None, "refused": 1}, []
        command = [program, "comb", "score", f"{home}/out/photo/cells.csv", f"{home}/synth/truth.csv", "--json"]
        result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        said = claims(f"{home}/out/photo/cells.csv", f"{home}/synth/truth.csv")
        return {**{k: v for k, v in result.items() if k != "wrong"}, "refused": 0}, said


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "target/release/combwright")
    parser.add_argument("--cells", type=int, default=1500)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=root / "analysis/comb_accuracy")
    arguments = parser.parse_args()
    rows, said = [], []
    for scan, (_, values) in SCANS.items():
        for value in values:
            for seed in range(1, arguments.seeds + 1):
                result, claimed = measure(arguments.program, arguments.cells, seed, {**BASE, scan: value})
                said += claimed
                rows.append({"scan": scan, "value": value, "seed": seed, **result})
    arguments.output.mkdir(parents=True, exist_ok=True)
    columns = list(max(rows, key=len))
    with open(arguments.output / "accuracy.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        writer.writerows(rows)
    plot(rows, arguments)
    calibration(said, arguments)


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
    save(figure, arguments.output, "accuracy")


def calibration(said, arguments):
    table = []
    for low, high in zip(BINS, BINS[1:]):
        right = [r for confidence, r in said if low <= confidence < high or (high == 1.0 and confidence == 1.0)]
        if right:
            mean = sum(c for c, _ in said if low <= c < high) / len(right)
            table.append({"from": low, "to": high, "cells": len(right), "stated": round(mean, 4), "right": round(sum(right) / len(right), 4)})
    with open(arguments.output / "calibration.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]))
        writer.writeheader()
        writer.writerows(table)
    figure, axis = plt.subplots(figsize=(4.2, 3.8), layout="constrained")
    axis.plot([0.3, 1], [0.3, 1], color="#9a9a9a", linewidth=0.8)
    share = [row["right"] for row in table]
    spread = [1.96 * math.sqrt(max(r * (1 - r), 1e-9) / row["cells"]) for r, row in zip(share, table)]
    stated = [row["stated"] for row in table]
    axis.errorbar(stated, share, yerr=spread, marker="o", markersize=4, color="#0072b2", linewidth=1, capsize=2)
    for row in table:
        axis.annotate(f"{row['cells']}", (row["stated"], row["right"]), textcoords="offset points", xytext=(-5, 5), ha="right", fontsize=7)
    axis.set_xlabel("stated confidence")
    axis.set_ylabel("share of right numbers of sides")
    axis.set_title(f"{len(said)} cells", fontsize=9)
    save(figure, arguments.output, "calibration")


def save(figure, folder, name):
    for kind, metadata in (("png", None), ("svg", {"Date": None})):
        figure.savefig(folder / f"{name}.{kind}", dpi=130, metadata=metadata)


if __name__ == "__main__":
    main()
