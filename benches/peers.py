#!/usr/bin/env python3
"""The benchmark's solid by other programs: 0.2 <= |phi| <= 0.365, L = 100, half cell. Prints seconds and peak MB.

usage: peers.py vtk|vtk-clipped|skimage SAMPLES     needs numpy and vtk or scikit-image
"""
import resource
import sys
import time

import numpy as np

PERIOD, INNER, OUTER = 100.0, 0.2, 0.365


def field(samples, beyond):
    """||phi| - middle| - half over the half cell, `beyond` samples past its faces: negative inside the walls."""
    n = samples
    x = np.arange(-beyond, n + 1 + beyond) / n
    z = np.arange(-beyond, n // 2 + 1 + beyond) / n
    cx, cz = np.cos(2 * np.pi * x), np.cos(2 * np.pi * z)
    phi = cx[:, None, None] + cx[None, :, None] + cz[None, None, :]
    return np.abs(np.abs(phi) - 0.5 * (INNER + OUTER)) - 0.5 * (OUTER - INNER)


def by_vtk(samples, clipped):
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints  # noqa: F401  (registers the object factory)
    from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPlane, vtkPlaneCollection
    from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D
    from vtkmodules.vtkFiltersGeneral import vtkClipClosedSurface

    beyond = 2
    values = field(samples, beyond)
    if not clipped:
        # Closed by a frame of outside samples at the faces, which chamfers the edges.
        values[[0, 1, -2, -1]] = values[:, [0, 1, -2, -1]] = values[:, :, [0, 1, -2, -1]] = 0.5
    image = vtkImageData()
    image.SetDimensions(values.shape)
    step = PERIOD / samples
    image.SetSpacing(step, step, step)
    image.SetOrigin(*(3 * [-beyond * step]))
    image.GetPointData().SetScalars(numpy_to_vtk(np.ascontiguousarray(values.transpose(2, 1, 0)).ravel()))
    edges = vtkFlyingEdges3D()
    edges.SetInputData(image)
    edges.SetValue(0, 0.0)
    edges.ComputeNormalsOff()
    edges.ComputeGradientsOff()
    edges.ComputeScalarsOff()
    edges.Update()
    mesh = edges.GetOutput()
    if clipped:
        bounds = [(0, PERIOD), (0, PERIOD), (0, PERIOD / 2)]
        for axis, (low, high) in enumerate(bounds):
            for at, sign in ((low, 1.0), (high, -1.0)):
                plane = vtkPlane()
                origin, normal = [0.0] * 3, [0.0] * 3
                origin[axis], normal[axis] = at, sign
                plane.SetOrigin(origin)
                plane.SetNormal(normal)
                planes = vtkPlaneCollection()
                planes.AddItem(plane)
                clip = vtkClipClosedSurface()
                clip.SetInputData(mesh)
                clip.SetClippingPlanes(planes)
                clip.Update()
                mesh = clip.GetOutput()
    return mesh.GetNumberOfPolys()


def by_skimage(samples):
    from skimage.measure import marching_cubes

    values = np.pad(field(samples, 0), 1, constant_values=0.5)
    _, faces, _, _ = marching_cubes(values, 0.0, spacing=(PERIOD / samples,) * 3)
    return len(faces)


def main():
    peer, samples = sys.argv[1], int(sys.argv[2])
    if peer.startswith("vtk"):
        import vtkmodules.vtkFiltersCore  # noqa: F401  (loading is not timed)
        import vtkmodules.vtkFiltersGeneral  # noqa: F401
    else:
        import skimage.measure  # noqa: F401
    started = time.perf_counter()
    count = by_skimage(samples) if peer == "skimage" else by_vtk(samples, peer == "vtk-clipped")
    seconds = time.perf_counter() - started
    assert count > 0
    print(seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


main()
