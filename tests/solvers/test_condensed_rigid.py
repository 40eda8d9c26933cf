# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Rigid bodies (W = H M^-1 H', rank deficient, sparse), one contact, and contacts in the plane."""

from itertools import product

import numpy as np
import pytest
import scipy.sparse
from condensed_scenes import judge

from benchmarks.rigid_family import KINDS, problem
from dolfinx_contact import CondensedNotConverged, Friction
from dolfinx_contact.solvers.condensed.newton import solve_condensed

pytestmark = pytest.mark.filterwarnings("ignore::dolfinx_contact.support.checks.RoundingWarning")
TOL = 1e-8


def check(W, q, friction, mu, p=None, **options):
    """Solve; the judge's errors are within tol or rounding; returns the result."""
    found = solve_condensed(W, q, friction, **options)
    mu = np.broadcast_to(mu, q.shape[1] - 1)
    errors = judge(W, q, mu, np.ones(len(mu)) if p is None else p, found.reaction)
    assert max(errors) <= 1.01 * max(TOL, found.rounding)
    return found


@pytest.mark.filterwarnings("ignore:local_error")  # of contacts that bear next to nothing
@pytest.mark.parametrize("kind", KINDS)
def test_piles_and_towers(kind):
    """Rigid bodies, 1 to 16, seeds other than the benchmark's: every problem is solved."""
    for n in (1, 2, 5, 16):
        for seed in range(100, 106):
            scene = problem(kind, n, seed, motion=[0.0, 0.1, 1.0][seed % 3], spread=seed % 3)
            check(scene.W, scene.q, Friction(scene.mu), scene.mu, max_seconds=20)


