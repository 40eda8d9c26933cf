# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Peers side by side with us: GetFEM and CalculiX on the punch, case A; Siconos on the condensed A, B, C.

CalculiX and GetFEM know isotropic friction alone.  Their displacements, step after step, are put into our error
as if our solver had found them; nothing of their own history is lost in that.
"""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from time import process_time

import dolfinx_contact  # noqa: F401  before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import report_calculix
from punch import Parameters, Punch, programme
from report_run import HERE, Measurement, alone

TITLE = "Peers, side by side on the same mesh and programme"
PYTHON = "/usr/bin/python3"  # Debian's, for which GetFEM and Siconos are packaged
CALCULIX = {"node to surface": 50.0, "mortar": 50.0}  # penalty over Young's modulus, 1/mm


def plan(size: str) -> list[Measurement]:
    meshes = dict(full=[0, 1], quick=[0], smallest=[0])[size]
    more = dict(divisions=2, layers=2) if size == "smallest" else {}
    plans = []
    for refine in meshes:
        # Seven steps of the fine mesh, two of them after the reversal, are enough for seconds a step.
        settings = dict(refine=refine, steps=7 if refine or size == "smallest" else 15, mesh=more)
        for kind, stiff in CALCULIX.items():
            name = f"peers/calculix_{kind.replace(' ', '_')}_{refine}"
            plans.append(Measurement(name, "report_peers:calculix", dict(kind=kind, stiff=stiff, **settings), late=refine > 0))  # fmt: skip
        if refine == 0:
            plans.append(Measurement("peers/getfem_0", "report_peers:getfem", settings))
    if size == "smallest":
        return plans[1:2]
    return [*plans, Measurement("peers/siconos", "report_peers:siconos", {})]


def calculix(kind: str, stiff: float, refine: int, steps: int, mesh: dict) -> dict:
    if shutil.which("ccx") is None:
        return dict(absent="CalculiX is not installed (apt install calculix-ccx)")
    punch, given = case_a(refine, steps, mesh)
    with tempfile.TemporaryDirectory() as directory:
        before = children()
        u, iterations, said = report_calculix.solve(Path(directory), given, kind, stiff, alone())
        seconds = children() - before
    result = compared(punch, given, u, seconds, refine, mesh)
    setting = f"C3D8, penalty {stiff:g} E/mm, increments of its own" if kind != "mortar" else (
        f"C3D8, hard, stick slope {stiff:g} E/mm, increments of its own")  # fmt: skip
    return result | dict(
        peer=f"CalculiX, {kind}", setting=setting, said=said, iterations=iterations
    )


def getfem(refine: int, steps: int, mesh: dict) -> dict:
    if subprocess.run([PYTHON, "-c", "import getfem"], capture_output=True).returncode:
        return dict(absent="GetFEM is not installed (apt install python3-getfem)")
    punch, given = case_a(refine, steps, mesh)
    with tempfile.TemporaryDirectory() as directory:
        files = [Path(directory) / name for name in ("mesh.npz", "found.npz")]
        np.savez(files[0], **given)
        command = [PYTHON, HERE / "report_getfem.py", *files]
        done = subprocess.run(command, env=alone(), capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr[-500:])
        with np.load(files[1]) as found:
            u, said, iterations = found["u"], str(found["said"]), found["iterations"].tolist()
            seconds = float(found["seconds"].sum())
    result = compared(punch, given, u, seconds, refine, mesh)
    return result | dict(peer="GetFEM, basic contact brick", said=said, iterations=iterations,
        setting="nodal, augmented Lagrangian (Alart, Curnier), r = E h, MUMPS, residual 1e-9")  # fmt: skip


def children() -> float:
    """Processor seconds of the processes that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def case_a(refine: int, steps: int, mesh: dict):
    """Our punch, and all that a peer is told."""
    punch = Punch(Parameters(case="A", refine=refine), **mesh)
    x, cells = punch.V.tabulate_dof_coordinates(), punch.mesh.topology.index_map(3).size_local
    cells = np.array([punch.V.dofmap.cell_dofs(k) for k in range(cells)])
    own, height = punch.parameters, punch.parameters.height
    given = dict(
        x=x, cells=cells, contact=punch.contact.nodes, top=np.flatnonzero(x[:, 2] > height * (1 - 1e-9)),
        young=own.young, poisson=own.poisson, mu=0.2, programme=np.array(programme(own)[:steps]),
        cell=height / (4 * 2**refine),
    )  # fmt: skip
    return punch, given


class Given:
    """A solver that answers with what somebody else has found."""

    def __init__(self):
        self.answer = None

    def solve(self, equations, x, tol):
        return self.answer, 0


