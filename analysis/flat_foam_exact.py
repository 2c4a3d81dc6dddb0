#!/usr/bin/env python3
"""The energy of a flat periodic foam whose films are circular arcs: the exact limit of a foam between parallel plates.

    python3 analysis/flat_foam_exact.py DUMP PERIOD [--height 0.5]

DUMP is a dump of Surface Evolver's string model (`../shared/fe/foams/flat2d_64.fe`, period 8); only its vertices and who
touches whom are used. Unknowns are the vertices, half the angle that each arc turns by, and the pressures; Newton steps with
derivatives by complex differentiation bring lengths at equal areas to a stationary point. An arc of chord c that turns by 2θ
has the length cθ/sin θ and cuts off the area (c²/4)(θ/sin²θ − cot θ), so nothing but rounding separates the result from the
foam itself: no mesh, hence no error of a mesh. Needs numpy (`requirements.txt`).
"""

import argparse
import re
from pathlib import Path

import numpy as np

SMALL = 1e-3  # below it θ/sin θ and the segment's area are series, accurate to 1e-17


class Foam:
    """Who touches whom on a flat torus."""

    def __init__(self, text, period):
        text = text.replace("\\\n", " ")
        rows = lambda start, end: [
            row.split("/*")[0].split()
            for row in re.search(rf"^{start}\b.*?$(.*?)^{end}\b", text, re.M | re.S).group(1).split("\n")
            if row.strip()
        ]
        vertices = {int(r[0]): [float(x) for x in r[1:3]] for r in rows("vertices", "edges")}
        edges = {int(r[0]): r[1:5] for r in rows("edges", "faces")}
        rings = [[int(x) for x in r[1:] if re.fullmatch(r"-?\d+", x)] for r in rows("faces", "bodies")]
        rings = [ring for ring in rings if len(ring) > 2]
        number = {name: i for i, name in enumerate(sorted(vertices))}
        arc = {name: i for i, name in enumerate(sorted(edges))}
        self.places = np.array([vertices[name] for name in sorted(vertices)])
        self.tails = np.array([number[int(edges[name][0])] for name in sorted(edges)])
        self.heads = np.array([number[int(edges[name][1])] for name in sorted(edges)])
        wrap = {"+": 1, "-": -1, "*": 0}
        self.wraps = period * np.array([[wrap[w] for w in edges[name][2:4]] for name in sorted(edges)], float)
        # Sides of cells: cell, arc, sign, and how far the arc's stored place is from the cell's frame.
        sides = []
        self.left, self.right = np.zeros(len(edges), int), np.zeros(len(edges), int)
        for cell, ring in enumerate(rings):
            shift = np.zeros(2)
            for edge in ring:
                i = arc[abs(edge)]
                if edge > 0:
                    sides.append((cell, i, 1.0, *shift))
                    self.left[i] = cell
                    shift = shift + self.wraps[i]
                else:
                    shift = shift - self.wraps[i]
                    sides.append((cell, i, -1.0, *shift))
                    self.right[i] = cell
        self.side_cell = np.array([s[0] for s in sides])
        self.side_arc = np.array([s[1] for s in sides])
        self.side_sign = np.array([s[2] for s in sides])
        self.side_shift = np.array([s[3:5] for s in sides])
        self.cells = len(rings)
        self.area = period**2 / self.cells

    def arcs(self, places, angles):
        """Ends, chord vectors, lengths over chords, segments over squared chords, and the two's derivatives by the angle."""
        start = places[self.tails]
        end = places[self.heads] + self.wraps
        small = abs(angles) < SMALL
        t = np.where(small, 0.1, angles)
        s, c = np.sin(t), np.cos(t)
        length = np.where(small, 1 + angles**2 / 6 + 7 * angles**4 / 360, t / s)
        length_slope = np.where(small, angles / 3 + 7 * angles**3 / 90, (s - t * c) / s**2)
        segment = np.where(small, angles / 6 + angles**3 / 45, (t / s**2 - c / s) / 4)
        segment_slope = np.where(small, 1 / 6 + angles**2 / 15, (s - t * c) / (2 * s**3))
        return start, end, end - start, length, segment, length_slope, segment_slope

    def energy(self, unknowns):
        places, angles, _ = self.split(unknowns)
        _, _, chord, length, *_ = self.arcs(places, angles)
        return float((np.sqrt((chord**2).sum(1)) * length).sum())

    def split(self, unknowns):
        count, arcs = 2 * len(self.places), len(self.tails)
        return unknowns[:count].reshape(-1, 2), unknowns[count : count + arcs], unknowns[count + arcs :]

    def residual(self, unknowns):
        """The gradient of lengths − pressures × areas, and the areas' errors."""
        places, angles, pressures = self.split(unknowns)
        start, end, chord, length, segment, length_slope, segment_slope = self.arcs(places, angles)
        c2 = (chord**2).sum(1)
        c = np.sqrt(c2)
        difference = pressures[self.left] - pressures[self.right]
        pull = (length / c - 2 * difference * segment)[:, None] * chord
        by_place = np.zeros_like(places)
        np.add.at(by_place, self.tails, -pull)
        np.add.at(by_place, self.heads, pull)
        a = start[self.side_arc] + self.side_shift
        b = end[self.side_arc] + self.side_shift
        weight = (-0.5 * self.side_sign * pressures[self.side_cell])[:, None]
        np.add.at(by_place, self.tails[self.side_arc], weight * np.stack([b[:, 1], -b[:, 0]], 1))
        np.add.at(by_place, self.heads[self.side_arc], weight * np.stack([-a[:, 1], a[:, 0]], 1))
        by_angle = c * length_slope - difference * c2 * segment_slope
        areas = np.zeros(self.cells, dtype=places.dtype)
        triangle = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        np.add.at(areas, self.side_cell, self.side_sign * (triangle + (c2 * segment)[self.side_arc]))
        return np.concatenate([by_place.ravel(), by_angle, areas - self.area])


def relax(foam):
    """Newton steps in the least-squares sense: translations and a common pressure are free."""
    unknowns = np.concatenate([foam.places.ravel(), np.zeros(len(foam.tails) + foam.cells)])
    for _ in range(30):
        residual = foam.residual(unknowns)
        if abs(residual).max() < 1e-12:
            break
        jacobian = np.empty((len(unknowns), len(unknowns)))
        for column in range(len(unknowns)):
            moved = unknowns.astype(complex)
            moved[column] += 1e-20j
            jacobian[:, column] = foam.residual(moved).imag / 1e-20
        step = np.linalg.lstsq(jacobian, -residual, rcond=1e-9)[0]
        unknowns = unknowns + step * min(1.0, 0.3 / abs(step[: -foam.cells]).max())
    return unknowns, abs(foam.residual(unknowns)).max()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("dump", type=Path)
    parser.add_argument("period", type=float)
    parser.add_argument("--height", type=float, default=0.5)
    arguments = parser.parse_args()
    foam = Foam(arguments.dump.read_text(), arguments.period)
    unknowns, residual = relax(foam)
    energy = foam.energy(unknowns)
    print(f"{foam.cells} cells, length {energy:.10f}, energy {arguments.height * energy:.10f}, residual {residual:.1e}")


if __name__ == "__main__":
    main()
