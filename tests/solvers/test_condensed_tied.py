# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Tied rows of the condensed operator: bodies on springs however soft, or held by contact alone.

The body, K u = f + C' r, is anchored at some degrees of freedom E by artificial springs a, and the
unknown force s = a E' u undoes them: with K_a = K + a E E' it is u = K_a^-1 (f + C' r + E s) and
E' u - s / a = 0, the tied rows.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from dolfinx_contact import CondensedNewton, CondensedNotConverged, Friction, _kernel

TOL = 1e-10
SPRINGS = (1.0, 1e-3, 1e-6, 1e-9, 1e-12, 0.0)
EXTENDED = np.longdouble


def solve(A, b):
    """A^-1 b in long double, Gauss' elimination with pivots; b of any number of columns."""
    A, x = np.array(A, EXTENDED), np.array(b, EXTENDED)
    n = len(A)
    for k in range(n):
        pivot = k + np.argmax(np.abs(A[k:, k]))
        A[[k, pivot]], x[[k, pivot]] = A[[pivot, k]], x[[pivot, k]]
        factors = A[k + 1 :, k] / A[k, k]
        A[k + 1 :] -= np.multiply.outer(factors, A[k])
        x[k + 1 :] -= np.multiply.outer(factors, x[k])
    for k in reversed(range(n)):
        x[k] = (x[k] - A[k, k + 1 :] @ x[k + 1 :]) / A[k, k]
    return x


def body(seed, dim, spring, push=0.4, mu=0.3, nodes=8, contacts=4):
    """A random network of springs with nothing that holds it but ``spring`` at its last node.

    The first nodes may touch the plane; the others are pressed down and, by ``push`` of what friction
    could bear, pushed aside.
    """
    rng = np.random.default_rng(seed)
    laplacian = np.zeros((nodes, nodes))
    for i in range(nodes):
        for j in {(i + 1) % nodes, int(rng.integers(nodes))} - {i}:
            weight = 10 ** rng.uniform(-1, 1)
            laplacian[[i, j], [i, j]] += weight
            laplacian[[i, j], [j, i]] -= weight
    B = rng.normal(size=(dim, dim))
    K = np.kron(laplacian, np.eye(dim) + 0.2 * B @ B.T).astype(EXTENDED)
    size = dim * nodes
    held = np.arange(size - dim, size)
    K[held, held] += spring
    f = np.zeros((nodes, dim))
    f[contacts:, -1] = -rng.uniform(0.1, 1, size=nodes - contacts)
    if dim > 1:
        aside = rng.normal(size=dim - 1)
        total = push * mu * -f[:, -1].sum() / (nodes - contacts)
        f[contacts:, :-1] = total * aside / np.linalg.norm(aside)
    gap = rng.uniform(0, 0.05, size=contacts) * (rng.random(contacts) < 0.5)
    C = np.zeros((dim * contacts, size), EXTENDED)
    C[np.arange(dim * contacts), np.arange(dim * contacts)] = 1
    return SimpleNamespace(K=K, f=f.ravel(), gap=gap, C=C, dim=dim, contacts=contacts)


def condensed(scene, anchor=1.0):
    """W and q with a tied row for each degree of freedom of a node inside, which is anchored."""
    size, dim = len(scene.K), scene.dim
    E = np.zeros((size, dim), EXTENDED)
    E[np.arange(size - 2 * dim, size - dim), np.arange(dim)] = 1
    rows = np.vstack((scene.C, E.T))
    moved = solve(scene.K + anchor * E @ E.T, np.column_stack((rows.T, scene.f)))
    W, q = rows @ moved[:, :-1], rows @ moved[:, -1]
    tied = np.arange(len(W) - dim, len(W))
    W[tied, tied] -= 1 / EXTENDED(anchor)
    q[dim - 1 : dim * scene.contacts : dim] += scene.gap
    W = W.astype(float)
    return (W + W.T) / 2, q.astype(float)


def reference(scene, found, mu, p):
    """Newton's method in long double for (u, r) of the body itself, with the statuses that were found;
    asserts that they were right."""
    n, dim, size = scene.contacts, scene.dim, len(scene.K)
    r = found.reaction.astype(EXTENDED)
    gap = np.zeros((n, dim))
    gap[:, -1] = scene.gap
    touching = found.reaction[:, -1] > 1e-12 * found.reaction.max()  # others may graze: open, w = 0
    statuses = np.where(touching, found.status, 0)
    u = np.zeros(size, EXTENDED)
    for _ in range(8):
        w = (scene.C @ u).reshape(n, dim) + gap
        rows, by_w, by_r = [], [], []
        for status, ri, wi in zip(statuses, r, w):
            if status == 0:
                law, dw, dr = ri, np.zeros((dim, dim)), np.eye(dim)
            elif status == 1:
                law, dw, dr = wi, np.eye(dim), np.zeros((dim, dim))
            else:
                law, dw, dr = slipping(ri, wi, mu, p)
            rows.append(law)
            by_w.append(dw)
            by_r.append(dr)
        J = np.zeros((size + n * dim, size + n * dim), EXTENDED)
        J[:size, :size], J[:size, size:] = scene.K, -scene.C.T
        for i in range(n):
            at = slice(size + i * dim, size + (i + 1) * dim)
            J[at, :size], J[at, at] = by_w[i] @ scene.C[i * dim : (i + 1) * dim], by_r[i]
        rest = np.concatenate((scene.K @ u - scene.f - scene.C.T @ r.ravel(), *rows))
        step = solve(J, -rest)
        u, r = u + step[:size], r + step[size:].reshape(n, dim)
    assert np.abs(step[size:]).max() <= 1e-14 * np.abs(r).max()
    w = (scene.C @ u).reshape(n, dim) + gap
    for status, ri, wi in zip(statuses, r, w):
        scale = 1e-9 * np.abs(r).max()
        assert ri[-1] >= -scale if status else wi[-1] >= -scale
        if dim > 1 and status == 1:
            assert np.linalg.norm(ri[:-1] / mu) <= ri[-1] + scale
        if dim > 1 and status == 2:
            assert ri[:-1] @ wi[:-1] <= scale**2
    return r


def slipping(r, w, mu, p):
    """Gap zero, friction at its bound, slip along P^-2 r_t; with derivatives by w and r."""
    dim = len(r)
    law, by_w, by_r = (np.zeros(shape, EXTENDED) for shape in (dim, (dim, dim), (dim, dim)))
    law[-1], by_w[-1, -1] = w[-1], 1
    if dim == 1:
        return law, by_w, by_r
    bound = np.linalg.norm(r[:-1] / mu)
    law[0], by_r[0, :-1], by_r[0, -1] = bound - r[-1], r[:-1] / mu**2 / bound, -1
    if dim == 3:
        d = 1 / p**2
        law[1] = w[0] * d[1] * r[1] - w[1] * d[0] * r[0]
        by_w[1, :2] = d[1] * r[1], -d[0] * r[0]
        by_r[1, :2] = -w[1] * d[0], w[0] * d[1]
    return law, by_w, by_r


def run(scene, mu, p, **scales):
    W, q = condensed(scene)
    operator = _kernel.CondensedOperator(W, scene.dim, scene.dim)
    friction = Friction(mu, p) if np.any(mu) else Friction(0)
    return CondensedNewton().solve_condensed(operator, friction, q, TOL, **scales), operator


LAWS = {
    "frictionless chain": (1, 0.0, None),
    "in the plane": (2, 0.3, None),
    "isotropic": (3, 0.3, None),
    "non-associated": (3, (0.3, 0.2), (0.1, 0.2)),
}


@pytest.mark.parametrize("spring", SPRINGS)
@pytest.mark.parametrize("law", LAWS)
def test_reactions_are_those_of_the_body(law, spring):
    """Whatever holds the body, or nothing but contact: reactions within 100 tol of long double ones."""
    dim, mu, p = LAWS[law]
    for seed in range(6):
        scene = body(seed, dim, spring, mu=np.min(mu))
        found, _ = run(scene, mu, p)
        two = np.ones(2) if p is None else np.array(p)
        expected = reference(scene, found, np.broadcast_to(np.array(mu), max(dim - 1, 1)), two)
        assert np.abs(found.reaction - expected).max() <= 100 * TOL * np.abs(expected).max()
        assert max(found.error, found.slip_error) <= TOL


def test_tied_force_undoes_the_anchor():
    """With the reactions and the tied force the anchored body moves as the body itself: s = a E' u."""
    for spring in (1e-3, 1e-12):
        scene = body(3, 3, spring)
        found, _ = run(scene, 0.3, None)
        size = len(scene.K)
        u = solve(scene.K, scene.f + scene.C.T @ found.reaction.ravel().astype(EXTENDED))
        if spring == 1e-3:  # on a softer one rounding of the reactions moves the body far
            assert found.tied == pytest.approx(u[size - 6 : size - 3].astype(float), rel=1e-6)
        moved = (scene.C @ u).astype(float).reshape(-1, 3)
        moved[:, -1] += scene.gap
        rounding = 1e-12 * np.abs(found.reaction).max() / spring
        assert moved == pytest.approx(found.displacement, abs=rounding + 1e-9)


def test_inverse_changes_nothing():
    """A prepared operator, of an indefinite matrix, gives the same answers by the same method."""
    for seed in range(10):
        for law in ("in the plane", "non-associated", "frictionless chain"):
            dim, mu, p = LAWS[law]
            W, q = condensed(body(seed, dim, 1e-6, push=0.0 if dim == 1 else 0.9))
            friction = Friction(mu, p) if np.any(mu) else Friction(0)
            found = []
            for prepare in (False, True):
                operator = _kernel.CondensedOperator(W, dim, dim)
                assert not prepare or operator.prepare()
                found.append(CondensedNewton().solve_condensed(operator, friction, q, TOL))
            scale = np.abs(found[0].reaction).max()
            assert np.abs(found[0].reaction - found[1].reaction).max() <= 100 * TOL * scale


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_units(unit):
    """Lengths, forces or the anchor in other units change the answer by the unit and nothing else."""
    W, q = condensed(body(5, 3, 1e-9, push=0.9))

    def answer(W, q):
        operator = _kernel.CondensedOperator(W, 3, 3)
        return CondensedNewton().solve_condensed(operator, Friction(0.3), q, 1e-12)

    plain = answer(W, q)
    scale = np.abs(plain.reaction).max()
    assert np.abs(answer(W, unit * q).reaction / unit - plain.reaction).max() <= 1e-9 * scale
    assert np.abs(answer(W * unit, q).reaction * unit - plain.reaction).max() <= 1e-9 * scale
    anchor = np.ones(len(W))
    anchor[-3:] = unit  # the forces of tied rows in units of their own
    scaled = answer(W * np.outer(anchor, anchor), q * anchor)
    assert np.abs(scaled.reaction - plain.reaction).max() <= 1e-9 * scale


def test_starts_have_tied_rows():
    """Started at its own answer, tied forces at the end, a problem is solved by one look."""
    W, q = condensed(body(7, 3, 0.0))
    operator = _kernel.CondensedOperator(W, 3, 3)
    found = CondensedNewton().solve_condensed(operator, Friction(0.3), q, TOL)
    start = np.append(found.reaction.ravel(), found.tied)
    again = CondensedNewton().solve_condensed(operator, Friction(0.3), q, TOL, [start])
    assert found.iterations > 1 and again.iterations == 0


def test_nothing_holds_the_body():
    """Pulled off the plane with no spring at all there is no equilibrium: an exception."""
    scene = body(1, 3, 0.0)
    scene.f = -scene.f
    W, q = condensed(scene)
    W[-3:, -3:] = 0  # as it is in exact arithmetic
    operator = _kernel.CondensedOperator(W, 3, 3)
    with pytest.raises(CondensedNotConverged):
        CondensedNewton(max_seconds=5).solve_condensed(operator, Friction(0.3), q, TOL)


def test_shape():
    """Tied rows beside whole contacts, of a number that is none of them: a ValueError."""
    for size, dim, tied in ((7, 3, 0), (7, 3, 2), (3, 3, 4), (4, 3, -2)):
        with pytest.raises(ValueError, match="rows per contact"):
            _kernel.CondensedOperator(np.eye(size), dim, tied)
