# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Parts of solvers.py: what W, its inverse and Newton's method with them take; processor seconds."""

from __future__ import annotations

from contextlib import ExitStack, contextmanager
from time import process_time
from unittest.mock import patch

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
from petsc4py import PETSc
from punch import Parameters, Punch, programme

from dolfinx_contact import condensed
from dolfinx_contact.body import ElasticBody
from dolfinx_contact.condensed import CondensedBody


def timed(function, *arguments) -> tuple[float, object]:
    """Processor seconds of a call, and its result."""
    start = process_time()
    result = function(*arguments)
    return process_time() - start, result


@contextmanager
def clocked(**methods):
    """Processor seconds within methods of classes, by the names given, for as long as the block runs."""
    seconds = dict.fromkeys(methods, 0.0)

    def clock(name, method):
        def call(*arguments):
            spent, result = timed(method, *arguments)
            seconds[name] += spent
            return result

        return call

    with ExitStack() as stack:
        for name, (owner, method) in methods.items():
            stack.enter_context(patch.object(owner, method, clock(name, getattr(owner, method))))
        yield seconds


def operator(repeat: int = 7) -> list[dict]:
    """W with its inverse, without friction and with it, and a factorisation of K, interleaved."""
    problems = {case: Punch(Parameters(case=case)).problem for case in ("frictionless", "C")}
    rows = [dict(case=case, operator=[], factor=[]) for case in problems]
    for _ in range(repeat):
        for row, problem in zip(rows, problems.values()):
            body = problem.body
            body.refresh()
            body._elastic = None
            row["factor"].append(timed(body.solve, np.zeros(body.size))[0])
            row["operator"].append(timed(CondensedBody, body, problem.contacts)[0])
    return rows


def dense(ksp):
    """As ``condensed.block_solver``, with right-hand sides that hold their zeros."""
    size = ksp.getOperators()[0].getSize()[0]

    def solve(columns, values):
        right, answer = (PETSc.Mat().createDense((size, len(columns))) for _ in range(2))
        for matrix in (right, answer):
            matrix.setUp()
        entries = np.zeros((size, len(columns)), order="F")
        entries[columns.T, np.arange(len(columns))] = values.T
        right.getDenseArray()[:] = entries
        for matrix in (right, answer):
            matrix.assemble()
        ksp.getPC().getFactorMatrix().matSolve(right, answer)
        result = answer.getDenseArray().copy()
        for matrix in (right, answer):
            matrix.destroy()
        return result

    return solve


def one_by_one(ksp):
    """As ``condensed.block_solver``, a back-solve for each right-hand side."""
    right, left = ksp.getOperators()[0].createVecs()

    def solve(columns, values):
        result = np.empty((right.getSize(), len(columns)))
        for k, (column, value) in enumerate(zip(columns, values)):
            right.array_w[:] = 0.0
            right.array_w[column] = value
            ksp.solve(right, left)
            result[:, k] = left.array_r
        return result

    return solve


def assembly(repeat: int = 5) -> list[dict]:
    """W of the paper's mesh in three ways, interleaved, and how far they are from the first."""
    problem = Punch(Parameters(case="C")).problem
    problem.body.refresh()
    problem.body.solve(np.zeros(problem.body.size))
    body = CondensedBody(problem.body, problem.contacts)
    ways = {"blocks": condensed.block_solver, "dense": dense, "one by one": one_by_one}
    rows, kept = [dict(way=way, seconds=[]) for way in ways], body.compliance()
    for _ in range(repeat):
        for row, way in zip(rows, ways.values()):
            with patch.object(condensed, "block_solver", way):
                spent, W = timed(body.compliance)
            row["seconds"].append(spent)
            row["apart"] = float(np.abs(W - kept).max() / np.abs(kept).max())
    return rows


def first_steps(sizes: list) -> list[dict]:
    """The first step of case C on two layers, where nearly all nodes slip: W, its inverse and Newton's method apart."""
    rows = []
    for divisions in sizes:
        punch = Punch(Parameters(case="C"), divisions=divisions, layers=2)
        punch.problem.solver = dc.CondensedNewton()
        with clocked(
            operator=(CondensedBody, "__init__"), W=(CondensedBody, "compliance"), newton=(CondensedBody, "solve")
        ) as seconds:  # fmt: skip
            punch.approach.value = -programme(punch.parameters)[0]
            step = punch.problem.solve()
        rows.append(dict(
            nodes=len(punch.contact.nodes), unknowns=punch.problem.body.size, seconds=seconds, iterations=step.iterations, error=step.error,
            branches=[attempt.branch for attempt in step.tried], slipping=int(step.counts.slip),
        ))  # fmt: skip
    return rows


def shares() -> list[dict]:
    """What the steps of six cycles spend where, all but the first."""
    rows = []
    for case in "ABC":
        punch = Punch(Parameters(case=case, cycles=6))
        punch.problem.solver = dc.CondensedNewton()
        first, *later = programme(punch.parameters)
        punch.press(first)
        with clocked(
            newton=(CondensedBody, "solve"), back_solves=(ElasticBody, "solve"), F=(ElasticBody, "internal_force")
        ) as seconds:  # fmt: skip
            done = [timed(punch.press, displacement) for displacement in later]
        times, records = zip(*done)
        iterations = [record["iterations"] for record in records]
        rows.append(dict(case=case, times=times, iterations=iterations, seconds=seconds))
    return rows
