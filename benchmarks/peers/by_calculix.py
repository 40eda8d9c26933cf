# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch, case A, as an input file of CalculiX, and its displacements back."""

from __future__ import annotations

import re
import resource
import signal
import subprocess
from pathlib import Path

import numpy as np

ORDER = [0, 1, 3, 2, 4, 5, 7, 6]  # DOLFINx's vertices of a hexahedron in the order of C3D8
FACES = [(0, 1, 2, 3), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
KINDS = ("node to surface", "surface to surface", "mortar")


def write(file: Path, given: dict, kind: str, stiff: float) -> None:
    """One step of CalculiX for each load step; it divides a step when it does not converge.

    Args:
        file: The input file.
        given: ``x``, ``cells``, ``contact``, ``top``, ``young``, ``poisson``, ``mu``, ``programme``.
        kind: One of ``KINDS``.
        stiff: Penalty over Young's modulus, per length: pressure per overclosure and, the same, friction
            per slip of a sticking point.
    """
    young, penalty = float(given["young"]), stiff * float(given["young"])
    overclosure = {"mortar": ["HARD"], "node to surface": ["LINEAR", f"{penalty:.6e}, 1e-3"], "surface to surface": ["LINEAR", f"{penalty:.6e}"]}  # fmt: skip
    behaviour, *pressure = overclosure[kind]
    lines = _mesh(given["x"], given["cells"][:, ORDER], given["contact"], given["top"])
    lines += [
        "*MATERIAL, NAME=STEEL", "*ELASTIC", f"{young:.10e}, {float(given['poisson']):.10e}",
        "*SOLID SECTION, ELSET=EBODY, MATERIAL=STEEL", "*SOLID SECTION, ELSET=EPLANE, MATERIAL=STEEL",
        "*SURFACE INTERACTION, NAME=RUB", f"*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE={behaviour}", *pressure,
        "*FRICTION", f"{float(given['mu']):.10e}, {penalty:.6e}",
        f"*CONTACT PAIR, INTERACTION=RUB, TYPE={kind.upper()}", "SLAVE, MASTER",
        "*BOUNDARY", "NPLANE, 1, 3", "NTOP, 1, 2",
    ]  # fmt: skip
    for displacement in given["programme"]:
        lines += [
            "*STEP, INC=1000", "*STATIC", "1., 1.", "*BOUNDARY", f"NTOP, 3, 3, {-displacement:.12e}",
            "*NODE PRINT, NSET=NBODY, FREQUENCY=1000", "U", "*END STEP",
        ]  # fmt: skip
    file.write_text("\n".join(lines) + "\n")


def _mesh(x, cells, contact, top) -> list[str]:
    """Nodes and elements of the body and of a block that is the plane, and their surfaces."""
    edges = x[cells]
    turned = np.linalg.det(edges[:, [1, 3, 4]] - edges[:, :1]) < 0  # inside out
    cells[turned] = cells[turned][:, [4, 5, 6, 7, 0, 1, 2, 3]]
    n, m, wide = len(x), len(cells), 1.6 * np.abs(x[:, :2]).max()
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    block = [(a * wide, b * wide, z) for z in (-wide, 0.0) for a, b in corners]
    lines = ["*NODE, NSET=NBODY"]
    lines += [f"{k + 1}, {p[0]:.12e}, {p[1]:.12e}, {p[2]:.12e}" for k, p in enumerate(x)]
    lines += ["*NODE, NSET=NPLANE"]
    lines += [f"{n + k + 1}, {a:.12e}, {b:.12e}, {c:.12e}" for k, (a, b, c) in enumerate(block)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=EBODY"]
    lines += [", ".join(map(str, [k + 1, *(cell + 1)])) for k, cell in enumerate(cells)]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=EPLANE", ", ".join(map(str, [m + 1, *range(n + 1, n + 9)]))]  # fmt: skip
    touching = np.isin(cells, contact)
    lines += ["*SURFACE, NAME=SLAVE, TYPE=ELEMENT"]
    for face, nodes in enumerate(FACES, start=1):
        lines += [f"{k + 1}, S{face}" for k in np.flatnonzero(touching[:, nodes].all(axis=1))]
    lines += ["*SURFACE, NAME=MASTER, TYPE=ELEMENT", f"{m + 1}, S2", "*NSET, NSET=NTOP"]
    return lines + [f"{k + 1}," for k in top]


def read(file: Path, nodes: int) -> np.ndarray:
    """Displacements of all steps that were done, ``shape=(steps, nodes, 3)``."""
    numbers = [
        [float(v) for v in line.split()]
        for line in file.read_text().splitlines()
        if re.match(r"\s+\d+(\s+\S+){3}\s*$", line)
    ]
    whole = len(numbers) // nodes * nodes
    return np.array(numbers[:whole]).reshape(-1, nodes, 4)[:, :, 1:]


def own_errors(said: str) -> list[float]:
    """What CalculiX itself calls the error of each increment that converged.

    The largest residual force over the average force, or the last correction of the displacements over their increment,
    whichever is larger.
    """
    value, errors = {}, []
    for line in said.splitlines():
        if match := re.match(r" (time avg. forc|largest residual force|largest increment of disp|largest correction to disp)=\s*(\S+)", line):  # fmt: skip
            value[match[1].split()[1]] = float(match[2])
        elif line.strip() == "convergence" and len(value) == 4:
            errors.append(max(value["residual"] / value["avg."], value["correction"] / value["increment"]))  # fmt: skip
    return errors


def solve(directory: Path, given: dict, kind: str, stiff: float, env: dict, cap: int) -> tuple[np.ndarray, list, str]:  # fmt: skip
    """Run CalculiX for at most ``cap`` processor seconds.

    Returns:
        Displacements, its own errors, and what it said if it stopped early.
    """
    write(directory / "punch.inp", given, kind, stiff)
    done = subprocess.run(["ccx", "punch"], cwd=directory, env=env, capture_output=True, text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (cap, cap)))  # fmt: skip
    found = directory / "punch.dat"
    u = read(found, len(given["x"])) if found.exists() else np.zeros((0, len(given["x"]), 3))
    errors = [line for line in (done.stdout + done.stderr).splitlines() if "*ERROR" in line]
    said = " ".join(errors[-2:]) or f"ended with {done.returncode}"
    if done.returncode in (-signal.SIGKILL, -signal.SIGXCPU):
        said = f"stopped after {cap} s"
    return u, own_errors(done.stdout), "" if len(u) == len(given["programme"]) else said
