# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What the errors of a condensed solution promise: forces that act as scale, rounding said, never less
than true.  The judge is NumPy in long double and shares nothing with the solver."""

import warnings

import numpy as np
import pytest
from condensed_scenes import judge

from dolfinx_contact import CondensedNewton, Friction, _kernel
from dolfinx_contact.solvers.condensed.newton import solve_condensed
from dolfinx_contact.solvers.condensed.result import CondensedNotConverged
from dolfinx_contact.support.checks import RoundingWarning
from mechanics.condensed import random_problem

TOL = 1e-8


def solved(W, q, friction, tol=TOL, **options):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RoundingWarning)
        return solve_condensed(W, q, friction, tol=tol, **options)


def isotropic(mu, tangents=2):
    return np.full(tangents, mu), np.ones(tangents)


@pytest.mark.parametrize("unit", [1e-100, 1e-9, 1.0, 1e9, 1e100])
@pytest.mark.parametrize("depth", [1e-9, 1e-11, 1e-12, 1e-13, 1e-14])
def test_grazing_while_sliding(depth, unit):
    """However light the touch of a sliding contact, its reaction is right to the rounding that is said."""
    q = unit * np.array([[1.0, 0.5, -depth]])
    found = solved(np.eye(3), q, Friction(0.3))
    expected = depth * unit * np.array([-0.6 / np.sqrt(5), -0.3 / np.sqrt(5), 1.0])
    assert np.abs(found.reaction[0] - expected).max() <= 1e-8 * depth * unit
    errors = judge(np.eye(3), q, *isotropic(0.3), found.reaction)
    assert max(errors) <= max(TOL, found.rounding)
    # eps times the terms that cancel, of which |r - kappa w| has the slip and mu times the slip
    cancelling = np.finfo(float).eps * np.linalg.norm([1, 0.5, 0.3 * np.sqrt(1.25)])
    force = np.linalg.norm(expected) / unit
    assert found.rounding == pytest.approx(cancelling / force, rel=1e-3)


@pytest.mark.parametrize("depth", [0.0, 1e-17, 1e-30, -1e-17, -1.0])
def test_nothing_acts(depth):
    """A penetration below the rounding of the slip is no contact: no reaction, at once, no warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = solve_condensed(np.eye(6), [[1, 0.5, -depth], [0, 0, 0]], Friction(0.3))
    assert not found.reaction.any() and found.iterations == 0
    assert found.error <= found.rounding <= np.finfo(float).eps
    assert found.error == found.slip_error == 0 or depth > 0


def test_penetration_counts():
    """No reactions where something presses is no solution, whatever slides beside it."""
    for depth in 10.0 ** -np.arange(0, 13):
        for mu in (1e-3, 0.3, 10.0):
            q = np.array([[1.0, 0.5, -depth], [3.0, 0.0, 1.0]])
            found = solved(np.eye(6), q, Friction(mu))
            assert found.reaction[0, 2] == pytest.approx(depth, rel=1e-6)


def test_limit_of_rounding_is_a_warning_that_names_it():
    """An answer above tol is returned with its true error and rounding in a RoundingWarning."""
    with pytest.warns(RoundingWarning, match="rounding"):
        found = solve_condensed(np.eye(3), [[1, 0.5, -1e-13]], Friction(0.3), tol=1e-12)
    assert 1e-12 < max(found.error, found.slip_error) <= found.rounding


