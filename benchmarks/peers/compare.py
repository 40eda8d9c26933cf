# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Peers side by side with us: GetFEM and CalculiX on the punch, case A; Siconos on the condensed A, B, C.

CalculiX and GetFEM know isotropic friction alone.  Their displacements, step after step, are put into our error
as if our solver had found them; nothing of their own history is lost in that.
"""

from __future__ import annotations

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

from benchmarks.measurement import ROOT, Measurement, alone
from benchmarks.peers import by_calculix, by_getfem, by_siconos
from benchmarks.report.drawing import OURS, THEIRS, bars
from dolfinx_contact.solvers.base import SolverResult
from mechanics import judge
from studies.punch import Parameters, Punch, programme

TITLE = "Peers, side by side on the same mesh and programme"
PYTHON = "/usr/bin/python3"  # Debian's, for which GetFEM and Siconos are packaged
CALCULIX = {"node to surface": 50.0, "mortar": 50.0}  # penalty over Young's modulus, 1/mm
CAP = 600  # processor seconds of a peer for one programme


def plan(size: str) -> list[Measurement]:
    meshes = dict(full=[0, 1], quick=[0], smallest=[0])[size]
    more = dict(divisions=2, layers=2) if size == "smallest" else {}
    plans = []
    for refine in meshes:
        # The fine mesh: pressed in one step and raised in two, every one of them with slip of its own; mortar takes
        # minutes for the first one alone.
        increments = [5, 10] if size == "full" and not refine else [1, 2]
        settings = dict(refine=refine, increments=increments, mesh=more)
        for kind, stiff in CALCULIX.items():
            name = f"peers/calculix_{kind.replace(' ', '_')}_{refine}"
            steps = 1 if refine and kind == "mortar" else sum(increments)
            plans.append(Measurement(name, "benchmarks.peers.compare:calculix", dict(kind=kind, stiff=stiff, steps=steps, **settings), late=refine > 0))  # fmt: skip
        if refine == 0:  # on the fine mesh three steps had not ended after six minutes
            plans.append(Measurement("peers/getfem_0", "benchmarks.peers.compare:getfem", settings))
    if size == "smallest":
        return plans[1:2]
    return [*plans, Measurement("peers/siconos", "benchmarks.peers.compare:siconos", {})]


def calculix(kind: str, stiff: float, steps: int, refine: int, increments: list, mesh: dict) -> dict:  # fmt: skip
    if shutil.which("ccx") is None:
        return dict(absent="CalculiX is not installed (apt install calculix-ccx)")
    punch = case_a(refine, increments, mesh)
    given = told(punch)
    given["programme"] = given["programme"][:steps]
    with tempfile.TemporaryDirectory() as directory:
        before = children()
        u, own, said = by_calculix.solve(Path(directory), given, kind, stiff, alone(), CAP)
        seconds = children() - before
    result = compared(punch, given, u, seconds, refine, increments, mesh)
    setting = f"C3D8, penalty {stiff:g} E/mm, increments of its own" if kind != "mortar" else (
        f"C3D8, hard, stick slope {stiff:g} E/mm, increments of its own")  # fmt: skip
    return result | dict(peer=f"CalculiX, {kind}", setting=setting, said=said, own=own)


def getfem(refine: int, increments: list, mesh: dict) -> dict:
    if subprocess.run([PYTHON, "-c", "import getfem"], capture_output=True).returncode:
        return dict(absent="GetFEM is not installed (apt install python3-getfem)")
    punch = case_a(refine, increments, mesh)
    given = told(punch)
    with tempfile.TemporaryDirectory() as directory:
        files = [Path(directory) / name for name in ("mesh.npz", "found.npz")]
        np.savez(files[0], cap=CAP, **given)
        command = [PYTHON, by_getfem.__file__, *files]
        done = subprocess.run(command, env=alone(), capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(done.stderr[-500:])
        with np.load(files[1]) as found:
            u, said, own = found["u"], str(found["said"]), found["own"].tolist()
            seconds = float(found["seconds"].sum())
    result = compared(punch, given, u, seconds, refine, increments, mesh)
    return result | dict(peer="GetFEM, basic contact brick", said=said, own=own,
        setting="nodal, augmented Lagrangian (Alart, Curnier), r = E h, MUMPS, residual 1e-9")  # fmt: skip


def children() -> float:
    """Processor seconds of the processes that ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def case_a(refine: int, increments: list, mesh: dict, tol=1e-10) -> Punch:
    """Our punch."""
    loading, unloading = increments
    return Punch(Parameters(case="A", refine=refine, loading=loading, unloading=unloading, tol=tol), **mesh)  # fmt: skip


