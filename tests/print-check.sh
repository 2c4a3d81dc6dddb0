#!/usr/bin/env bash
# The parts of a small enclosure, held against programs that no one here wrote: admesh, manifold3d, trimesh and lib3mf.
# PYTHON names a Python with the packages of print-check.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
# The program that `cargo test` has built, if it has: another build would take minutes.
program=${CARGO_TARGET_DIR:-target}/debug/combwright
test -x "$program" || cargo build --quiet
"$program" enclosure enclosures/test-print/recipe.toml -o "$out" >/dev/null

if command -v admesh >/dev/null; then
    for part in "$out"/*.stl; do
        report=$(admesh "$part")
        for line in 'Number of parts *: *1 ' 'Degenerate facets *: *0' 'Edges fixed *: *0' 'Facets removed *: *0' 'Facets added *: *0' 'Facets reversed *: *0' 'Backwards edges *: *0'; do
            grep -Eq "$line" <<<"$report" || { echo "admesh: $part: no line '$line'" >&2; echo "$report" >&2; exit 1; }
        done
        echo "admesh: $(basename "$part"): one part, nothing to repair"
    done
else
    echo "admesh: not installed, skipped"
fi

"${PYTHON:-python3}" - "$out" <<'PYTHON'
import pathlib
import sys

import lib3mf
import manifold3d
import numpy as np
import trimesh

out = pathlib.Path(sys.argv[1])
for path in sorted(out.glob("*.stl")):
    mesh = trimesh.load_mesh(path)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0, path.name
    solid = manifold3d.Manifold(manifold3d.Mesh(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)))
    assert "NoError" in str(solid.status()) and len(solid.decompose()) == 1, (path.name, solid.status())
    print(f"manifold3d, trimesh: {path.name}: one closed solid of genus {solid.genus()}, {mesh.volume / 1e3:.2f} cm³")
model = lib3mf.get_wrapper().CreateModel()
reader = model.QueryReader("3mf")
reader.SetStrictModeActive(True)
reader.ReadFromFile(str(out / "enclosure.3mf"))
assert reader.GetWarningCount() == 0
objects = model.GetMeshObjects()
names = []
while objects.MoveNext():
    part = objects.GetCurrentMeshObject()
    assert part.IsManifoldAndOriented(), part.GetName()
    names.append(part.GetName())
assert names == ["inner-shell", "outer-shell", "base"], names
print("lib3mf, strict:", ", ".join(names))
PYTHON
