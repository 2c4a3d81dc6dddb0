#!/usr/bin/env python3
"""Reads comb with OpenCV's own means, as a check on `combwright comb`.

usage: opencv_check.py PHOTO [--cells CELLS.csv] [-o FOLDER]

It shares no code and no idea with the Rust program beyond the question: contrast-limited equalisation, Otsu's threshold
between openings and walls, distance transform, one marker per peak, cv2.watershed, neighbours from cv2.Subdiv2D. It writes
cells.csv with the same columns and, if given the program's table, prints how far the two agree cell by cell.

A cell counts (`complete`) only where all its Delaunay neighbours lie wholly within the photograph; it knows nothing of caps,
thick walls or cells that the border cuts, so it is a reference for the clear majority, not for the rest.
"""

import argparse
import csv
import json
import math
import pathlib
import sys
import time

import cv2
import numpy as np

MATCH = 0.35


def pitch_of(grey):
    """The pitch at which blobs of one size cover most of the photograph at even distances, by a scan over sizes."""
    tried = []
    for pitch in np.geomspace(12, 240, 14):
        scale = 10.0 / pitch
        small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA).astype(np.float32)
        height, width = (min(length, 360) for length in small.shape)
        top, left = (small.shape[0] - height) // 2, (small.shape[1] - width) // 2
        small = small[top : top + height, left : left + width]
        blobs = cv2.GaussianBlur(small, (0, 0), 3.6) - cv2.GaussianBlur(small, (0, 0), 1.8)
        for sign in (+1, -1):
            spacing = even_spacing(peaks(blobs * sign, 3))
            if len(spacing):
                share = float((spacing**2).sum()) * 0.75**0.5 / small.size
                tried.append((share, float(np.median(spacing)) / scale, sign))
    if not tried:
        return 0.0, 1
    best = max(tried)
    # Glints in the cells make a finer lattice, so a coarser one is preferred where it does half as well.
    coarser = max((t for t in tried if t[1] > 1.5 * best[1]), default=(0.0,))
    return (coarser if coarser[0] > 0.5 * best[0] else best)[1:]


def peaks(image, radius, least=0.0):
    """Local maxima above `least`, as rows of x, y."""
    size = 2 * int(radius) + 1
    top = cv2.dilate(image, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)))
    y, x = np.nonzero((image >= top) & (image > max(least, image.std() * 0.3)))
    return np.column_stack([x, y]).astype(np.float32)


def even_spacing(points):
    """Mean distance of the six nearest others, of those points where it is near 10 and the six are within a quarter of it."""
    if len(points) < 12:
        return np.array([])
    distance = np.sqrt(((points[:, None, :] - points[None, :, :]) ** 2).sum(2))
    near = np.partition(distance, 6, axis=1)[:, :7]
    near = np.sort(near, axis=1)[:, 1:]
    mean = near.mean(1)
    return mean[(abs(near / mean[:, None] - 1).max(1) < 0.25) & (mean > 7) & (mean < 14)]


def segment(colour, pitch, sign):
    """Regions of cells by threshold, distance transform and watershed; centres of the regions, whether each is whole."""
    scale = min(1.0, 40.0 / pitch)
    small = cv2.resize(colour, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    pitch *= scale
    grey = cv2.cvtColor(small, cv2.COLOR_BGR2GRAY)
    if sign < 0:
        grey = 255 - grey
    tiles = [max(1, int(length / (4 * pitch))) for length in grey.shape[::-1]]
    even = cv2.createCLAHE(clipLimit=4.0, tileGridSize=tuple(tiles)).apply(grey)
    even = cv2.GaussianBlur(even, (0, 0), 0.04 * pitch)
    window = 2 * int(0.8 * pitch) + 1
    openings = cv2.adaptiveThreshold(even, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, window, 4)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * int(0.08 * pitch) + 1,) * 2)
    openings = cv2.morphologyEx(cv2.morphologyEx(openings, cv2.MORPH_CLOSE, kernel), cv2.MORPH_OPEN, kernel)
    depth = cv2.GaussianBlur(cv2.distanceTransform(openings, cv2.DIST_L2, 5), (0, 0), 0.08 * pitch)
    markers = np.zeros(grey.shape, np.int32)
    for label, (x, y) in enumerate(peaks(depth, 0.3 * pitch, 0.15 * pitch), start=1):
        cv2.circle(markers, (int(x), int(y)), max(1, int(0.12 * pitch)), label, -1)
    cv2.watershed(cv2.cvtColor(even, cv2.COLOR_GRAY2BGR), markers)
    cells = []
    count = int(markers.max())
    areas = np.bincount(markers[markers > 0].ravel(), minlength=count + 1)
    ys, xs = np.indices(markers.shape)
    inside = markers > 0
    sum_x = np.bincount(markers[inside], xs[inside], minlength=count + 1)
    sum_y = np.bincount(markers[inside], ys[inside], minlength=count + 1)
    rim = set(np.unique(np.concatenate([markers[1], markers[-2], markers[:, 1], markers[:, -2]])))
    cell_area = pitch * pitch * 0.75**0.5
    for label in range(1, count + 1):
        if 0.3 * cell_area < areas[label] < 2.2 * cell_area:
            centre = ((sum_x[label] / areas[label] + 0.5) / scale, (sum_y[label] / areas[label] + 0.5) / scale)
            cells.append((centre, areas[label] / scale**2, label not in rim))
    return cells