def told(punch: Punch) -> dict:
    """All that a peer is told."""
    x, cells = punch.V.tabulate_dof_coordinates(), punch.mesh.topology.index_map(3).size_local
    cells = np.array([punch.V.dofmap.cell_dofs(k) for k in range(cells)])
    own, height = punch.parameters, punch.parameters.height
    return dict(
        x=x, cells=cells, contact=punch.contact.nodes, top=np.flatnonzero(x[:, 2] > height * (1 - 1e-9)),
        young=own.young, poisson=own.poisson, mu=0.2, programme=np.array(programme(own)),
        cell=height / (4 * 2**own.refine),
    )  # fmt: skip


class Given:
    """A solver that answers with what somebody else has found."""

    answer = None

    def bind(self, body, contacts, stiffness, memory):
        return self

    def solve(self, step):
        return SolverResult(self.answer, 0, 0.0, "given")

    def destroy(self):
        pass


def compared(punch, given, u, seconds, refine, increments, mesh) -> dict:
    """Their error by our measure, and our seconds for the same programme at that error and at 1e-8."""
    problem, judge = punch.problem, Given()
    problem.solver, problem.tol = judge, 1e300
    errors, forces = [], []
    for displacement, answer in zip(given["programme"], u):
        judge.answer = answer.ravel()
        errors.append(punch.press(displacement)["error"])
        # The reactions of their displacements; those of the record would add our metric times their penetration.
        r = problem.body.internal_force(judge.answer)[punch.contact.points.dofs]
        forces.append((r[:, 2].sum(), np.linalg.norm(r[:, :2], axis=1).sum()))
    equal = float(np.clip(max(errors, default=1e-8), 1e-12, 0.1))
    ours, exact = {}, []
    for name, tol in (
        ("at equal error", equal),
        ("at 1e-8", 1e-8),
        ("at equal error, again", equal),
    ):
        start = process_time()
        mine = case_a(refine, increments, mesh, tol)
        made = process_time() - start
        for displacement in given["programme"]:
            step = mine.press(displacement)
            if tol == 1e-8:
                exact.append((step["normal_reaction"], step["tangential_reaction_sum"]))
        ours[name] = dict(seconds=process_time() - start, mesh=made)
    difference = [np.abs(np.divide(a, b) - 1).tolist() for a, b in zip(forces, exact)]
    return dict(
        refine=refine, unknowns=problem.body.size, steps=len(given["programme"]), done=len(u), seconds=seconds,
        increments=increments, ours=ours, errors=errors, equal=equal, force_error=difference,
    )  # fmt: skip


def siconos() -> dict:
    """The condensed problems of A, B, C by Siconos' NSN_AC, before and after it by CondensedNewton.

    All answers are judged by mechanics/judge.py from ``W``, ``q`` and the reactions alone.
    """
    if subprocess.run([PYTHON, "-c", "import siconos.numerics"], capture_output=True).returncode:
        return dict(absent="Siconos is not installed (apt install python3-siconos)")
    rows, name = [], "NSN_AC"
    with tempfile.TemporaryDirectory() as directory:
        file = str(Path(directory) / "problems.npz")
        for python, what in ((sys.executable, "make"), (sys.executable, "ours"), (PYTHON, name), (sys.executable, "ours again")):  # fmt: skip
            done = subprocess.run([python, "-m", by_siconos.__name__, file, what], cwd=ROOT, env=alone(), capture_output=True, text=True)  # fmt: skip
            if done.returncode:
                raise RuntimeError(done.stderr[-500:])
        problems = np.load(file)
        for case, (mu, p) in by_siconos.LAWS.items():
            row = dict(case=case, peer=f"Siconos {name}")
            for solver in ("ours", name, "ours again"):
                found = np.load(f"{file.removesuffix('npz')}{solver}.npz")
                judged = [
                    judge.condensed(problems["W"], q, np.array(mu), np.array(p), r, 1e-8).error
                    for q, r in zip(problems[f"{case}q"], found[f"{case}reaction"])
                ]
                row[solver] = dict(seconds=found[f"{case}seconds"].tolist(), errors=judged,
                    own=found[f"{case}own"].tolist(), converged=int(found[f"{case}converged"].sum()))  # fmt: skip
                exact = problems[f"{case}r"]
                row[solver]["difference"] = float(np.abs(found[f"{case}reaction"] - exact).max() / np.abs(exact).max())  # fmt: skip
            rows.append(row | dict(theirs=row.pop(name)))
    return dict(rows=rows)


