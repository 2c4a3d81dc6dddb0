#!/usr/bin/env python3
"""Reads the photographs of ../shared/photos again after changing them, and prints the scores of each change in sum.

usage: comb_variations.py [--program target/release/combwright] [--shared ../shared] [-o FOLDER]

Photographs of the same kind differ in scale, direction, light, sharpness and compression; a reading that fits the kind gives the
same cells. Centres that were checked by eye move with the picture; those nearer than 1.1 pitches to its border are not scored.
"""

import argparse
import collections
import csv
import json
import math
import pathlib
import subprocess

import cv2
import numpy as np

from comb_scores import BY_EYE

KEPT = 1.1
MATCH = 0.35


def truth_of(prefix):
    """Centres and, of those counted, the sides that the photograph allows."""
    rows = csv.DictReader(open(f"{prefix}_sides.csv", newline="", encoding="utf-8"))
    allowed = lambda row: {int(float(v)) for v in (row["sides"], row.get("alt_sides") or "") if v.strip()}
    cells = [((float(r["cx"]), float(r["cy"])), allowed(r)) for r in rows]
    return np.array([c for c, _ in cells]), [a for _, a in cells]


def pitch_of(centres):
    distance = np.hypot(*(centres[:, None] - centres[None]).transpose(2, 0, 1))
    np.fill_diagonal(distance, np.inf)
    return float(np.median(distance.min(1)))


def warped(image, matrix, size):
    return cv2.warpPerspective(image, matrix, size, flags=cv2.INTER_AREA, borderMode=cv2.BORDER_CONSTANT)


def turned(image, degrees):
    """The largest upright middle of the picture turned about its centre."""
    height, width = image.shape[:2]
    c, s = abs(math.cos(math.radians(degrees))), abs(math.sin(math.radians(degrees)))
    factor = min(width / (width * c + height * s), height / (width * s + height * c))
    size = (int(width * factor), int(height * factor))
    turn = np.vstack([cv2.getRotationMatrix2D((width / 2, height / 2), degrees, 1.0), [0, 0, 1]])
    shift = np.array([[1, 0, (size[0] - width) / 2], [0, 1, (size[1] - height) / 2], [0, 0, 1.0]])
    return shift @ turn, size


def tilted(image):
    """The picture seen from the side: its upper edge is a fifth shorter; the middle of what remains."""
    height, width = image.shape[:2]
    corners = np.float32([[0, 0], [width, 0], [width, height], [0, height]])
    onto = np.float32([[0, 0], [width, 0], [0.9 * width, 0.95 * height], [0.1 * width, 0.95 * height]])
    matrix = cv2.getPerspectiveTransform(corners, onto)
    shift = np.array([[1, 0, -0.1 * width], [0, 1, 0], [0, 0, 1.0]])
    return shift @ matrix, (int(0.8 * width), int(0.95 * height))


def geometric(make):
    def change(image, _):
        matrix, size = make(image)
        return warped(image, matrix, size), matrix

    return change


def scaled(factor):
    def change(image, _):
        how = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
        out = cv2.resize(image, None, fx=factor, fy=factor, interpolation=how)
        return out, np.diag([out.shape[1] / image.shape[1], out.shape[0] / image.shape[0], 1.0])

    return change


def still(make):
    return lambda image, pitch: (make(image, pitch), np.eye(3))


def gamma(exponent):
    return still(lambda image, _: (255 * (image / 255.0) ** exponent).astype(np.uint8))


def gradient(image, _):
    height, width = image.shape[:2]
    light = np.linspace(0.35, 1.15, width)[None, :, None] * np.linspace(1.0, 0.7, height)[:, None, None]
    return np.clip(image * light, 0, 255).astype(np.uint8)


def jpeg(image, _):
    return cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 60])[1], cv2.IMREAD_COLOR)


def noisy(image, _):
    noise = np.random.default_rng(1).normal(0, 12, image.shape)
    return np.clip(image + noise, 0, 255).astype(np.uint8)


def mirror(image):
    return np.array([[-1, 0, image.shape[1]], [0, 1, 0], [0, 0, 1.0]]), image.shape[1::-1]


def middle(image):
    height, width = image.shape[:2]
    return np.array([[1, 0, -0.17 * width], [0, 1, -0.23 * height], [0, 0, 1.0]]), (int(0.6 * width), int(0.6 * height))


