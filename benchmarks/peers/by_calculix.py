# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch, case A, as an input file of CalculiX, and its displacements back; bricks of 8 or of 20 nodes."""

from __future__ import annotations

import re
import resource
import signal
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.measurement import run_alone

# Nodes of CalculiX' bricks among 8 or 27 that are sorted by z, then y, then x of the reference cell.
C3D8 = [0, 1, 3, 2, 4, 5, 7, 6]
C3D20 = [0, 2, 8, 6, 18, 20, 26, 24, 1, 5, 7, 3, 19, 23, 25, 21, 9, 11, 17, 15]
# Upper and lower side exchanged.
TURNED = [4, 5, 6, 7, 0, 1, 2, 3, 12, 13, 14, 15, 8, 9, 10, 11, 16, 17, 18, 19]  # fmt: skip
FACES = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
STIFF = 50.0  # penalty over Young's modulus, 1/mm: pressure per overclosure and, the same, friction per slip


def lines_of(given: dict, kind: str) -> list[str]:
    """An input file with a step of CalculiX for each load step; it divides a step when it does not converge.

    Args:
        given: ``x``, ``cells``, ``contact``, ``held``, ``young``, ``poisson``, ``mu``, ``programme``; may have ``stiff``, the penalty
            over Young's modulus, and ``element``, the name of the bricks.
        kind: "node to surface", "surface to surface" or "mortar".
    """
    young, penalty = given["young"], given.get("stiff", STIFF) * given["young"]
    pressure = ["HARD"] if kind == "mortar" else ["LINEAR", f"{penalty:.6e}, 1e-3"]
    element, held = given.get("element", "C3D8"), given["held"]
    top = held[held[:, 1] == 2, 0]  # nothing else is held along z
    lines = _mesh(given["x"], given["cells"], given["contact"], top, element)
    lines += [
        "*MATERIAL, NAME=STEEL", "*ELASTIC", f"{young:.10e}, {given['poisson']:.10e}",
        "*SOLID SECTION, ELSET=EBODY, MATERIAL=STEEL", "*SOLID SECTION, ELSET=EPLANE, MATERIAL=STEEL",
        "*SURFACE INTERACTION, NAME=RUB", f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={pressure[0]}", *pressure[1:],
        "*FRICTION", f"{given['mu']:.10e}, {penalty:.6e}",
        f"*CONTACT PAIR, INTERACTION=RUB, TYPE={kind.upper()}", "SLAVE, MASTER",
        "*BOUNDARY", "NPLANE, 1, 3", *(f"{node + 1}, {k + 1}" for node, k in held if k < 2),
    ]  # fmt: skip
    for displacement in given["programme"]:
        lines += [
            "*STEP, INC=1000", "*STATIC", "1., 1.", "*BOUNDARY", f"NTOP, 3, 3, {-displacement:.12e}",
            "*NODE PRINT, NSET=NBODY, FREQUENCY=1000", "U", "*END STEP",
        ]  # fmt: skip
    return lines


def _mesh(x, cells, contact, top, element) -> list[str]:
    """Nodes and elements of the body and of a block that is the plane, and their surfaces."""
    cells = cells[:, C3D8 if cells.shape[1] == 8 else C3D20]
    edges = x[cells]
    turned = np.linalg.det(edges[:, [1, 3, 4]] - edges[:, :1]) < 0  # inside out
    cells[turned] = cells[turned][:, TURNED[: cells.shape[1]]]
    n, m, wide = len(x), len(cells), 1.6 * np.abs(x[:, :2]).max()
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    block = [(a * wide, b * wide, z) for z in (-wide, 0.0) for a, b in corners]
    touching = np.isin(cells, contact)
    lower = [
        f"{k}, S{face}"
        for face, nodes in enumerate(FACES, start=1)
        for k in np.flatnonzero(touching[:, nodes].all(axis=1)) + 1
    ]
    return [
        "*NODE, NSET=NBODY", *numbered(1, x, ".12e"), "*NODE, NSET=NPLANE", *numbered(n + 1, block, ".12e"),
        f"*ELEMENT, TYPE={element}, ELSET=EBODY", *numbered(1, cells + 1),
        "*ELEMENT, TYPE=C3D8, ELSET=EPLANE", *numbered(m + 1, [range(n + 1, n + 9)]),
        "*SURFACE, NAME=SLAVE, TYPE=ELEMENT", *lower,
        "*SURFACE, NAME=MASTER, TYPE=ELEMENT", f"{m + 1}, S2", "*NSET, NSET=NTOP", *(f"{k + 1}," for k in top),
    ]  # fmt: skip


def numbered(first: int, rows, style: str = "") -> list[str]:
    """Lines of a number, from ``first`` on, and the values of a row; of 16 entries at most, after a comma it goes on."""
    lines = (
        [str(k), *(format(value, style) for value in row)] for k, row in enumerate(rows, first)
    )
    return [
        ",\n".join(", ".join(line[k : k + 16]) for k in range(0, len(line), 16)) for line in lines
    ]


def read(file: Path, nodes: int) -> np.ndarray:
    """Displacements of all steps that were done, ``shape=(steps, nodes, 3)``."""
    lines = re.findall(r"^ +\d+(?: +\S+){3} *$", file.read_text() if file.exists() else "", re.M)
    whole = len(lines) // nodes * nodes
    return np.array([line.split()[1:] for line in lines[:whole]], float).reshape(-1, nodes, 3)


def own_errors(said: str) -> list[float]:
    """What CalculiX itself calls the error of each increment that converged.

    The largest residual force over the average force, or the last correction of the displacements over their increment,
    whichever is larger.
    """
    value, errors = {}, []
    for line in said.splitlines():
        if match := re.match(
            r" (?:time |largest )(avg|residual|increment|correction).*=\s*(\S+)", line
        ):
            value[match[1]] = float(match[2])
        elif line.strip() == "convergence" and len(value) == 4:
            force = value["residual"] / value["avg"]
            errors.append(max(force, value["correction"] / value["increment"]))
    return errors


def solve(given: dict, kind: str, cap: int) -> dict:
    """The punch by CalculiX, see ``run``."""
    return run(lines_of(given, kind), len(given["x"]), len(given["programme"]), cap)


def run(lines: list[str], nodes: int, steps: int, cap: int) -> dict:
    """Run CalculiX for at most ``cap`` processor seconds.

    Args:
        lines: Of the input file.
        nodes: How many it prints.
        steps: How many it is asked for.
        cap: Processor seconds.

    Returns:
        Displacements ``u``, its ``own`` errors, what it ``said`` if it stopped early, and processor ``seconds``.
    """
    with tempfile.TemporaryDirectory() as name:
        directory, before, said = Path(name), ended(), ""
        (directory / "given.inp").write_text("\n".join(lines) + "\n")
        done = run_alone(["ccx", "given"], directory,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (cap, cap)))  # fmt: skip
        seconds, u = ended() - before, read(directory / "given.dat", nodes)
    if done.returncode in (-signal.SIGKILL, -signal.SIGXCPU):
        said = f"stopped after {cap} s"
    elif len(u) < steps:
        errors = [line for line in (done.stdout + done.stderr).splitlines() if "*ERROR" in line]
        said = " ".join(errors[-2:]) or f"ended with {done.returncode}"
    return dict(u=u, own=own_errors(done.stdout), said=said, seconds=seconds)


def ended() -> float:
    """Processor seconds of the processes that ended."""
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
