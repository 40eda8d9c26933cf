# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Peers side by side with us: GetFEM and CalculiX on the punch, case A; Siconos on the condensed A, B, C.

CalculiX and GetFEM know isotropic friction alone.  Their displacements, step after step, are put into our error
as if our solver had found them; nothing of their own history is lost in that.
"""

from __future__ import annotations

import shutil
import tempfile

import basix
import numpy as np

import dolfinx_contact as dc
from benchmarks.measurement import Measurement, mesh_of, run_alone, timed
from benchmarks.peers import by_calculix, by_getfem, by_siconos
from benchmarks.report.drawing import OURS, THEIRS, bars, column
from benchmarks.tables import chosen
from dolfinx_contact.compat import lagrange_degree
from dolfinx_contact.extend import Solver
from dolfinx_contact.solvers.base import SolverResult
from dolfinx_contact.solvers.condensed.kernel import condensed_operator
from mechanics import judge
from studies.punch import CASES, Parameters, Punch, programme

TITLE = "Peers, side by side on the same mesh and programme"
CAPTION = (
    "Peers beside us: unknowns and steps done. Set-ups are included, but for Siconos, which is given W. GetFEM and "
    "CalculiX know isotropic friction alone, so only case A can be compared with them."
)
PYTHON = "/usr/bin/python3"  # Debian's, for which GetFEM and Siconos are packaged
GETFEM = "GetFEM, basic contact brick"
SETTINGS = {
    "CalculiX, node to surface": "C3D8, penalty 50 E/mm, increments of its own",
    "CalculiX, mortar": "C3D8, hard, stick slope 50 E/mm, increments of its own",
    GETFEM: "nodal, augmented Lagrangian (Alart, Curnier), r = E h, MUMPS, simplest line search, residual 1e-9",
}
# Peer, level of the mesh, increments, and how many of their steps.  The fine mesh: every one of three steps slips anew;
# mortar takes minutes for the first one, GetFEM had not ended all after six.
RUNS = dict(
    full=[*((peer, 0, [5, 10], 15) for peer in SETTINGS),
        ("CalculiX, node to surface", 1, [1, 2], 3), ("CalculiX, mortar", 1, [1, 2], 1)],
    quick=[(peer, 0, [1, 2], 3) for peer in SETTINGS],
    smallest=[("CalculiX, mortar", 0, [1, 2], 3)],
)  # fmt: skip
CAP = 600  # processor seconds of a peer for one programme


def plan(size: str) -> list[Measurement]:
    home = "benchmarks.peers.compare"
    plans = [
        Measurement(
            f"peers/{peer} {refine}", f"{home}:body", late=refine > 0,
            settings=dict(peer=peer, refine=refine, increments=increments, mesh=mesh_of(size), steps=steps),
        )
        for peer, refine, increments, steps in RUNS[size]
    ]  # fmt: skip
    return plans + [Measurement("peers/siconos", f"{home}:siconos", {})] * (size != "smallest")


def body(peer: str, refine: int, increments: list, mesh: dict, steps: int) -> dict:
    """The first steps of case A by a peer, judged, and by us."""
    if gone := absent(peer):
        return gone
    punch = case_a(refine, increments, mesh)
    given = told(punch)
    given["programme"] = given["programme"][:steps]
    if peer == GETFEM:
        found = by_system(by_getfem.__file__, dict(given, cap=CAP))
    else:
        found = by_calculix.solve(given, peer.split(", ")[1], CAP)
    seconds, own = float(np.sum(found["seconds"])), np.array(found["own"]).tolist()
    result = compared(punch, given, found["u"], seconds, refine, increments, mesh)
    return result | dict(peer=peer, setting=SETTINGS[peer], said=str(found["said"]), own=own)


def absent(peer: str) -> dict:
    """The record of GetFEM or CalculiX where that is not installed, else nothing."""
    gone = missing("getfem") if peer.startswith("GetFEM") else shutil.which("ccx") is None
    return dict(absent=f"{peer} is not installed (apt install python3-getfem calculix-ccx)") if gone else {}  # fmt: skip


def missing(module: str) -> bool:
    return run_alone([PYTHON, "-c", f"import {module}"]).returncode != 0


def by_system(program: str, given: dict) -> dict:
    """Arrays that a program for the system's Python makes of other arrays."""
    with tempfile.TemporaryDirectory() as directory:
        files = [f"{directory}/{name}.npz" for name in ("given", "found")]
        np.savez(files[0], **given)
        done = run_alone([PYTHON, program, *files])
        if done.returncode:
            raise RuntimeError(done.stderr[-500:])
        with np.load(files[1]) as found:
            return dict(found)


