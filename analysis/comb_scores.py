#!/usr/bin/env python3
"""Reads all photographs of ../shared/photos with the program and prints every score in one table.

usage: comb_scores.py [--program target/release/combwright] [--shared ../shared] [-o FOLDER]

Sides and defects are scored by ../shared/tools/score_comb.py; cells of photographs whose truth is centres only (a JSON list,
a picture of discs) by the same rule of distance. Needs OpenCV (requirements.txt) to read the picture of discs.
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys

import cv2
import numpy as np

BY_EYE = ["peleg_1A_7-13", "peleg_5C_7-13", "peleg_R3_6-21", "peleg_N2_6-21", "biorobotics_20240613_cam-1"]


def score(tool, cells, prefix):
    done = subprocess.run([sys.executable, tool, cells, prefix, "--json"], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def found(cells, truth):
    """How many true centres have a cell of their own within 0.35 of the pitch, nearest pairs first."""
    centres = [(float(row["x_px"]), float(row["y_px"])) for row in csv.DictReader(open(cells, newline="", encoding="utf-8"))]
    pitch = float(np.median([sorted(math.dist(a, b) for b in truth)[1] for a in truth]))
    pairs = sorted(
        (distance, i, j)
        for i, a in enumerate(truth)
        for j, b in enumerate(centres)
        if (distance := math.dist(a, b)) <= 0.35 * pitch
    )
    partner, used = {}, set()
    for _, i, j in pairs:
        if i not in partner and j not in used:
            partner[i] = j
            used.add(j)
    return len(partner)


def disc_centres(path):
    labels = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    _, _, _, centres = cv2.connectedComponentsWithStats((labels > 128).astype(np.uint8))
    return [tuple(c) for c in centres[1:]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "target/release/combwright")
    parser.add_argument("--shared", type=pathlib.Path, default=root / "../shared")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=root / "target/comb-scores")
    arguments = parser.parse_args()
    photos = arguments.shared / "photos"
    if not photos.is_dir():
        print(f"skipped: {photos} is not here")
        return
    pictures = sorted(p for p in photos.iterdir() if p.suffix in {".png", ".jpg"} and not p.stem.endswith("_labels"))
    subprocess.run([arguments.program, "comb", *pictures, "-o", arguments.output], check=True)
    tool = arguments.shared / "tools/score_comb.py"
    print("\nphoto                        recall  precision  sides   coverage  defects  recall  precision")
    recalled = defects = right = claims = 0
    for name in BY_EYE:
        s = score(tool, arguments.output / name / "cells.csv", photos / name)
        recall, precision = (s[k] if s[k] is not None else 1.0 for k in ("defect_recall", "defect_precision"))
        print(
            f"{name:28} {s['recall']:.4f}  {s['precision']:.4f}     {s['sides']:.4f}  {s['sides_coverage']:.4f}"
            f"    {s['defect_n']:3}      {recall:.3f}   {precision:.3f}"
        )
        recalled += recall * s["defect_n"]
        defects += s["defect_n"]
        right += precision * s["defect_claims"]
        claims += s["defect_claims"]
    print(f"defects in sum: recall {recalled / defects:.4f} of {defects}, precision {right / claims:.4f} of {claims}")
    discs = disc_centres(photos / "broodmapper_empty_labels.png")
    print(f"broodmapper_empty: {found(arguments.output / 'broodmapper_empty/cells.csv', discs)} of {len(discs)} cells")
    name = "biorobotics_20240615_cam-3"
    published = [(c["center_x"], c["center_y"]) for c in json.load(open(photos / f"{name}.json", encoding="utf-8"))]
    count = found(arguments.output / name / "cells.csv", published)
    print(f"{name}: {count} of {len(published)} published centres, {count / len(published):.4f}")


if __name__ == "__main__":
    main()
