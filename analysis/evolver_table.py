#!/usr/bin/env python3
"""Runs Surface Evolver and combwright on the same datafiles with the same commands and prints their numbers side by side.

    python3 analysis/evolver_table.py [--evolver PROGRAM] [--combwright PROGRAM] [--paper FOLDER] [--markdown]

The datafiles are those of the Debian package evolver-doc (found by dpkg) and the paper's, in the folder given. Both programs
print the energy and the volumes themselves, so the table holds what they say and nothing else. CPU seconds are user seconds.
"""

import argparse
import re
import resource
import shutil
import subprocess
import tempfile
from pathlib import Path

REPORT = (
    'printf "RESULT %.15g\\n", total_energy; '
    'foreach body bb do { printf "BODY %d %.15g %.15g\\n", bb.id, bb.volume, bb.pressure }; '
)

# What is run on each file. Both programs get exactly these commands.
LEVELS = "r; u; V; V; V; g 30; hessian_seek; hessian_seek; hessian; hessian; hessian"
CASES = [
    ("cube.fe", "gogo"),
    ("mound.fe", "gogo"),
    ("column.fe", "u; g 5; r; g 5; r; g 5; hessian; hessian"),
    ("cat.fe", "rmax := 1; zmax := 0.55; recalc; u; r; g 20; hessian; hessian; hessian"),
    ("catbody.fe", "gogo"),
    ("twointor.fe", "gogo"),
    ("phelanc.fe", "g 5; r; g 5; hessian; hessian; hessian"),
    ("quad.fe", "gogo"),
    ("tankex.fe", "g 5; r; g 5; r; g 10"),
    ("sphere.fe", "g 2; r; g 5; r; g 5"),
    ("qmound.fe", "gogo"),
    ("catman.fe", "r; u; g 20; hessian; hessian"),
    ("octa.fe", "g 5"),
    ("slidestr.fe", "r; g 50"),
    ("popstr.fe", "g 5"),
    ("100grain.fe", "g 5"),
    ("addload_example.fe", "g 5"),
    ("crystal.fe", "g 5"),
    ("knotty.fe", "g 5"),
    ("metric.fe", "g 5"),
    ("mylarcube.fe", "g 5"),
    ("quadm.fe", "g 5"),
    ("relaxed.fe", "g 5"),
    ("simplex3.fe", "g 5"),
    ("symtest.fe", "g 5"),
]
PAPER = [
    ("Sphere.fe", LEVELS),
    ("Sphere.fe", "; ".join([LEVELS] * 3)),
    ("Torus.fe", LEVELS),
    ("TorusOuter.fe", "; ".join([LEVELS] * 2)),
    ("TorusTop.fe", "; ".join([LEVELS] * 2)),
    ("TorusInner.fe", "; ".join([LEVELS] * 2)),
    ("Psurface.fe", "gogo"),
    ("PsurfaceOriented.fe", "body[1].target := 0.002; re1; re2; g 20; r; g 50"),
    ("foams/plates_64.fe", "g 30; hessian_seek; hessian_seek; hessian_seek"),
    ("foams/plates_256.fe", "g 30; hessian_seek; hessian_seek; hessian_seek"),
    ("foams/flat2d_64.fe", "M 2; g 3; hessian; hessian; hessian"),
]

# Quadratic elements at five levels; the energy errs by the fourth power of the length of edges, so a sixteenth each time.
QUADRATIC = (
    "r; u; V; g 30; hessian_seek; M 2; hessian_seek; hessian; hessian; hessian; {report}"
    + 4 * "r; hessian; hessian; hessian; {report}"
)
# What they converge to: by shooting for the sphere, by Surface Evolver for the torus.
CONVERGED = [
    ("Sphere.fe", 1.772233011001),
    ("TorusOuter.fe", 0.0792337262),
    ("TorusTop.fe", 0.0792683805),
    ("TorusInner.fe", 0.0793193176),
]
# Bubbles that are brought to rest level by level, what comes before, and whether they come to rest: the last does not between
# these coarse walls, and full Newton steps destroy it in Surface Evolver, so that only the energies as read are compared.
SAME_MESH = [
    ("Sphere.fe", "", True),
    ("Torus.fe", "", True),
    ("TorusOuter.fe", "", True),
    ("TorusTop.fe", "", True),
    ("TorusInner.fe", "", True),
    ("PsurfaceOriented.fe", "body[1].target := 0.002; re1; g 20; ", False),
]
LEVEL_COUNT = 5
# The relaxed foams between plates, with half the length of the circular arcs in the plane (`flat_foam_exact.py`).
PLATES = [("foams/plates_64.fe", 61.5290100494), ("foams/plates_256.fe", 245.9269491822)]
# Seconds that Surface Evolver's best script on them may take on a loaded machine.
PATIENCE = 1800


