#!/usr/bin/env python3
"""Reads synthetic photographs, and those of ../shared/photos where they are, with the program and with OpenCV, and compares them.

usage: comb_agreement.py [--program target/debug/combwright] [--shared ../shared] [-o FOLDER]

Prints one row per photograph and fails where the two agree on less than LEAST of the synthetic cells that OpenCV could judge, or
OpenCV finds less than FOUND of the program's. The photographs of ../shared are reported, not judged: OpenCV's own means do not
stand pollen, caps and bees.
"""

import argparse
import pathlib
import subprocess
import sys

import cv2

from opencv_check import agreement, pitch_of, segment, sides_of

LEAST = 0.95
FOUND = 0.85
STYLES = ["wax", "base"]


def compare(name, picture, cells):
    colour = cv2.imread(str(picture), cv2.IMREAD_COLOR)
    pitch, sign = pitch_of(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY))
    found = segment(colour, pitch, sign)
    report = agreement(found, *sides_of(found, colour.shape, pitch), cells, pitch)
    same = "-" if report["agreement"] is None else f"{report['agreement']:.4f}"
    share = report["found_by_opencv"] / max(1, report["complete_cells"])
    print(f"{name:28} {report['complete_cells']:8}  {share:15.4f}  {report['compared']:8}  {same:>10}", flush=True)
    return share >= FOUND and (report["agreement"] or 0.0) >= LEAST


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "target/debug/combwright")
    parser.add_argument("--shared", type=pathlib.Path, default=root / "../shared")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=root / "target/comb-agreement")
    arguments = parser.parse_args()
    print(f"{'photo':28} complete  found by OpenCV  compared  same sides")
    good = True
    for style in STYLES:
        home = arguments.output / style
        options = ["--cells=300", "--pitch=36", "--difficulty=0.2", "--disorder=0.3", f"--style={style}", "-o", home]
        subprocess.run([arguments.program, "comb", "render", *options], check=True, capture_output=True)
        subprocess.run([arguments.program, "comb", home / "photo.png", "-o", home], check=True, capture_output=True)
        good &= compare(f"synthetic, {style}", home / "photo.png", home / "photo/cells.csv")
    photos = arguments.shared / "photos"
    if photos.is_dir():
        pictures = sorted(p for p in photos.iterdir() if p.suffix in {".png", ".jpg"} and not p.stem.endswith("_labels"))
        subprocess.run([arguments.program, "comb", *pictures, "-o", arguments.output], check=True, capture_output=True)
        for picture in pictures:
            compare(picture.stem, picture, arguments.output / picture.stem / "cells.csv")
    else:
        print(f"skipped: {photos} is not here")
    if not good:
        sys.exit(f"error: OpenCV and the program agree on less than {LEAST} of the synthetic cells, or OpenCV finds too few")


if __name__ == "__main__":
    main()