def case_a(refine: int, increments: list, mesh: dict, tol=1e-10) -> Punch:
    """Our punch."""
    given = dict(refine=refine, loading=increments[0], unloading=increments[1], tol=tol)
    return Punch(Parameters(case="A", **given), **mesh)


def told(punch: Punch) -> dict:
    """All that a peer is told; nodes of a cell by z, then y, then x of the reference cell; held: node and component."""
    x, cells = punch.V.tabulate_dof_coordinates(), punch.mesh.topology.index_map(3).size_local
    cells = np.array([punch.V.dofmap.cell_dofs(k) for k in range(cells)])
    points = basix.create_element(basix.ElementFamily.P, basix.CellType.hexahedron, lagrange_degree(punch.V),
        basix.LagrangeVariant.gll_warped).points  # fmt: skip
    own, height = punch.parameters, punch.parameters.height
    top = np.flatnonzero(x[:, 2] > height * (1 - 1e-9))
    held = [(node, k) for node in top for k in range(3)]
    if punch.parts > 1:  # planes of symmetry
        held += [
            (node, k)
            for k in range(2)
            for node in np.flatnonzero(np.abs(x[:, k]) < 1e-9 * own.radius)
        ]
    return dict(
        x=x, cells=cells[:, np.lexsort(points.T.round(9))], contact=punch.contact.nodes, held=np.unique(held, axis=0),
        young=own.young, poisson=own.poisson, mu=0.2, programme=np.array(programme(own)),
        cell=height / (4 * 2**own.refine),
    )  # fmt: skip


class Given(Solver):
    """A solver that answers with what somebody else has found."""

    answer = None

    def bind(self, step):
        return self

    def update(self, step):
        pass

    def solve(self, step, starts):
        return SolverResult(step.measure(self.answer), 0, 0.0, "given")

    def close(self):
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

    def ours(tol):
        mine = case_a(refine, increments, mesh, tol)
        seconds, steps = timed(lambda: [mine.press(top) for top in given["programme"]])
        return seconds / len(steps), steps

    first, (tight, steps), again = ours(equal), ours(1e-8), ours(equal)
    exact = [(step["normal_reaction"], step["tangential_reaction_sum"]) for step in steps]
    difference = [np.abs(np.divide(a, b) - 1).tolist() for a, b in zip(forces, exact)]
    return dict(
        unknowns=problem.body.size, steps=len(steps), done=len(u), seconds=seconds, ours=(first[0] + again[0]) / 2,
        ours_tight=tight, errors=errors, force_error=difference,
    )  # fmt: skip


def siconos() -> dict:
    """The condensed problems of A, B, C by Siconos' NSN_AC, before and after it by CondensedNewton.

    All answers are judged by mechanics/judge.py from ``W``, ``q`` and the reactions alone.
    """
    if missing("siconos.numerics"):
        return dict(absent="Siconos is not installed (apt install python3-siconos)")
    rows, problems = [], condensed_problems()
    before, found = by_newton(problems), by_system(by_siconos.__file__, problems)
    after = by_newton(problems)
    for case in CASES:
        theirs, exact = found[f"{case}reaction"], problems[f"{case}r"]
        done = found[f"{case}converged"]
        seconds = float(np.median(found[f"{case}seconds"]))
        mine = float(np.median(before[case] + after[case]))
        judged = [
            judge.condensed(problems["W"], q, *problems[f"{case}law"], r, 1e-8).error
            for q, r in zip(problems[f"{case}q"], theirs)
        ]
        rows.append(dict(
            peer="Siconos NSN_AC", case=case, setting="scaled W, q; start: the step before; tol 1e-10", unknowns=None,
            seconds=seconds, ours=mine, ours_tight=mine, ratio=seconds / mine, done=f"{done.sum()} of {len(done)}",
            said="", own=float(found[f"{case}own"].max()), error=max(judged),
            force_error=float(np.abs(theirs - exact).max() / np.abs(exact).max()),
        ))  # fmt: skip
    return dict(rows=rows)


