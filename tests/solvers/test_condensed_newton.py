# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""solve_condensed on plain arrays: every answer is judged by NumPy code that shares nothing with it."""

import itertools
from collections import Counter

import numpy as np
import pytest
import scipy.sparse

from dolfinx_contact import Friction
from dolfinx_contact.solvers.condensed.newton import (
    CondensedNewton,
    CondensedNotConverged,
    solve_condensed,
)
from mechanics import judge
from mechanics.condensed import random_problem

TOL = 1e-8


def friction(scene):
    return (
        Friction(0)
        if not scene.mu.any()
        else Friction(scene.mu, scene.p)
        if scene.mu.size > 1
        else Friction(scene.mu[0])
    )


def check(scene, **options):
    """Solve; judge; return the result."""
    found = solve_condensed(scene.W, scene.q, friction(scene), **options)
    tol = options.get("tol", TOL)
    W = scene.W.toarray() if scipy.sparse.issparse(scene.W) else scene.W
    # The law; how far reactions are from tight ones where W has no full rank is the stress matrix' question.
    verdict = judge.condensed(W, scene.q, scene.mu, scene.p, found.reaction, tol)
    assert verdict.error <= judge.DEFECT * tol
    w = scene.q + (W @ found.reaction.ravel()).reshape(scene.q.shape)
    assert found.displacement == pytest.approx(
        w, abs=1e-12 * np.abs(W).max() * np.abs(found.reaction).max()
    )
    return found


def outcomes(scenes, **options):
    """Number of scenes solved; all others must say so by an exception that carries a state."""
    solved = 0
    for scene in scenes:
        try:
            check(scene, **options)
            solved += 1
        except CondensedNotConverged as failure:
            assert failure.tried and np.isfinite(failure.best.reaction).all()
            assert "newton" in str(failure)
    return solved


@pytest.mark.slow
def test_random_problems_of_every_rank():
    """Every rank, mu 1e-3..10, crossed p ratios up to 1e3: all are solved, a fifth by other methods than Newton's.

    A solution exists in all of them; the worst have more contacts than degrees of freedom, mu above 5
    and a slip rule at right angles to friction.
    """
    patient = CondensedNewton(max_iterations=20_000)
    branches = Counter(check(random_problem(seed), solver=patient).branch for seed in range(150))
    assert branches["newton, 3 rho_t"] > 10 and branches["interior_point"] > 10


@pytest.mark.slow
def test_crossed_slip_rules_at_many_contacts():
    """Sixty contacts of every rank, slip rules crossed by 3: right answer or exception, nine of ten solved."""
    scenes = (random_problem(seed, contacts=60, ratio=3) for seed in range(1000, 1020))
    patient = CondensedNewton(
        max_iterations=20_000
    )  # one of ten needs up to 1,700, more than by default
    assert outcomes(scenes, solver=patient, max_seconds=20) >= 18


def test_random_problems_of_usual_friction():
    """Friction of materials (mu <= 0.5, p ratio <= 10) and W of full rank: all are solved."""
    for seed in range(100):
        rank = 3 * (1 + seed % 12)
        check(
            random_problem(
                1000 + seed,
                contacts=rank // 3,
                rank=rank,
                ratio=1 + seed % 10,
                mu_range=(1e-3, 0.5),
            )
        )


def test_what_is_unique_is_found():
    """Where the solution is unique (small friction, regular W) it is the one that the problem was made from."""
    for seed in range(4):
        scene = random_problem(seed, contacts=3, rank=9, mu_range=(0.05, 0.3), ratio=1.5)
        scene.W += 5 * np.diag(scene.W).mean() * np.eye(9)
        scene.q = scene.w - (scene.W @ scene.r.ravel()).reshape(-1, 3)
        found = check(scene, tol=1e-11)
        assert found.reaction == pytest.approx(scene.r, abs=1e-8)


def test_two_dimensions():
    """(t, n) contacts come from the same template; every rank."""
    solved = outcomes(random_problem(seed, dim=2, mu_range=(1e-3, 2)) for seed in range(60))
    assert solved >= 57


@pytest.mark.parametrize("dim", [2, 3])
def test_frictionless_is_the_linear_complementarity_problem(dim):
    """mu = 0: r_t = 0, r_n >= 0, gap >= 0, one of them zero, for every rank; all are solved."""
    for seed in range(60):
        scene = random_problem(seed, dim=dim)
        scene.mu = np.zeros(dim - 1)
        scene.r[:, :-1] = 0
        scene.q = scene.w - (scene.W @ scene.r.ravel()).reshape(-1, dim)
        found = check(scene)
        assert not found.reaction[:, :-1].any() and (found.reaction[:, -1] >= 0).all()
        size = np.abs(scene.q).max()
        assert (found.displacement[:, -1] >= -1e-6 * size).all()


