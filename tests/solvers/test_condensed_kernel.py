# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The condensed solver's algebra for processors with AVX2 or AVX-512, and factors that serve several iterations."""

import datetime
import importlib
import warnings
from fractions import Fraction
from importlib.util import find_spec
from itertools import product

import numpy as np
import pytest

from dolfinx_contact import Friction, RoundingWarning, _kernel
from dolfinx_contact.solvers.condensed import kernel as condensed_kernel
from dolfinx_contact.solvers.condensed.newton import CondensedNewton, solve_condensed
from mechanics import judge

TOL = 1e-10


def algebras():
    """What is compiled, and runs here."""
    wide = [f"dolfinx_contact._algebra_{name}" for name in _kernel.instruction_sets()]
    return [
        None,
        *(importlib.import_module(name).linear_algebra for name in wide if find_spec(name)),
    ]


def body(rng, nodes):
    """W of nodes on a plane patch of an elastic half-space, nearly: 1 / distance, and q of a slide."""
    x = rng.uniform(size=(nodes, 2)) * np.sqrt(nodes)
    distance = np.linalg.norm(x[:, None] - x[None], axis=2)
    couple = 1 / np.sqrt(1 + distance**2)
    W = np.kron(couple, np.diag([1.0, 1.2, 0.9]))
    q = np.column_stack((0.3 * rng.normal(size=(nodes, 2)) + (0.5, 0.2), -np.ones(nodes)))
    return (W + W.T) / 2, q


@pytest.mark.parametrize("entry", [(129, 3), (3, 129), (70, 64), (64, 63), (1, 0), (129, 128)])
def test_one_entry_makes_it_unsymmetric(entry):
    """W of several tiles is its transpose but for one entry: w = q + W r with each of both."""
    rng = np.random.default_rng(3)
    A = rng.normal(size=(130, 200))
    W, q = A @ A.T / 200, rng.normal(size=(65, 2))
    for change in (0.0, 1e-3):
        W[entry] += change
        for stored in (W, np.asfortranarray(W)):
            found = solve_condensed(stored, q, 0.2)
            w = q + (W @ found.reaction.ravel()).reshape(q.shape)
            assert found.displacement == pytest.approx(w, abs=1e-12)


def test_every_compiled_algebra_gives_the_same_answer():
    """Reactions of small and large, symmetric and unsymmetric problems agree, and the judge accepts each."""
    law = Friction(mu=(0.3, 0.15), p=(0.05, 0.2))
    for nodes, kind in product(
        (5, 40, 120), ("symmetric", "unsymmetric")
    ):  # 120: in single precision
        rng = np.random.default_rng(nodes)
        W, q = body(rng, nodes)
        if kind == "unsymmetric":
            W *= 1 + 1e-6 * rng.normal(size=W.shape)
        found = []
        for algebra in algebras():
            operator = _kernel.CondensedOperator(W, 3, algebra=algebra)
            assert operator.prepare()
            found.append(CondensedNewton().solve_condensed(operator, law, q, TOL).reaction)
            assert judge.condensed(W, q, law.mu, law.p, found[-1], TOL).error <= judge.DEFECT * TOL
        for r in found:
            assert np.abs(r - found[0]).max() <= 1e4 * TOL * np.abs(r).max()


def test_processor_decides(monkeypatch):
    """The widest instructions; what every processor can run where there are none, or they were not compiled."""
    assert condensed_kernel.widest_algebra() is ([*algebras()[1:], None])[0]
    monkeypatch.setattr(_kernel, "instruction_sets", lambda: ["none", "such"])
    assert condensed_kernel.widest_algebra() is None


def test_an_algebra_is_one_of_ours():
    """Another object, or another capsule, is refused before it is used."""
    with pytest.raises(TypeError):
        _kernel.CondensedOperator(np.eye(3), 3, algebra="avx2")
    with pytest.raises(ValueError, match="incorrect name"):
        _kernel.CondensedOperator(np.eye(3), 3, algebra=datetime.datetime_CAPI)


def test_last_factors_solve_what_new_ones_solve():
    """From starts near the solution and far from it, of many unknowns: the same solution."""
    rng = np.random.default_rng(7)
    law = Friction(mu=(0.3, 0.15), p=(0.05, 0.2))
    W, q = body(rng, 100)
    operator, solver = condensed_kernel.condensed_operator(W, 3), CondensedNewton()
    first = solver.solve_condensed(operator, law, q, TOL)
    for size in (1e-12, 1e-6, 1e-3, 0.1):
        start = first.reaction.ravel() * (1 + size * rng.normal(size=q.size))
        again = solver.solve_condensed(operator, law, q, TOL, [start])
        assert again.branch == "newton" and again.change <= 1e2 * TOL
        difference = np.abs(again.reaction - first.reaction).max()
        assert difference <= 1e4 * TOL * np.abs(first.reaction).max()


@pytest.mark.parametrize("seed", range(3))
def test_compensated_sums_stay_compensated(seed):
    """Where slip and gap are the rounding of what cancels, they are exact ones, whatever instructions the compiler uses."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(12, 12))
    W = B @ B.T
    W = (W + W.T) / 2
    q = -W @ (np.tile([0.1, 0.05, 1.0], 4) * rng.uniform(0.5, 1, size=12))
    for algebra in algebras():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RoundingWarning)
            operator = _kernel.CondensedOperator(W, 3, algebra=algebra)
            found = CondensedNewton().solve_condensed(operator, Friction(0.5), q, 1e-14)
        assert (found.status == 1).all()
        for row, given, w in zip(W, q, found.displacement.ravel()):
            terms = map(lambda a, b: Fraction(a) * Fraction(b), row, found.reaction.ravel())
            exact = Fraction(given) + sum(terms)
            assert abs(Fraction(w) - exact) <= 1e-14 * abs(exact) + 1e-28 * abs(given)
