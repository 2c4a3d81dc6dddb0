"""The bubble at the neck of the P-surface by a method that shares nothing with combwright: one smooth patch, expanded in
cosines round the bubble and Legendre polynomials through the gap, with the volume exact on every level surface.

The film between the walls cos 2πx + cos 2πy + cos 2πz = ±δ, round the neck point (0, ½, ¼), is
    x = R cos θ,  y = ½ + R sin θ,  z from Φ(x, y, z) = δ s,      R(θ, s) = Σ a_kl cos 2kθ P_l(s),
with the point's two mirror planes built in. Its area is least at the given volume by Newton steps on a_kl and the pressure.

    python analysis/bubble_neck.py            # a table: volume, terms, energy, pressure
"""

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss

DELTA = 0.2
TURN = 2 * np.pi
VOLUMES = (0.0005, 0.002, 0.004, 0.005, 0.007, 0.01)
# Cosines, polynomials; points round a quarter, outward in the volume, and through the gap.
SIZES = ((6, 5, 24, 24, 10), (10, 8, 48, 40, 16), (16, 10, 80, 40, 24), (24, 12, 120, 60, 30))


def level(r, cos, sin, phi):
    """cos 2πz, sin 2πz and their slopes' numerators at (R cos θ, ½ + R sin θ) on the level φ."""
    x, y = TURN * r * cos, TURN * r * sin
    q = phi - np.cos(x) + np.cos(y)
    return np.sqrt(1 - q * q), np.sin(x), -np.sin(y)


def area_density(r, r_theta, r_s, cos, sin, phi):
    root, by_x, by_y = level(r, cos, sin, phi)
    z_x, z_y, z_s = -by_x / root, -by_y / root, -DELTA / (TURN * root)
    a = (r_theta * cos - r * sin, r_theta * sin + r * cos)
    b = (r_s * cos, r_s * sin)
    a_z = z_x * a[0] + z_y * a[1]
    b_z = z_s + z_x * b[0] + z_y * b[1]
    normal = (a[1] * b_z - a_z * b[1], a_z * b[0] - a[0] * b_z, a[0] * b[1] - a[1] * b[0])
    return np.sqrt(sum(n * n for n in normal))


def volume_density(r, cos, sin, phi, outward):
    """∫ r dr / |∂Φ/∂z| from the centre to the film, on each level, by the coarea formula."""
    nodes, weights = outward
    return DELTA / TURN * sum(
        w * r * (r * t) / level(r * t, cos, sin, phi)[0] for t, w in zip(nodes, weights)
    )


def slope(f, values, at):
    """The derivative of f by one argument, by a complex step: exact to rounding."""
    moved = list(values)
    moved[at] = moved[at] + 1e-30j
    return np.imag(f(*moved)) / 1e-30


def second(f, values, i, j, step=1e-6):
    """A second derivative: Newton needs no more than a few digits of it."""
    up, down = list(values), list(values)
    up[j], down[j] = up[j] + step, down[j] - step
    return (slope(f, up, i) - slope(f, down, i)) / (2 * step)


def bubble(volume, cosines, polynomials, around, outward, through):
    theta = (np.arange(around) + 0.5) * (np.pi / 2) / around
    s, weight = leggauss(through)
    theta, s_grid = (grid.ravel() for grid in np.meshgrid(theta, s, indexing="ij"))
    weight = 4 * np.outer(np.full(around, np.pi / 2 / around), weight).ravel()
    nodes, weights = leggauss(outward)
    radial = ((nodes + 1) / 2, weights / 2)
    basis = [[], [], []]
    for k in range(cosines):
        for polynomial in map(Legendre.basis, range(polynomials)):
            basis[0].append(np.cos(2 * k * theta) * polynomial(s_grid))
            basis[1].append(-2 * k * np.sin(2 * k * theta) * polynomial(s_grid))
            basis[2].append(np.cos(2 * k * theta) * polynomial.deriv()(s_grid))
    basis = [np.array(b) for b in basis]
    place = (np.cos(theta), np.sin(theta), DELTA * s_grid)

    def area(*values):
        return area_density(*values, *place)

    def edge(r):
        return DELTA / TURN * r / level(r, *place)[0]

    size = len(basis[0])
    a = np.zeros(size)
    a[0] = 0.85 * np.sqrt(volume / (np.pi * DELTA / np.pi))
    pressure = 1 / a[0]
    for _ in range(60):
        values = [a @ b for b in basis]
        by_volume = basis[0] @ (weight * edge(values[0]))
        force = sum(basis[i] @ (weight * slope(area, values, i)) for i in range(3)) - pressure * by_volume
        matrix = np.zeros((size + 1, size + 1))
        for i in range(3):
            for j in range(3):
                matrix[:size, :size] += (basis[i] * (weight * second(area, values, i, j))) @ basis[j].T
        matrix[:size, :size] -= pressure * (basis[0] * (weight * slope(edge, values[:1], 0))) @ basis[0].T
        matrix[:size, size], matrix[size, :size] = -by_volume, by_volume
        missing = volume - (weight * volume_density(values[0], *place, radial)).sum()
        step = np.linalg.solve(matrix, np.append(-force, missing))
        part = min(1.0, 0.03 / np.abs(step[:size] @ basis[0]).max())
        a += part * step[:size]
        pressure += part * step[size]
        if np.abs(step[:size]).max() < 1e-12:
            break
    return (weight * area(*(a @ b for b in basis))).sum(), pressure


if __name__ == "__main__":
    print("volume   terms    energy           pressure")
    for volume in VOLUMES:
        for size in SIZES:
            energy, pressure = bubble(volume, *size)
            print(f"{volume:<8} {size[0]:>2} × {size[1]:<2}  {energy:.12f}  {pressure:.9f}", flush=True)