def examples():
    """The folder of evolver-doc's datafiles."""
    listed = subprocess.run(["dpkg", "-L", "evolver-doc"], capture_output=True, text=True, check=False).stdout
    for line in listed.splitlines():
        if line.endswith("/examples/cube.fe"):
            return Path(line).parent
    return None


def timed(command, patience=300, **options):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=patience, **options)
        text = done.stdout + done.stderr
    except subprocess.TimeoutExpired:
        text = f"error: no end after {patience} s"
    return text, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def figures(text):
    """The last energy and the bodies' volumes and pressures; or what went wrong."""
    energies = re.findall(r"RESULT (-?\d\S*)", text)
    if not energies:
        found = re.search(r"(?:error: )?(not supported: [^\n]*)|error: ([^\n]*)", text)
        reason = (found.group(1) or found.group(2)) if found else "no result"
        return None, [], reason
    bodies = re.findall(r"BODY (\d+) (-?\d\S*) (-?\d\S*)", text)
    return float(energies[-1]), bodies, ""


def run_evolver(program, file, commands, patience=300):
    script = "quiet on\n" + "\n".join(part for part in (commands, REPORT)) + "\nq\nq\n"
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / file.name
        shutil.copy(file, copy)
        return timed([program, copy.name], patience, input=script, cwd=folder)


def run_combwright(program, file, commands, as_printed):
    options = ["--as-printed"] if as_printed else []
    with tempfile.TemporaryDirectory() as folder:
        return run_in(program, file, commands, folder, options)


def run_in(program, file, commands, folder, options=()):
    """Runs combwright with what it writes in a folder."""
    return timed([program, "evolver", "run", str(file), "-c", "quiet on", "-c", commands, "-c", REPORT, "-o", str(folder), *options])


def energies(text):
    return [float(value) for value in re.findall(r"RESULT (-?\d\S*)", text)]


def converged(arguments, file, reference):
    """Both programs' energies by level, and what they tend to."""
    commands = QUADRATIC.format(report=REPORT)
    for name, result in (
        ("Surface Evolver", run_evolver(arguments.evolver, file, commands)),
        ("combwright", run_combwright(arguments.combwright, file, commands, False)),
    ):
        found = energies(result[0])[:5]
        if len(found) < 5:
            print(f"{file.name:16} {name:16} {figures(result[0])[2]}", flush=True)
            continue
        limit = found[-1] + (found[-1] - found[-2]) / 15
        levels = " ".join(f"{value:.12f}" for value in found[-2:])
        print(f"{file.name:16} {name:16} {levels} limit {limit:.10f} reference {reference:.10f} "
              f"{limit / reference - 1:+.1e}  {result[1]:.2f} s", flush=True)