def test_isotropic_and_associated():
    """The simpler laws give what the full law gives with p written out."""
    for seed in range(20):
        scene = random_problem(seed, contacts=6, rank=18, mu_range=(0.05, 0.5))
        scene.p = scene.mu.copy()
        scene.W += np.diag(scene.W).mean() * np.eye(18)
        found = check(scene, tol=1e-11)
        explicit = solve_condensed(scene.W, scene.q, Friction(scene.mu, 7 * scene.mu), tol=1e-11)
        assert found.reaction == pytest.approx(explicit.reaction, abs=1e-9)
        isotropic = solve_condensed(scene.W, scene.q, Friction(scene.mu[0]), tol=1e-11)
        both = solve_condensed(scene.W, scene.q, Friction((scene.mu[0], scene.mu[0])), tol=1e-11)
        assert np.array_equal(isotropic.reaction, both.reaction)


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("force", [1e-9, 1.0, 1e9])
def test_units(length, force):
    """Lengths and forces in other units change nothing but the units, to 1e-8."""
    for seed in range(10):
        scene = random_problem(seed, contacts=5, rank=15, mu_range=(0.02, 0.3), ratio=3)
        reference = check(scene, tol=1e-11)
        scene.W = scene.W * (length / force)
        scene.q = scene.q * length
        found = check(scene, tol=1e-11)
        scale = np.abs(reference.reaction).max()
        assert found.reaction / force == pytest.approx(reference.reaction, abs=1e-8 * scale)
        assert np.array_equal(found.status, reference.status)


def test_slightly_unsymmetric():
    """W as factorisations give it, or worse: unsymmetric by 1e-6."""
    for seed in range(20):
        check(
            random_problem(
                seed, contacts=6, rank=18, mu_range=(0.01, 0.5), ratio=2, unsymmetric=1e-6
            )
        )


def test_coefficients_per_contact():
    """Each contact has its law, frictionless ones among them."""
    scene = random_problem(3, contacts=6, rank=18, mu_range=(0.1, 0.5))
    mu = np.random.default_rng(0).uniform(0.1, 0.5, size=(6, 2))
    mu[2] = 0
    found = solve_condensed(scene.W, scene.q, Friction(mu, p=(1, 2)))
    assert not found.reaction[2, :2].any()
    w = scene.q + (scene.W @ found.reaction.ravel()).reshape(-1, 3)
    size = np.abs(scene.q).max()
    for i, (r, x) in enumerate(zip(found.reaction, w)):
        if found.status[i] == 0:
            assert not r.any() and x[2] >= 0
            continue
        assert abs(x[2]) <= 1e-6 * size
        if i != 2:
            assert np.linalg.norm(r[:2] / mu[i]) <= r[2] * (1 + 1e-12)
            if found.status[i] == 1:
                assert np.linalg.norm(x[:2]) <= 1e-7 * size
            else:
                along = r[:2] / np.array([1, 2]) ** 2
                across = x[0] * along[1] - x[1] * along[0]
                assert abs(across) <= 1e-7 * size * np.linalg.norm(r) and x[:2] @ along < 0


def test_coefficients_far_apart_in_a_contact():
    """Contacts that slip easily along one direction and hardly along the other, up to a millionfold, are
    solved, all but one of seven: that of seed 28 is refused."""
    n = 40
    for seed in (25, 26, 27, 29, 30, 31):
        rng = np.random.default_rng(seed)
        A = rng.normal(size=(3 * n, 3 * n))
        W = A @ A.T / (3 * n) + 1e-3 * np.eye(3 * n)
        mu, q = 10 ** rng.uniform(-3, 3, size=(n, 2)), rng.normal(size=(n, 3))
        r = solve_condensed(
            W, q, Friction(mu), solver=CondensedNewton(max_iterations=20_000)
        ).reaction
        w = q + (W @ r.ravel()).reshape(n, 3)
        small, force = 1e-6 * np.abs(q).max(), 1e-6 * np.abs(r).max()
        assert (w[:, 2] >= -small).all() and (r[:, 2] >= 0).all()
        assert (np.minimum(w[:, 2] / small, r[:, 2] / force) <= 1).all()
        ratio = np.linalg.norm(r[:, :2] / mu, axis=1)
        assert (ratio <= r[:, 2] * (1 + 1e-12)).all()
        slips = (r[:, 2] > force) & (np.linalg.norm(w[:, :2], axis=1) > small)
        assert ratio[slips] == pytest.approx(r[slips, 2], rel=1e-6)
        normal = r[:, :2] / mu**2  # of the cone
        for slip, along in zip(w[slips, :2], normal[slips]):
            assert abs(slip[0] * along[1] - slip[1] * along[0]) <= small * np.linalg.norm(along)
            assert slip @ along < 0