@pytest.mark.parametrize("count", [100, pytest.param(300, marks=pytest.mark.slow)])
def test_errors_are_never_less_than_true(count):
    """W of condition up to 1e14, one to three contacts: a claimed error differs from the true one by
    less than tol/100 or rounding's tenth, and an accepted true one is within tol or rounding."""
    rng, accepted, limited = np.random.default_rng(5), 0, 0
    for _ in range(count):
        n = rng.integers(1, 4)
        B = np.linalg.qr(rng.normal(size=(3 * n, 3 * n)))[0]
        W = (B * 10 ** rng.uniform(-14, 0, size=3 * n)) @ B.T
        W, mu = (W + W.T) / 2, rng.uniform(0.1, 3)
        q = rng.normal(size=(n, 3))
        try:
            found = solved(W, q, Friction(mu), max_seconds=2)
        except (CondensedNotConverged, ValueError):
            continue
        errors = judge(W, q, *isotropic(mu), found.reaction)
        accepted += 1
        limited += found.rounding > TOL
        for claimed, true in zip((found.error, found.slip_error), errors):
            assert abs(claimed - true) <= max(TOL / 100, found.rounding / 10)
            assert true <= 1.01 * max(TOL, found.rounding)
    assert accepted >= 5 / 6 * count and limited >= count / 60


@pytest.mark.parametrize("spring", [1e-2, 1e-5, 1e-8])
def test_soft_springs_do_not_hide_errors(spring):
    """W and q of a body on a soft spring, both of size 1 / spring: the reactions balance the load.

    Rigid translations of 1 / spring are in W; the elastic part is of size one.
    """
    rng = np.random.default_rng(2)
    n = 6
    rigid = np.tile(np.eye(3), (n, 1))
    B = rng.normal(size=(3 * n, 3 * n))
    load = np.array([0.1, 0.05, -1.0])
    W = B @ B.T / (3 * n) + np.eye(3 * n) + rigid @ rigid.T / spring
    q = (rigid @ load / spring).reshape(n, 3) + 0.01 * rng.normal(size=(n, 3))
    found = solved(W, q, Friction(0.3))
    balance = found.reaction.sum(axis=0) + load
    assert np.abs(balance).max() <= 2 * (spring + max(TOL, found.rounding)) * np.linalg.norm(load)


def test_scales_of_the_caller():
    """stiffness scales the error, tangential_stiffness the slip error, external is a force that acts."""
    scene = random_problem(4, contacts=5, rank=15, mu_range=(0.1, 0.4), ratio=2)
    friction, solver = Friction(scene.mu, scene.p), CondensedNewton()
    operator = _kernel.CondensedOperator(scene.W, 3)
    kappa = 1 / np.diag(scene.W)[2::3]
    plain = solver.solve_condensed(operator, friction, scene.q, 1e-6)
    given = solver.solve_condensed(operator, friction, scene.q, 1e-6, stiffness=kappa)
    assert given.error == pytest.approx(plain.error, rel=1e-6)
    start = [plain.reaction.ravel()]  # accepted as it is: the same answer, another scale
    same = solver.solve_condensed(operator, friction, scene.q, 1e-6, start)
    size = np.linalg.norm(same.reaction)
    relative = solver.solve_condensed(operator, friction, scene.q, 1e-6, start, external=1e3 * size)
    assert np.array_equal(relative.reaction, same.reaction)
    assert relative.error == pytest.approx(same.error / 1e3, rel=1e-9)
    blocks = np.tile(np.diag([2.0, 3.0]), (5, 1, 1))
    one = solver.solve_condensed(operator, friction, scene.q, 1e-6, tangential_stiffness=blocks)
    two = solver.solve_condensed(operator, friction, scene.q, 1e-6, tangential_stiffness=7 * blocks)
    assert np.array_equal(one.reaction, two.reaction)
    assert two.slip_error == pytest.approx(7 * one.slip_error, rel=1e-9)


@pytest.mark.parametrize(
    "scales, message",
    [
        (dict(stiffness=[1.0, -1.0]), "stiffness must be positive"),
        (dict(stiffness=[1.0, 0.0]), "stiffness must be positive"),
        (dict(stiffness=[1.0, np.nan]), "stiffness must be positive"),
        (dict(stiffness=[1.0]), "2 entries"),
        (dict(tangential_stiffness=-np.ones((2, 2, 2))), "tangential_stiffness"),
        (dict(tangential_stiffness=np.ones(3)), "8 entries"),
        (dict(tied_stiffness=[1.0]), "tied_stiffness must have 0"),
        (dict(external=-1.0), "external"),
        (dict(external=np.inf), "external"),
    ],
)
def test_scales_that_make_no_sense(scales, message):
    """A stiffness that is none would let any penetration pass: a ValueError."""
    operator = _kernel.CondensedOperator(np.eye(6), 3)
    with pytest.raises(ValueError, match=message):
        CondensedNewton().solve_condensed(operator, Friction(0.3), -np.ones((2, 3)), TOL, **scales)