def compared(punch, given, u, seconds, refine, mesh) -> dict:
    """Their error by our measure, and our seconds for the same programme at that error and at 1e-8."""
    problem, judge = punch.problem, Given()
    problem.solver, problem.tol = judge, 1e300
    errors, forces = [], []
    for displacement, answer in zip(given["programme"], u):
        judge.answer = answer.ravel()
        step = punch.press(displacement)
        errors.append(step["error"])
        forces.append((step["normal_reaction"], step["tangential_reaction_sum"]))
    equal = float(np.clip(max(errors, default=1e-8), 1e-12, 0.1))
    ours, exact = {}, []
    for name, tol in (
        ("at equal error", equal),
        ("at 1e-8", 1e-8),
        ("at equal error, again", equal),
    ):
        start = process_time()
        mine = Punch(Parameters(case="A", refine=refine, tol=tol), **mesh)
        made = process_time() - start
        for displacement in given["programme"]:
            step = mine.press(displacement)
            if tol == 1e-8:
                exact.append((step["normal_reaction"], step["tangential_reaction_sum"]))
        ours[name] = dict(seconds=process_time() - start, mesh=made)
    difference = [np.abs(np.divide(a, b) - 1).tolist() for a, b in zip(forces, exact)]
    return dict(
        refine=refine, unknowns=problem.body.size, steps=len(given["programme"]), done=len(u), seconds=seconds,
        ours=ours, errors=errors, equal=equal, force_error=difference,
    )  # fmt: skip


SICONOS = (
    "import sys, json; sys.path.insert(0, {here!r}); import versus_siconos as v; rows = []; "
    "v.report = lambda *row: rows.append([r if isinstance(r, str) else list(map(float, r)) "
    "if isinstance(r, list) else float(r) for r in row]); {call}; print('ROWS', json.dumps(rows))"
)


def siconos() -> dict:
    """The condensed problems of A, B, C by CondensedNewton and by Siconos' NSN_AC (versus_siconos.py)."""
    if subprocess.run([PYTHON, "-c", "import siconos.numerics"], capture_output=True).returncode:
        return dict(absent="Siconos is not installed (apt install python3-siconos)")
    rows = []
    with tempfile.TemporaryDirectory() as directory:
        file = str(Path(directory) / "problems.npz")
        for python, call in (
            (sys.executable, f"v.ours({file!r})"), (PYTHON, f"v.siconos({file!r}, 'NSN_AC')"),
        ):  # fmt: skip
            script = SICONOS.format(here=str(HERE), call=call)
            done = subprocess.run(
                [python, "-c", script], env=alone(), capture_output=True, text=True
            )
            if done.returncode:
                raise RuntimeError(done.stderr[-500:])
            rows += json.loads(
                next(x for x in done.stdout.splitlines() if x.startswith("ROWS"))[5:]
            )
    return dict(rows=rows)


def evaluate(results: dict) -> dict:
    """One row a peer: seconds a step, ratio to ours at equal error, errors by our measure; who is absent."""
    rows = []
    absent = [result["absent"] for result in results.values() if "absent" in result]
    for name, result in results.items():
        if "absent" in result:
            continue
        if name.endswith("siconos"):
            rows += _siconos_rows(result["rows"])
            continue
        again = [result["ours"][key] for key in ("at equal error", "at equal error, again")]
        ours = float(np.mean([run["seconds"] - run["mesh"] for run in again]))
        complete = result["done"] == result["steps"]
        per = result["seconds"] / max(result["done"], 1)
        rows.append(dict(
            key=name.split("/")[1].replace("_", "-"), peer=result["peer"], case="A", setting=result["setting"],
            unknowns=result["unknowns"], seconds=per, ours=ours / result["steps"],
            ours_tight=(result["ours"]["at 1e-8"]["seconds"] - result["ours"]["at 1e-8"]["mesh"]) / result["steps"],
            ratio=per / (ours / result["steps"]) if complete else None,
            done=f"{result['done']} of {result['steps']}", said=result["said"],
            error=max(result["errors"], default=None), errors=result["errors"],
            force_error=max((max(pair) for pair in result["force_error"]), default=None),
        ))  # fmt: skip
    return dict(rows=rows, absent=absent)


def _siconos_rows(found: list) -> list[dict]:
    """``[case, name, seconds, converged, difference]`` of both, as rows."""
    ours = {case: seconds for case, name, seconds, *_ in found if not name.startswith("Siconos")}
    rows = []
    for case, name, seconds, converged, *difference in found:
        if name.startswith("Siconos"):
            per, mine = float(np.median(seconds)), float(np.median(ours[case]))
            rows.append(dict(
                key=f"siconos-{case}", peer=name, case=case, setting="scaled W, q; start: the step before; tol 1e-10",
                unknowns=None, seconds=per, ours=mine, ours_tight=mine, ratio=per / mine,
                done=f"{converged:.0f} of {len(seconds)}", said="", error=None, errors=[], force_error=difference[0],
            ))  # fmt: skip
    return rows