def test_nothing_presses():
    """Gaps everywhere: no reactions, exactly, and no iteration."""
    scene = random_problem(0, contacts=4)
    scene.q[:, 2] = np.abs(scene.q[:, 2])
    found = solve_condensed(scene.W, scene.q, friction(scene))
    assert not found.reaction.any() and found.iterations == 0 and found.error == 0


def test_sparse_and_flat_input():
    """A SciPy sparse W and a flat q are the same problem."""
    scene = random_problem(5, contacts=4, rank=12, mu_range=(0.1, 0.5), ratio=2)
    dense = solve_condensed(scene.W, scene.q, friction(scene))
    sparse = solve_condensed(scipy.sparse.csr_matrix(scene.W), scene.q.ravel(), friction(scene))
    assert np.array_equal(dense.reaction, sparse.reaction)


def test_the_same_bits_twice():
    """Nothing depends on time, addresses or random numbers."""
    for seed in range(20):
        scene = random_problem(seed, mu_range=(0.01, 1))
        found = [solve_condensed(scene.W, scene.q, friction(scene)).reaction for _ in range(2)]
        assert np.array_equal(*found)


def test_start_at_the_solution():
    """From the solution one look is enough."""
    scene = random_problem(7, contacts=5, rank=15, mu_range=(0.1, 0.4), ratio=2)
    found = solve_condensed(scene.W, scene.q, friction(scene))
    again = solve_condensed(scene.W, scene.q, friction(scene), r0=found.reaction)
    assert again.iterations <= 1


def test_infeasible_raises():
    """Two contacts on one degree of freedom that cannot both stay out of the plane: an exception."""
    W = np.zeros((6, 6))
    W[2, 2] = W[5, 5] = 1
    W[2, 5] = W[5, 2] = -1  # pushing one up pushes the other down
    q = np.zeros((2, 3))
    q[:, 2] = -1
    with pytest.raises(CondensedNotConverged, match="no solution") as caught:
        solve_condensed(W, q, Friction(0.3))
    assert caught.value.infeasible and caught.value.best.error > 1e-3
    assert {attempt.branch for attempt in caught.value.tried} >= {"newton", "proximal_point"}