def sides_of(cells, shape, pitch):
    """Number of Voronoi neighbours of each cell, and whether all of them are whole cells near by."""
    subdivision = cv2.Subdiv2D((0, 0, shape[1] + 1, shape[0] + 1))
    ids = {}
    for index, (centre, _, _) in enumerate(cells):
        ids[subdivision.insert(tuple(float(v) for v in centre))] = index
    neighbours = [set() for _ in cells]
    whole = [True] * len(cells)
    for vertex, index in ids.items():
        first = subdivision.getVertex(vertex)[1]
        edge = first
        while True:
            other = subdivision.edgeDst(edge)[0]
            if other in ids and math.dist(cells[ids[other]][0], cells[index][0]) < 1.6 * pitch:
                neighbours[index].add(ids[other])
                whole[index] &= cells[ids[other]][2]
            else:
                whole[index] = False
            edge = subdivision.getEdge(edge, cv2.SUBDIV2D_NEXT_AROUND_ORG)
            if edge == first:
                break
    return [len(n) for n in neighbours], whole


def write(path, cells, sides, whole):
    with open(path, "w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow("id x_px y_px sides other_sides status confidence area_px2 seen".split())
        for index, ((x, y), area, framed) in enumerate(cells):
            complete = framed and whole[index]
            row = [sides[index], "", "complete", 0.9] if complete else ["", "", "cut", 0]
            out.writerow([index, round(x, 2), round(y, 2), *row, round(area, 1), 1])


def agreement(cells, sides, whole, table, pitch):
    """Cell by cell: complete ones of the program that OpenCV finds too, and those of the same count.

    Sides are compared where OpenCV has found every cell of the program around the cell, one for one: where it misses one,
    its count says nothing of the program's. Where a wall is too short to decide, the program gives both values, and either agrees.
    """
    rows = [row for row in csv.DictReader(open(table, newline="", encoding="utf-8")) if row["status"] != "uncertain"]
    places = np.array([(float(row["x_px"]), float(row["y_px"])) for row in rows]).reshape(-1, 2)
    centres = np.array([c for c, _, _ in cells]).reshape(-1, 2)
    partner, used = {}, set()
    for index, place in enumerate(places):
        distance = np.hypot(*(centres - place).T) if len(centres) else np.array([np.inf])
        nearest = int(distance.argmin())
        if distance[nearest] <= MATCH * pitch and nearest not in used:
            partner[index] = nearest
            used.add(nearest)
    ours = [index for index, row in enumerate(rows) if row["status"] == "complete"]
    compared = same = 0
    differing = []
    for index in ours:
        if index not in partner:
            continue
        near = np.nonzero(np.hypot(*(places - places[index]).T) < 1.6 * pitch)[0]
        mate = partner[index]
        around = np.hypot(*(centres - centres[mate]).T) < 1.6 * pitch
        if not whole[mate] or not cells[mate][2] or any(n not in partner for n in near) or around.sum() != len(near):
            continue
        compared += 1
        count = int(rows[index]["sides"])
        agrees = sides[mate] == count or str(sides[mate]) == rows[index]["other_sides"]
        same += agrees
        if not agrees:
            differing.append({"x_px": places[index][0], "y_px": places[index][1], "ours": count, "opencv": sides[mate]})
    found = sum(index in partner for index in ours)
    return {
        "complete_cells": len(ours),
        "found_by_opencv": found,
        "compared": compared,
        "same_sides": same,
        "agreement": same / compared if compared else None,
        "differing": differing,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photo", type=pathlib.Path)
    parser.add_argument("--cells", type=pathlib.Path, help="cells.csv of combwright comb")
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("opencv"))
    arguments = parser.parse_args()
    start = time.perf_counter()
    colour = cv2.imread(str(arguments.photo), cv2.IMREAD_COLOR)
    if colour is None:
        sys.exit(f"error: {arguments.photo} cannot be read as a picture")
    pitch, sign = pitch_of(cv2.cvtColor(colour, cv2.COLOR_BGR2GRAY))
    if pitch == 0:
        sys.exit(f"error: {arguments.photo}: no comb found")
    cells = segment(colour, pitch, sign)
    sides, whole = sides_of(cells, colour.shape, pitch)
    seconds = time.perf_counter() - start
    arguments.output.mkdir(parents=True, exist_ok=True)
    write(arguments.output / "cells.csv", cells, sides, whole)
    report = {"photo": arguments.photo.name, "pitch_px": round(float(pitch), 2), "cells": len(cells), "seconds": round(seconds, 3)}
    if arguments.cells:
        report |= agreement(cells, sides, whole, arguments.cells, pitch)
    (arguments.output / "agreement.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps({k: v for k, v in report.items() if k != "differing"}))


if __name__ == "__main__":
    main()