CHANGES = {
    "as it is": still(lambda image, _: image),
    "part": geometric(middle),
    "turned by 17 degrees": geometric(lambda image: turned(image, 17)),
    "turned by 90 degrees": geometric(lambda i: (np.array([[0, 1, 0], [-1, 0, i.shape[1]], [0, 0, 1.0]]), i.shape[:2])),
    "mirrored": geometric(mirror),
    "tilted": geometric(tilted),
    "scaled by 0.6": scaled(0.6),
    "scaled by 0.8": scaled(0.8),
    "scaled by 1.4": scaled(1.4),
    "scaled by 1.8": scaled(1.8),
    "gamma 0.6": gamma(0.6),
    "gamma 1.7": gamma(1.7),
    "light from one side": still(gradient),
    "JPEG of quality 60": still(jpeg),
    "noise of 12 levels": still(noisy),
    "out of focus": still(lambda image, pitch: cv2.GaussianBlur(image, (0, 0), 0.04 * pitch)),
    "grey": still(lambda image, _: cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)),
    "half the contrast": still(lambda image, _: (64 + image * 0.5).astype(np.uint8)),
}


def compare(table, centres, sides, size, sums, wrong):
    rows = list(csv.DictReader(open(table, newline="", encoding="utf-8")))
    found = np.array([(float(r["x_px"]), float(r["y_px"])) for r in rows])
    pitch = pitch_of(centres)
    margin = KEPT * pitch
    for centre, allowed in zip(centres, sides):
        if not (margin < centre[0] < size[0] - margin and margin < centre[1] < size[1] - margin):
            continue
        distance = np.hypot(*(found - centre).T)
        row = rows[int(distance.argmin())]
        hit = distance.min() < MATCH * pitch
        told = hit and row["status"] == "complete"
        right = told and int(row["sides"]) in allowed
        defect = 6 not in allowed
        sums["cells"] += 1
        sums["found"] += hit
        sums["told"] += told
        sums["right"] += right
        sums["defects"] += defect
        sums["defects found"] += defect and right
        sums["claims"] += told and int(row["sides"]) != 6
        sums["claims right"] += right and int(row["sides"]) != 6
        if told and not right:
            wrong.append((round(float(centre[0])), round(float(centre[1])), sorted(allowed), int(row["sides"])))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "target/release/combwright")
    parser.add_argument("--shared", type=pathlib.Path, default=root / "../shared")
    parser.add_argument("--only", nargs="*", help="names of changes; all if none")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=root / "target/comb-variations")
    arguments = parser.parse_args()
    photos = arguments.shared / "photos"
    if not photos.is_dir():
        print(f"skipped: {photos} is not here")
        return
    arguments.output.mkdir(parents=True, exist_ok=True)
    print(f"{'change':22} cells  recall  sides right  coverage  defects  recall  precision", flush=True)
    report = {}
    for name, change in CHANGES.items():
        if arguments.only and name not in arguments.only:
            continue
        sums, wrong = collections.Counter(), {}
        for photo in BY_EYE:
            source = next(p for p in photos.glob(f"{photo}.*") if p.suffix in {".png", ".jpg"})
            centres, sides = truth_of(photos / photo)
            image, matrix = change(cv2.imread(str(source)), pitch_of(centres))
            moved = cv2.perspectiveTransform(centres[None].astype(np.float64), matrix)[0]
            path = arguments.output / f"{photo}.png"
            cv2.imwrite(str(path), image)
            command = [arguments.program, "comb", path, "-o", arguments.output / name.replace(" ", "-")]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode:
                print(f"{name}: {photo}: {done.stderr.strip()}")
                continue
            wrong[photo] = []
            compare(arguments.output / name.replace(" ", "-") / photo / "cells.csv", moved, sides, image.shape[1::-1], sums, wrong[photo])
        share = lambda a, b: f"{sums[a] / sums[b]:.4f}" if sums[b] else "-"
        print(
            f"{name:22} {sums['cells']:5}  {share('found', 'cells'):6}  {share('right', 'told'):>11}  {share('told', 'cells'):>8}"
            f"  {sums['defects']:7}  {share('defects found', 'defects'):>6}  {share('claims right', 'claims'):>9}",
            flush=True,
        )
        report[name] = {**sums, "wrong": wrong}
    (arguments.output / "variations.json").write_text(json.dumps(report, indent=1, default=int) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