def test_change_is_what_is_missing():
    """At tol 1e-6 `change` is the distance to the tight solution nearby, within 5 % or 1e-4 of tol."""
    compared = 0
    for seed in range(60):
        scene = random_problem(seed, contacts=6, rank=18, mu_range=(0.05, 0.4), ratio=2)
        law = Friction(scene.mu, scene.p)
        operator = _kernel.CondensedOperator(
            scene.W, scene.q.shape[1]
        )  # the public function goes on
        loose = CondensedNewton().solve_condensed(operator, law, scene.q, 1e-6)
        tight = solved(scene.W, scene.q, law, tol=1e-13, r0=loose.reaction)
        distance = np.linalg.norm(loose.reaction - tight.reaction)
        if distance > 1e-9 * np.linalg.norm(tight.reaction):
            compared += 1
            expected = distance / np.linalg.norm(tight.reaction)
            assert loose.change == pytest.approx(expected, rel=0.05, abs=1e-4 * 1e-6)
    assert compared >= 20


@pytest.mark.parametrize(
    "W,q", [(-310, -310), (-300, 0), (300, 1), (308, 308), (0, -300), (0, 300)]
)
def test_numbers_near_the_ends_of_double_precision(W, q):
    """A block that slides, W = 10^W I and q = 10^q (1, 0, -1): r = 10^(q - W) (-mu, 0, 1), and errors that are numbers."""
    load = float(f"1e{q}") * np.array([[1.0, 0.0, -1.0]])
    found = solved(float(f"1e{W}") * np.eye(3), load, Friction((0.3, 0.2), (0.1, 0.2)))
    expected = 10.0 ** (q - W) * np.array([[-0.3, 0.0, 1.0]])
    assert np.abs(found.reaction - expected).max() <= 1e-8 * 10.0 ** (q - W)
    assert np.isfinite([found.error, found.slip_error, found.rounding]).all()
    assert max(found.error, found.slip_error) <= TOL


def test_powers_of_two_change_nothing():
    """The same problem in units that are powers of two apart, up to 2^900: the same reactions to the last bit."""
    scene = random_problem(3, contacts=70, rank=210, mu_range=(0.1, 0.6), ratio=2.0)
    law = Friction(scene.mu, scene.p)
    found = solved(scene.W, scene.q, law)
    for length, force in ((900, 0), (-900, 50), (20, 900), (0, -900)):
        W, q = np.ldexp(scene.W, length - force), np.ldexp(scene.q, length)
        assert np.array_equal(np.ldexp(solved(W, q, law).reaction, -force), found.reaction)


@pytest.mark.parametrize("W,q", [(1e-200, 1e150), (1e200, 1e-200)])
def test_reactions_that_double_precision_does_not_have(W, q):
    """Reactions of 1e350 or 1e-400 are refused with the remedy, neither infinite nor zero."""
    with pytest.raises(ValueError, match="other units"):
        solved(W * np.eye(3), [[q, 0, -q]], Friction(0.3))


def apart(seed, W, q):
    """Two problems of four contacts that know nothing of each other, the second W times as soft under q times the load."""
    rng, n = np.random.default_rng(seed), 12
    first, second = rng.normal(size=(2, n, n))
    blocks = [B @ B.T / n + 0.1 * np.eye(n) for B in (first, second)]
    loads = rng.normal(size=(2, 4, 3)) - [0, 0, 1]
    whole = np.zeros((2 * n, 2 * n))
    whole[:n, :n], whole[n:, n:] = blocks[0], W * blocks[1]
    return whole, np.vstack((loads[0], q * loads[1])), blocks, loads


