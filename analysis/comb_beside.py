#!/usr/bin/env python3
"""Real comb beside synthetic comb of the same pitch, in one picture.

usage: comb_beside.py [--program target/release/combwright] [--shared ../shared] [-o target/comb_beside.png]

Upper row: parts of the photographs of ../shared/photos (their README names sources and licences; they may not be passed on, so
that the picture is not part of the project). Lower row: synthetic photographs of the style nearest to each, at difficulty 0.4. Each
part is 8 cells wide and scaled to the same width. Needs OpenCV (requirements.txt).
"""

import argparse
import pathlib
import subprocess
import tempfile

import cv2
import numpy as np

WIDTH = 420
CELLS = 8
# Photograph, its pixels per cell, middle of the part as shares of width and height, style of the synthetic one.
PAIRS = [
    ("peleg_N2_6-21.jpg", 69, (0.5, 0.5), "wax"),
    ("peleg_5C_7-13.jpg", 85, (0.5, 0.75), "base"),
    ("biorobotics_20240613_cam-1.png", 61, (0.35, 0.6), "brood"),
]


def part(picture, pitch, middle):
    """A square of CELLS pitches around the middle, scaled to WIDTH."""
    half = int(CELLS * pitch / 2)
    height, width = picture.shape[:2]
    x = min(max(int(middle[0] * width), half), width - half)
    y = min(max(int(middle[1] * height), half), height - half)
    return cv2.resize(picture[y - half : y + half, x - half : x + half], (WIDTH, WIDTH), interpolation=cv2.INTER_AREA)


def drawn(program, style, seed):
    with tempfile.TemporaryDirectory() as home:
        options = [f"--style={style}", f"--seed={seed}", "--cells=200", "--pitch=60", "--disorder=0.2", "--difficulty=0.4"]
        subprocess.run([program, "comb", "render", *options, "-o", home], check=True, capture_output=True)
        return part(cv2.imread(f"{home}/photo.png"), 60, (0.5, 0.5))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "target/release/combwright")
    parser.add_argument("--shared", type=pathlib.Path, default=root / "../shared")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=root / "target/comb_beside.png")
    arguments = parser.parse_args()
    real, synthetic = [], []
    for seed, (name, pitch, middle, style) in enumerate(PAIRS, start=1):
        real.append(part(cv2.imread(str(arguments.shared / "photos" / name)), pitch, middle))
        synthetic.append(drawn(arguments.program, style, seed))
    picture = np.vstack([np.hstack(real), np.hstack(synthetic)])
    cv2.imwrite(str(arguments.output), picture)


if __name__ == "__main__":
    main()