def squeezed(seed, contacts, rank, closing):
    """W of a rank, whose null space has the pressures y >= 0 on half of the contacts; y . q = -closing."""
    rng = np.random.default_rng(seed)
    y = np.zeros((contacts, 3))
    y[rng.permutation(contacts)[: 1 + contacts // 2], 2] = 1
    y = y.ravel() * rng.uniform(0.3, 1, size=3 * contacts)
    B = rng.normal(size=(3 * contacts, rank))
    B -= np.outer(y, y @ B) / (y @ y)
    q = rng.normal(size=3 * contacts)
    return B @ B.T, (q - (closing + y @ q) / (y @ y) * y).reshape(-1, 3)


@pytest.mark.parametrize("unsymmetric", [0.0, 2.3e-16])
def test_bodies_that_are_squeezed_are_refused_soon(unsymmetric):
    """Gaps that no reaction opens are proved to have no solution, in few iterations; if the same pressures open them, nothing is claimed."""
    for seed, contacts, rank in itertools.product(range(3), (2, 5, 20), ("contacts", "full")):
        size = (seed, contacts, contacts if rank == "contacts" else 3 * contacts - 1)
        W, q = squeezed(*size, closing=0.5)
        W *= 1 + unsymmetric * np.random.default_rng(seed).integers(0, 3, size=W.shape)
        with pytest.raises(CondensedNotConverged) as caught:
            solve_condensed(W, q, Friction(0.3))
        assert caught.value.infeasible and caught.value.best.iterations <= 200
        W, q = squeezed(*size, closing=-0.5)
        try:
            solve_condensed(W, q, Friction(0.3))
        except CondensedNotConverged as failure:
            assert not failure.infeasible


@pytest.mark.slow
def test_a_limit_of_iterations_ends_a_refusal():
    """Friction of 1e7, of which most are refused: no more iterations than asked for, but for the last method's, and more if more are."""
    refused = 0
    for seed in range(4):
        scene = random_problem(seed, contacts=30, mu_range=(1e7, 1e8))
        try:
            solve_condensed(
                scene.W, scene.q, friction(scene), solver=CondensedNewton(max_iterations=600)
            )
        except CondensedNotConverged as failure:
            refused += 1
            assert failure.best.iterations <= 2 * 600
            patient = CondensedNewton(max_iterations=2 * failure.best.iterations)
            with pytest.raises(CondensedNotConverged, match="max_iterations") as again:
                solve_condensed(scene.W, scene.q, friction(scene), solver=patient)
            assert again.value.best.iterations > failure.best.iterations
    assert refused >= 2


def test_caps():
    """A cap on iterations or seconds ends the search with an exception."""
    scene = random_problem(9, contacts=12, rank=36, mu_range=(1, 5), ratio=100)
    with pytest.raises(CondensedNotConverged):
        solve_condensed(scene.W, scene.q, friction(scene), solver=CondensedNewton(max_iterations=1))
    with pytest.raises(CondensedNotConverged):
        solve_condensed(scene.W, scene.q, friction(scene), max_seconds=1e-9)


@pytest.mark.parametrize(
    "change, message",
    [
        (dict(W=np.eye(5)), "shape"),
        (dict(W=np.full((6, 6), np.nan)), "NaN"),
        (dict(W=-np.eye(6)), "negative normal"),
        (dict(W="stiff"), "W must be"),
        (dict(q=np.zeros(5)), "q must"),
        (dict(q=np.zeros((2, 3, 1))), "q must"),
        (dict(q=np.full((2, 3), np.inf)), "infinity"),
        (dict(q=np.zeros((2, 3), complex)), "real"),
        (dict(friction="rough"), "Friction"),
        (dict(friction=Friction(np.ones((3, 2)))), "3 contacts"),
        (dict(tol=0), "tol"),
        (dict(tol=1e-16), "tol"),
        (dict(tol=np.nan), "tol"),
        (dict(solver="newton"), "solver"),
        (dict(max_seconds=-1), "max_seconds"),
        (dict(r0=np.zeros(3)), "r0"),
        (dict(r0=np.full((2, 3), np.nan)), "r0"),
    ],
)
def test_mistakes(change, message):
    """A mistake is a ValueError that names it."""
    arguments = dict(W=np.eye(6), q=-np.ones((2, 3)), friction=Friction(0.3)) | change
    with pytest.raises(ValueError, match=message):
        solve_condensed(**arguments)


@pytest.mark.parametrize("name", ["slip_tol", "max_iterations", "newton_iterations", "max_seconds"])
def test_options_are_positive(name):
    """Options of the solver are positive numbers."""
    for value in (0, -1, np.nan, "many"):
        with pytest.raises(ValueError, match=name):
            CondensedNewton(**{name: value})


def test_a_caller_may_give_newton_more_iterations():
    """Newton's method alone takes as many iterations as its caller lets it, also more than by default."""

    def iterations(seed):
        scene = random_problem(seed, contacts=8, rank=24, mu_range=(0.05, 2), ratio=3)
        solver = CondensedNewton(newton_iterations=1000, fallbacks=False)
        try:
            return check(scene, solver=solver).iterations
        except CondensedNotConverged as failure:
            return failure.best.iterations

    assert max(map(iterations, (453, 1165, 1344))) > CondensedNewton().newton_iterations


def test_iterations_and_seconds_are_those_of_all_searches():
    """An answer counts what every method took, also those that made it more accurate."""
    for seed in range(20):
        found = check(random_problem(seed, contacts=6, rank=9, mu_range=(0.05, 0.5)))
        assert found.iterations == sum(attempt.iterations for attempt in found.tried)
        assert found.seconds >= sum(attempt.seconds for attempt in found.tried)


def test_axes_per_contact():
    """Turning the principal directions is turning the tangential part of W and q."""
    scene = random_problem(11, contacts=6, rank=18, mu_range=(0.1, 0.5), ratio=3)
    angle = np.random.default_rng(1).uniform(0, 2 * np.pi, size=6)
    turn = np.zeros((18, 18))
    for i, a in enumerate(angle):
        turn[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = [
            [np.cos(a), np.sin(a), 0],
            [-np.sin(a), np.cos(a), 0],
            [0, 0, 1],
        ]
    axes = np.column_stack((np.cos(angle), np.sin(angle)))
    mu, p = np.tile(scene.mu, (6, 1)), np.tile(scene.p, (6, 1))
    straight = solve_condensed(scene.W, scene.q, Friction(mu, p))
    turned = solve_condensed(
        turn.T @ scene.W @ turn, (scene.q.ravel() @ turn).reshape(-1, 3), Friction(mu, p, axes=axes)
    )
    expected = (straight.reaction.ravel() @ turn).reshape(-1, 3)
    assert turned.reaction == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