@pytest.mark.parametrize("W,q", [(1e6, 1.0), (1e9, 1.0), (1e12, 1.0), (1e-9, 1.0), (1.0, 1e-6)])
def test_contacts_far_apart(W, q):
    """Compliances up to 1e12 apart, loads a million: the reactions of each part are those of that part alone."""
    law = Friction((0.5, 0.3), (0.2, 0.4))
    for seed in range(5):
        whole, load, blocks, loads = apart(seed, W, q)
        found = solved(whole, load, law)
        parts = found.reaction[:4], found.reaction[4:] * (W / q)
        for part, block, own in zip(parts, blocks, loads):
            alone = solved(block, own, law, tol=1e-12).reaction
            assert np.linalg.norm(part - alone) <= 1e-6 * np.linalg.norm(alone)
        assert found.local_error <= TOL


def test_contacts_far_apart_that_are_not_solved():
    """Compliances 1e9 apart and friction of 5: each contact obeys the law to half the digits of tol, or a warning says by how much one does not."""
    warned = dict.fromkeys((True, False), 0)
    for seed in (11, 12, 14, 20, 22, 27):
        parts = [random_problem(seed + k, 10, rank=30, mu_range=(5, 5), ratio=1) for k in (0, 100)]
        W, q = np.zeros((60, 60)), np.vstack([part.q for part in parts])
        W[:30, :30], W[30:, 30:] = parts[0].W, 1e-9 * parts[1].W
        for fallbacks, of in warned.items():
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                found = solve_condensed(W, q, 5.0, solver=CondensedNewton(fallbacks=fallbacks))
            assert max(found.error, found.slip_error) <= TOL
            said = any("local_error" in str(warning.message) for warning in caught)
            assert said == (found.local_error > np.sqrt(TOL))
            warned[fallbacks] = of + said
    assert warned[True] < warned[False]


def test_the_error_of_one_contact():
    """Of two blocks the one that bears a millionth is off by 9 %: no error sees it but that of one contact.

    The start is a hundredth above the reaction, from where Newton's residual maps it to 0.91 of it.
    """
    operator = _kernel.CondensedOperator(np.eye(6), 3)
    q = np.array([0, 0, -1.0, 0, 0, -1e-6])
    arguments = dict(mu=np.full(2, 0.3), p=np.ones(2), q=q, tol=1e-3, slip_tol=1e-3)
    state = operator.solve(
        starts=[-q * [1, 1, 1, 1, 1, 1.01]], newton_iterations=1, max_iterations=1, **arguments
    )
    assert state.error <= 1e-6 and state.local_error == pytest.approx(0.09 / 0.91, rel=1e-6)


@pytest.mark.parametrize("unit", [1e2, 1e4, 1e5, 1e7, 1e9])
def test_contacts_in_units_of_their_own(unit):
    """Coupled contacts whose units differ: their reactions are those in one unit, or it is refused, where compliances are so far apart that the smallest cannot be told from none."""
    for seed in (1, 96, 105):
        rng = np.random.default_rng(seed)
        units, A = np.repeat([1 / unit, 1.0, unit], 3), rng.standard_normal((9, 9))
        W, q = A @ A.T / 9 + 0.2 * np.eye(9), rng.standard_normal((3, 3)) - (0, 0, 0.5)
        law = Friction(np.repeat(10 ** rng.uniform(-1.5, 0, (3, 1)), 2, 1), 10 ** rng.uniform(-1.5, 0, (3, 2)))  # fmt: skip
        whole, load = units[:, None] * W * units, q * units.reshape(3, 3)
        if unit >= 1e4:
            with pytest.raises(
                ValueError, match="normal diagonal entry .* at contact 0, less than"
            ):
                solve_condensed(whole, load, law)
            continue
        alone = solve_condensed(W, q, law, tol=1e-12).reaction / units.reshape(3, 3)
        found = solve_condensed(whole, load, law, tol=1e-12).reaction
        off = np.linalg.norm(found - alone, axis=1) / np.maximum(np.linalg.norm(alone, axis=1), 1e-300)  # fmt: skip
        assert off.max() <= 1e-6