LARGE = [  # 135 to 284 contacts
    ("tower", 71, 1.0, 2.0, 0.0), ("tower", 71, 0.1, 0.5, 3e-3), ("capsules", 32, 0.1, 0.5, 3e-3),
    ("capsules", 32, 1.0, 2.0, 0.0), ("spheres", 32, 0.1, 0.5, 0.0), ("rocks", 32, 1.0, 2.0, 0.0),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind,n,motion,spread,uneven", LARGE)
def test_piles_of_hundreds(kind, n, motion, spread, uneven):
    """Up to 284 contacts, W of rank well below 3n, symmetric or not: solved, mu 0.3 and 0.7."""
    for mu in (0.3, 0.7):
        scene = problem(kind, n, 100, mu, spread, motion, uneven)
        check(scene.W, scene.q, Friction(mu), mu, max_seconds=100)


@pytest.mark.slow
def test_large_piles_have_more_iterations():
    """Default iterations grow with the contacts: 156 capsules that take more than 600 are solved."""
    scene = problem("capsules", 32, 2, motion=1.0, spread=2.0)
    found = check(scene.W, scene.q, Friction(scene.mu), scene.mu, max_seconds=100)
    assert 600 < found.iterations <= 10 * len(scene.q)


@pytest.mark.parametrize("kind", ["wall", "rocks", "capsules"])
def test_the_interior_point_method_is_a_start(kind):
    """Moving piles of some fifty contacts and rank-deficient W, none of which one attempt of Newton's
    method solves: solved, some of them by the interior point method."""
    branches = []
    for seed in range(100, 112):
        scene = problem(
            kind, 8 if kind != "capsules" else 16, seed, motion=1.0, spread=1.0, uneven=3e-3
        )
        found = check(scene.W, scene.q, Friction(scene.mu), scene.mu, max_seconds=20)
        branches += [attempt.branch for attempt in found.tried if attempt.converged]
    assert "interior_point" in branches


@pytest.mark.slow
def test_any_sparse_storage():
    """Formats, number types, entries given twice or given as zero: to the last bit the same answer as of the
    array, with friction and without; with principal axes accepted by the judge.  What is not finite is refused."""
    scene = problem("wall", 16, 3, mu=0.4)  # more than 64 contacts
    n = len(scene.q)
    angle = np.linspace(0, 3, n)
    axes = np.column_stack((np.cos(angle), np.sin(angle)))
    for law in (Friction(scene.mu), Friction(0.0), Friction((0.4, 0.2), axes=axes)):
        whole = solve_condensed(scene.W.toarray(), scene.q, law).reaction
        twice = scipy.sparse.coo_matrix(scene.W)
        half = (np.tile(twice.data, 2) / 2, (np.tile(twice.row, 2), np.tile(twice.col, 2)))
        zeros = scene.W.tolil()
        zeros[0, -1] = 1.0
        zeros = zeros.tocsr()
        zeros.data[zeros.indptr[1] - 1] = 0.0
        for W in (
            scene.W.tocsr(), scene.W.tocsc(), twice, scipy.sparse.coo_matrix(half), zeros,
            scipy.sparse.csr_array(scene.W),
        ):  # fmt: skip
            before = W.copy()
            found = solve_condensed(W, scene.q, law).reaction
            if law.axes is None:
                assert np.array_equal(found, whole)
            else:
                assert judged(scene, law, found) and judged(scene, law, whole)
            assert (W != before).nnz == 0  # the user's own stays what it was
    counts = scipy.sparse.identity(3 * n, dtype=int)
    q = np.tile([0.0, 0.0, -1.0], (n, 1))
    assert np.allclose(solve_condensed(counts, q, Friction(0.3)).reaction, -q)
    bad = scipy.sparse.identity(3 * n, format="csr") * np.nan
    with pytest.raises(ValueError, match="W"):
        solve_condensed(bad, q, Friction(0.3))


def judged(scene, law, reaction) -> bool:
    """Whether the judge accepts reactions with principal axes of friction."""
    n, turns = len(reaction), np.tile(np.eye(3), (len(reaction), 1, 1))
    turns[:, 0, :2], turns[:, 1, 0], turns[:, 1, 1] = law.axes, -law.axes[:, 1], law.axes[:, 0]
    along = np.zeros((3 * n, 3 * n))
    for i, turn in enumerate(turns):
        along[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = turn
    q, r = (np.einsum("nij,nj->ni", turns, v) for v in (scene.q, reaction))
    return max(judge(along @ scene.W.toarray() @ along.T, q, law.mu, law.p, r)) <= 2 * TOL


def random_contact(rng, dim):
    """W symmetric positive definite of condition up to 1e8, any load, any law."""
    B = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
    W = (B * 10 ** rng.uniform(-rng.uniform(0, 8), 0, size=dim)) @ B.T
    q = rng.normal(size=(1, dim))
    q[0, -1] = -abs(q[0, -1]) * 10 ** rng.uniform(-3, 0)
    mu = 10 ** rng.uniform(-1, 0.5, size=dim - 1)
    p = 10 ** rng.uniform(-1, 1, size=dim - 1)
    return (W + W.T) / 2, q, mu, p


@pytest.mark.parametrize("count", [300, pytest.param(1000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("dim", [2, 3])
def test_one_contact_is_never_refused(dim, count):
    """A single contact on a positive definite W is solved whatever its condition and law."""
    rng = np.random.default_rng(dim)
    for _ in range(count):
        W, q, mu, p = random_contact(rng, dim)
        law = Friction(mu[0]) if dim == 2 else Friction(mu, p)
        check(W, q, law, mu, p)


def test_one_contact_without_rank():
    """Compliance of rank one or two, moved in what it can give: solved too."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        rank = rng.integers(1, 3)
        H = rng.normal(size=(3, rank))
        H[2, 0] += 2 * np.sign(H[2, 0])
        mu = rng.uniform(0.1, 0.6)
        if np.linalg.norm(H[:2] @ np.linalg.pinv(H[2:])) * mu >= 1:
            continue  # may jam without a solution
        W = H @ H.T
        check(
            (W + W.T) / 2,
            (H @ -np.abs(rng.normal(size=rank)) * np.sign(H[2, 0]))[None],
            Friction(mu),
            mu,
        )


def brute_force(W, q, mu):
    """Whether any state of the contacts in the plane solves the problem; independent of the kernel."""
    n = len(q)
    flat, size = q.ravel(), np.abs(q).max()
    for states in product("osrl", repeat=n):
        trial, test = [], []
        for i, state in enumerate(states):
            t, normal = np.eye(2 * n)[2 * i : 2 * i + 2]
            if state == "s":
                trial += [t, normal]
                test += [t, normal]
            elif state != "o":
                trial.append(normal + (mu if state == "r" else -mu) * t)
                test.append(normal)
        r = np.zeros(2 * n)
        if trial:
            A, B = np.array(test), np.array(trial).T
            r = B @ np.linalg.solve(A @ W @ B, -A @ flat)
        w, r = (flat + W @ r).reshape(-1, 2), r.reshape(-1, 2)
        force = np.abs(r).max() + 1e-300
        if (r[:, 1] < -1e-9 * force).any() or (w[:, 1] < -1e-9 * size).any():
            continue
        if (np.abs(r[:, 0]) > mu * r[:, 1] + 1e-9 * force).any():
            continue
        if all(s in "os" or r[i, 0] * w[i, 0] <= 1e-9 * force * size for i, s in enumerate(states)):
            return True
    return False


@pytest.mark.slow
def test_the_plane():
    """One to four contacts in two dimensions, W positive definite or of any sign off its diagonal, mu
    to 3: solved where one of all states, tried here, is a solution, but for four of a hundred where W is
    of any sign; refused where none is."""
    rng, outcomes, lost = np.random.default_rng(1), {True: 0, False: 0}, 0
    for k in range(400):
        n = 1 + k % 4
        B = rng.normal(size=(2 * n, 2 * n))
        W = B @ B.T
        if k % 2:
            W = (B + B.T) / 2
            W[np.diag_indices(2 * n)] = np.abs(np.diag(W)) + 0.1
        q, mu = rng.normal(size=(n, 2)), rng.uniform(0.1, 3)
        q[:, 1] -= 1
        solvable = brute_force(W, q, mu)
        outcomes[solvable] += 1
        try:
            check(W, q, Friction(mu), mu)
            assert solvable
        except CondensedNotConverged:
            lost += solvable
            assert k % 2  # positive definite ones are all solved
    assert lost <= 4
    assert min(outcomes.values()) >= 20


def chain(bodies, close):
    """Spheres in a row on the ground, between two walls that move by ``close`` towards each other."""
    rows, q = [], []
    for normal, at, first in [((1, 0, 0), k, k - 1) for k in range(bodies + 1)] + [
        ((0, 0, 1), k, None) for k in range(bodies)
    ]:
        n = np.array(normal, float)
        frame = np.vstack((np.roll(n, 1), np.roll(n, 2), n))
        H = np.zeros((3, 6 * bodies))
        for body, side in ((at, -1.0), (first, 1.0)):
            if body is not None and 0 <= body < bodies:
                x, y, z = side * n
                arm = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
                H[:, 6 * body : 6 * body + 6] = -side * frame @ np.hstack((np.eye(3), arm))
        rows.append(H)
        wall = first is not None and (at == bodies or first < 0)
        q.append((0, 0, -close if wall else 0.0 if first is not None else -0.01))
    H = np.vstack(rows)
    inverse_mass = np.diag(np.tile([1.0] * 3 + [2.5] * 3, bodies))
    return H @ inverse_mass @ H.T, np.array(q)


@pytest.mark.parametrize("bodies", [1, 3, 10, 40])
def test_contacts_that_close_are_refused(bodies):
    """Spheres in a row between walls that come together, which no reactions keep from overlapping: refused; solved
    where the walls part."""
    W, q = chain(bodies, 0.01)
    with pytest.raises(CondensedNotConverged, match="no solution"):
        solve_condensed(W, q, Friction(0.5))
    W, q = chain(bodies, -0.01)
    check(W, q, Friction(0.5), 0.5)


def test_jammed():
    """One contact that sticks with reactions hundreds of times the load, r = -W^-1 q."""
    W, q = np.array([[1.001, 1], [1, 1.001]]), np.array([[5, -0.01]])
    found = check(W, q, Friction(1.02), 1.02)
    assert found.reaction[0] == pytest.approx(-np.linalg.solve(W, q[0]), rel=1e-9)


def test_one_coefficient_per_contact():
    """An array is one coefficient per contact, two contacts included; a pair is a Friction."""
    rng = np.random.default_rng(4)
    for n in (1, 2, 3):
        B = rng.normal(size=(3 * n, 3 * n))
        W, q = B @ B.T + np.eye(3 * n), rng.normal(size=(n, 3))
        q[:, 2] = -1
        mu = rng.uniform(0.1, 0.4, size=n)
        found = solve_condensed(W, q, mu, tol=1e-11)
        expected = solve_condensed(W, q, Friction(np.column_stack((mu, mu))), tol=1e-11)
        assert np.array_equal(found.reaction, expected.reaction)
        bound = np.linalg.norm(found.reaction[:, :2], axis=1) / mu
        assert (bound <= found.reaction[:, 2] * (1 + 1e-12)).all()
    for wrong in ([0.3], [[0.3, 0.2, 0.1]], [0.3, np.nan, 0.1], [-0.1, 0.2, 0.3]):
        with pytest.raises(ValueError, match="friction|mu"):
            solve_condensed(W, q, np.array(wrong))
