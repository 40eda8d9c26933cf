# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""How good the estimate of the discretisation's error is on the punch: first against second order, of cells as in the paper.

``python -m studies.punch.effectivity FILE`` appends a line of JSON for each case and mesh: true and estimated relative errors and
their ratio, when loaded, after unloading, and the largest of all steps over the largest value.  True values are those of graded cells
of second order with the same increments; ``unsure`` is what they change from the next coarser mesh.  Sums are those of the mesh with
straight edges, as in the paper; fields those of first order with curved ones, which share a mesh with second order.  The second
reference has graded cells.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from studies.punch.accuracy import mesh_options
from studies.punch.model import Parameters, Punch, programme

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

MESHES = ((4, 2), (8, 4))  # divisions and layers; the second is the paper's
FINE = (8, 10)  # divisions of the meshes of the true values
GRADED = 6  # of a better reference
START = Parameters(tol=1e-8)
ENDS = {"loaded": START.loading - 1, "unloaded": START.loading + START.unloading - 1}
SUMS, FIELDS = ("normal_force", "tangential_force", "dissipation"), ("pressure", "shear")


def build(divisions: int, layers: int, order: int, degree: int, **options) -> Punch:
    """A quarter of the punch with uniform cells of an order, displacements of a degree."""
    return Punch(
        START, solver=dc.CondensedNewton(), petsc_options=DIRECT_OPTIONS, quarter=True, divisions=divisions, layers=layers,
        order=order, degree=degree, **options
    )  # fmt: skip


def fine(divisions: int) -> Punch:
    """The mesh of ``--accuracy``."""
    parameters = replace(START, lowest=START.height / (2 * divisions) ** 2)
    options = mesh_options(divisions)
    return Punch(
        parameters,
        solver=dc.CondensedNewton(),
        petsc_options=DIRECT_OPTIONS,
        quarter=True,
        **options,
    )


def sums(punch: Punch) -> list[float]:
    """Normal reactions, sizes of tangential ones, work of friction, of a quarter; on all ranks."""
    r = punch.contact.reaction
    mine = r[:, 2].sum(), np.linalg.norm(r[:, :2], axis=1).sum(), punch.contact.dissipation.sum()
    return [punch.comm.allreduce(float(of)) for of in mine]


def tractions(punch: Punch) -> tuple[np.ndarray, np.ndarray]:
    """Positions and nodal tractions of all contact nodes, on all ranks."""
    of = punch.contact
    pairs = punch.comm.allgather((of.x[:, :2], of.reaction / of.area[:, None]))
    return tuple(np.concatenate(arrays) for arrays in zip(*pairs))


def true_run(punch: Punch, case: str) -> tuple[list, dict]:
    """Sums of every step, and the tractions at ``ENDS``."""
    punch.restart(case=case)
    steps, fields = [], {}
    for number, displacement in enumerate(programme(START)):
        punch.press(displacement)
        steps.append(sums(punch))
        fields |= {name: tractions(punch) for name, at in ENDS.items() if at == number}
    return steps, fields


def off_disc(punch: Punch, true) -> np.ndarray:
    """Root mean squares of the errors of pressure and shear over the disc, and of the true ones, ``shape=(2, 2)``.

    Nodal values of the fine mesh are interpolated linearly, at the nodes of a space of degree 6 on this one.
    """
    x, values = true
    inside, beside = LinearNDInterpolator(x, values), NearestNDInterpolator(x, values)
    space = functionspace(punch.mesh, ("Lagrange", 6))
    ds = ufl.Measure(
        "ds", domain=punch.mesh, subdomain_data=punch.facet_tags, metadata={"quadrature_degree": 14}
    )(1)
    area = punch.comm.allreduce(fem.assemble_scalar(fem.form(fem.Constant(punch.mesh, 1.0) * ds)))
    squares = []
    for k in range(3):
        exact = fem.Function(space)

        def at(points, k=k):
            found = inside(points[:2].T)[:, k]
            return np.where(np.isnan(found), beside(points[:2].T)[:, k], found)

        exact.interpolate(at)
        nodal = punch.contact.function(punch.contact.reaction[:, k] / punch.contact.area)
        forms = [fem.form(of**2 * ds) for of in (nodal - exact, exact)]
        squares.append([punch.comm.allreduce(fem.assemble_scalar(of)) for of in forms])
    squares = np.array(squares) / area
    return np.sqrt([squares[2], squares[0] + squares[1]])


def row(true: float, estimate: float, **more) -> dict:
    return dict(
        true=float(true), estimate=float(estimate), effectivity=float(estimate / true), **more
    )


def measure(case: str, punches: dict, true: dict) -> dict:
    """One case on one mesh.  Collective.

    Args:
        case: Of the paper.
        punches: First order on straight (``paper``) and on ``curved`` cells, second order on these (``better``) and on ``graded`` ones.
        true: What ``true_run`` returns, by divisions of ``FINE``.
    """
    series, rows = {punch.problem: [] for punch in punches.values()}, {}
    paper, curved, better, graded = series
    for punch in punches.values():
        punch.restart(case=case)
    for number, displacement in enumerate(programme(START)):
        for punch in punches.values():
            punch.press(displacement)
            series[punch.problem].append(sums(punch))
        for name in (name for name, at in ENDS.items() if at == number):
            off = off_disc(punches["curved"], true[FINE[-1]][1][name])
            for reference, which in ((better, "same cells"), (graded, "graded cells")):
                found = dc.estimate(curved, reference)
                fields = {
                    key: row(e / of, found[key].error / of) for key, (e, of) in zip(FIELDS, off)
                }
                rows[f"{name}, {which}"] = fields
    for name, at in [*ENDS.items(), ("all steps", slice(None))]:
        values, *exact = (
            np.array(of)[at].reshape(-1, 3) for of in (series[paper], *(true[n][0] for n in FINE))
        )
        for reference, which in ((better, "same cells"), (graded, "graded cells")):
            along = {
                key: lambda p, k=k, at=at: np.array(series[p])[at].reshape(-1, 3)[:, k]
                for k, key in enumerate(SUMS)
            }
            found = dc.estimate(paper, reference, along)
            numbers = {
                key: one(found[key], values[:, k], *(of[:, k] for of in exact))
                for k, key in enumerate(SUMS)
            }
            rows.setdefault(f"{name}, {which}", {}).update(numbers)
    return rows


def one(found, values, coarser, true) -> dict:
    """A row of numbers, which the largest stands for."""
    top = np.abs(true).max()
    off, unsure = (np.abs(true - of).max() / top for of in (values, coarser))
    return row(off, found.error / top, unsure=float(unsure))


def main(path: Path) -> None:
    true = {}
    for n in FINE:
        punch = fine(n)
        true |= {(case, n): true_run(punch, case) for case in "ABC"}
        punch.problem.close()
    for cells in MESHES:
        better = build(*cells, 2, 2)
        punches = dict(paper=build(*cells, 1, 1), curved=build(*cells, 2, 1, on=better))
        punches |= dict(better=better, graded=fine(GRADED))
        for case in "ABC":
            states = measure(case, punches, {n: true[case, n] for n in FINE})
            record = json.dumps(dict(scene=f"punch, {case}", cells=cells, states=states))
            if better.comm.rank == 0:
                with path.open("a") as file:
                    file.write(record + "\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