def condensed_problems() -> dict:
    """One cycle of each case: ``W``, and of every step ``q`` and the solution ``r``, ``shape=(steps, nodes, 3)``."""
    problems = dict(tol=1e-10)
    for case, law in CASES.items():
        punch = Punch(Parameters(case=case), solver=dc.CondensedNewton())
        for displacement in programme(punch.parameters):
            punch.press(displacement)
        bound = punch.problem.bound()
        q, r, _ = zip(*punch.problem.snapshot().past)
        q, r = (np.reshape(part, (len(part), -1, 3)) for part in (q, r))
        problems |= {f"{case}q": q, f"{case}r": r, f"{case}law": np.array([law["mu"], law["p"]])}
        problems.setdefault("W", bound.compliance())
    return problems


def by_newton(problems: dict) -> dict:
    """Seconds of all problems by CondensedNewton, each from the solution of the step before."""
    operator = condensed_operator(problems["W"], 3)
    operator.prepare()
    solver, seconds = dc.CondensedNewton(), {}
    for case in CASES:
        q, r = problems[f"{case}q"], problems[f"{case}r"]
        law = dc.Friction(*problems[f"{case}law"])
        seconds[case] = [
            timed(solver.solve_condensed, operator, law, q[k], problems["tol"], r[k - 1 : k])[0]
            for k in range(len(q))
        ]
    return seconds


def evaluate(results: dict) -> dict:
    """One row a peer: seconds a step, ratio to ours at equal error, errors by our measure; who is absent."""
    absent = [result["absent"] for result in results.values() if "absent" in result]
    rows = [row for result in results.values() for row in result.get("rows", [])]
    rows += [_body_row(result) for result in results.values() if "errors" in result]
    rows.sort(key=lambda row: (row["unknowns"] is None, row["unknowns"], row["peer"], row["case"]))
    return dict(rows=rows, absent=absent)


def _body_row(result: dict) -> dict:
    seconds, whole = result["seconds"] / max(result["done"], 1), result["done"] == result["steps"]
    kept = ("peer", "setting", "unknowns", "ours", "ours_tight", "said")
    return {key: result[key] for key in kept} | dict(
        case="A", seconds=seconds, ratio=seconds / result["ours"] if whole else None,
        done=f"{result['done']} of {result['steps']}", own=max(result["own"], default=None),
        error=max(result["errors"], default=None), force_error=max(map(max, result["force_error"]), default=None),
    )  # fmt: skip


def figure(data):
    rows = data["rows"]
    names = [
        f"{row['peer']}, {row['case']}, {row['unknowns'] or 'condensed'}, {row['done']}"
        for row in rows
    ]
    figure, (left, right) = bars(names, 2)
    for ax, shift, key, colour, label in (
        (left, -0.2, "seconds", THEIRS, "the peer, its error by our measure"),
        (left, 0.2, "ours", OURS, "we, at equal error"),
        (right, -0.2, "error", THEIRS, "_"),
        (right, 0.2, "own", "#999999", "as the peer reports its error"),
    ):
        values = np.maximum(column(rows, key), 1e-16)
        ax.barh(np.arange(len(rows)) + shift, values, height=0.38, color=colour, label=label)
    left.set(xlabel="processor seconds a step")
    right.set(xlabel="largest error of the peer", xlim=(1e-16, 10))
    figure.legend(loc="outside upper center", frameon=False, ncols=3)
    return figure


def tables(data):
    titles = dict(
        peer="peer", case="case", unknowns="unknowns", setting="configuration", seconds="s a step",
        ours="ours at equal error", ours_tight="ours at 1e-8", ratio="ratio", done="steps done",
        error="error by our measure", own="its own", force_error="reactions differ by", said="said",
    )  # fmt: skip
    yield [{"not compared": text} for text in data["absent"]]
    yield chosen(data["rows"], titles)