def evaluate(results: dict) -> dict:
    """One row a peer: seconds a step, ratio to ours at equal error, errors by our measure; who is absent."""
    rows, absent = [], [result["absent"] for result in results.values() if "absent" in result]
    for name, result in results.items():
        if "absent" in result:
            continue
        rows += (
            map(_condensed_row, result["rows"]) if name.endswith("siconos") else [_body_row(result)]
        )
    rows.sort(key=lambda row: (row["unknowns"] is None, row["unknowns"], row["peer"], row["case"]))
    return dict(rows=rows, absent=absent)


def _body_row(result: dict) -> dict:
    def ours(*names):
        return float(np.mean([run["seconds"] - run["mesh"] for run in map(result["ours"].get, names)])) / result["steps"]  # fmt: skip

    per, mine = result["seconds"] / max(result["done"], 1), ours("at equal error", "at equal error, again")  # fmt: skip
    return dict(
        peer=result["peer"], case="A", setting=result["setting"], unknowns=result["unknowns"], seconds=per, ours=mine,
        ours_tight=ours("at 1e-8"), ratio=per / mine if result["done"] == result["steps"] else None,
        done=f"{result['done']} of {result['steps']}", said=result["said"], own=max(result["own"], default=None),
        error=max(result["errors"], default=None), force_error=max(map(max, result["force_error"]), default=None),
    )  # fmt: skip


def _condensed_row(row: dict) -> dict:
    theirs = row["theirs"]
    per, mine = (float(np.median(of)) for of in (theirs["seconds"], row["ours"]["seconds"] + row["ours again"]["seconds"]))  # fmt: skip
    return dict(
        peer=row["peer"], case=row["case"], setting="scaled W, q; start: the step before; tol 1e-10", unknowns=None,
        seconds=per, ours=mine, ours_tight=mine, ratio=per / mine, done=f"{theirs['converged']} of {len(theirs['seconds'])}",
        said="", own=max(theirs["own"]), error=max(theirs["errors"]), force_error=theirs["difference"],
    )  # fmt: skip


def figures(data):
    rows = data["rows"]
    if not rows:
        return
    names = [f"{row['peer']}, {row['case']}, {row['unknowns'] or 'condensed'}, {row['done']}" for row in rows]  # fmt: skip
    figure, (left, right) = bars(names, 2)
    places = np.arange(len(rows))
    for ax, shift, key, colour, label in (
        (left, -0.2, "seconds", THEIRS, "the peer, its error by our measure"), (left, 0.2, "ours", OURS, "we, at equal error"),
        (right, -0.2, "error", THEIRS, "_"), (right, 0.2, "own", "#999999", "as the peer reports its error"),
    ):  # fmt: skip
        values = [max(row[key] or np.nan, 1e-16) for row in rows]
        ax.barh(places + shift, values, height=0.38, color=colour, label=label)
    left.set(xlabel="processor seconds a step")
    right.set(xlabel="largest error of the peer", xlim=(1e-16, 10))
    figure.legend(loc="outside upper center", frameon=False, ncols=3)
    yield (
        "peers",
        figure,
        (
            "Peers beside us: unknowns and steps done. Set-ups are included, but for Siconos, which is given W. GetFEM and CalculiX "
            "know isotropic friction alone, so only case A can be compared with them."
        ),
    )


def tables(data):
    yield [{"not compared": text} for text in data["absent"]]
    yield [
        {
            "peer": row["peer"], "case": row["case"], "unknowns": row["unknowns"], "configuration": row["setting"],
            "s a step": row["seconds"], "ours at equal error": row["ours"], "ours at 1e-8": row["ours_tight"],
            "ratio": row["ratio"], "steps done": row["done"], "error by our measure": row["error"], "its own": row["own"],
            "reactions differ by": row["force_error"], "said": row["said"],
        }
        for row in data["rows"]
    ]  # fmt: skip