def same_mesh(arguments, file, first, rests):
    """The energy at rest of linear elements, level by level: combwright's, and Surface Evolver's on the same mesh, as read and
    brought to rest."""
    rest = "hessian; hessian; hessian"
    level = "r; u; V; g 30; hessian_seek; hessian_seek; " + rest
    with tempfile.TemporaryDirectory() as folder:
        commands = first + "".join(f'{level}; {REPORT} dump "level{at}.fe"; ' for at in range(1, LEVEL_COUNT + 1))
        ours = run_in(arguments.combwright, file, commands, folder)
        dumps = [Path(folder) / f"level{at}.fe" for at in range(1, LEVEL_COUNT + 1)]
        if len(energies(ours[0])) < LEVEL_COUNT or not all(dump.exists() for dump in dumps):
            print(f"{file.name:20} {figures(ours[0])[2]}", flush=True)
        for dump, here in zip(dumps, energies(ours[0])):
            found = energies(run_evolver(arguments.evolver, dump, REPORT + "\n" + "\n".join(rest.split("; ")))[0])
            facets = len(re.findall(r"^\s*\d+", dump.read_text().lower().split("faces", 1)[1].split("bodies")[0], re.M))
            if len(found) == 2:
                at_rest = f"at rest {found[1] / here - 1:+.1e}" if rests else ""
                print(f"{file.name:20} {facets:6} facets  {here:.14g}  at once {found[0] / here - 1:+.1e}  {at_rest}", flush=True)


def levels(arguments):
    print("\nlinear elements at rest, level by level, Surface Evolver relative to combwright on the same mesh")
    for name, first, rests in SAME_MESH:
        if not arguments.only or arguments.only in name:
            same_mesh(arguments, arguments.paper / name, first, rests)


def plates(arguments, file, reference):
    """Surface Evolver's best script on a foam between plates, and quadratic elements here."""
    script = (file.parent / "relax.cmd").read_text()
    theirs = run_evolver(arguments.evolver, file, script, PATIENCE)
    found = re.findall(r"REP .*? en (\S+)", theirs[0])
    ours = run_combwright(arguments.combwright, file, f"M 2; hessian_seek; hessian; {REPORT} r; hessian", False)
    here = energies(ours[0])
    if found and here:
        print(f"{file.name:16} Surface Evolver {float(found[-1]):.9g} ({float(found[-1]) / reference - 1:+.1e}) {theirs[1]:.2f} s  "
              f"combwright {here[0]:.9g}, refined {here[-1]:.9g} ({here[-1] / reference - 1:+.1e}) {ours[1]:.2f} s", flush=True)


def compare(arguments, row, cases):
    """Both programs on the same files with the same commands."""
    for file, commands in cases:
        if not file.exists() or (arguments.only and arguments.only not in file.name):
            continue
        result = run_evolver(arguments.evolver, file, commands)
        answer = run_combwright(arguments.combwright, file, commands, file.name == "Psurface.fe")
        (theirs, _, why_theirs), (ours, _, why_ours) = figures(result[0]), figures(answer[0])
        difference = f"{abs(ours / theirs - 1):.1e}" if ours is not None and theirs else "-"
        shown = [f"{value:.12g}" if value is not None else why for value, why in ((theirs, why_theirs), (ours, why_ours))]
        print(row.format(file.name, *shown, difference, f"{result[1]:.2f}", f"{answer[1]:.2f}"), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--evolver", default="evolver-nox-d")
    parser.add_argument("--combwright", default="target/debug/combwright")
    parser.add_argument("--paper", type=Path, default=Path("../shared/fe"))
    parser.add_argument("--only", help="only files whose name holds this")
    parser.add_argument("--levels", action="store_true", help="only linear elements at rest, level by level")
    parser.add_argument("--markdown", action="store_true", help="a table for the documentation")
    arguments = parser.parse_args()
    if arguments.levels:
        levels(arguments)
        return
    folder = examples()
    cases = [(folder / name, commands) for name, commands in CASES] if folder else []
    cases += [(arguments.paper / name, commands) for name, commands in PAPER]
    row = "| {} | {} | {} | {} | {} | {} |" if arguments.markdown else "{:22} {:>21} {:>21} {:>9} {:>7} {:>7}"
    print(row.format("datafile", "Surface Evolver", "combwright", "relative", "s", "s"))
    if arguments.markdown:
        print("|---|---|---|---|---|---|")
    compare(arguments, row, cases)
    if arguments.only or arguments.markdown:
        return
    print("\nconverged with quadratic elements, five levels")
    for name, reference in CONVERGED:
        converged(arguments, arguments.paper / name, reference)
    levels(arguments)
    print("\nfoams between plates")
    for name, reference in PLATES:
        plates(arguments, arguments.paper / name, reference)


if __name__ == "__main__":
    main()
