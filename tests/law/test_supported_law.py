# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The law at nodes whose slip supports prescribe: it is the law for all components, and its derivatives are exact."""

import numpy as np
import pytest

import dolfinx_contact as dc
from dolfinx_contact.law.supported import supported

LAWS = {
    "isotropic": dict(mu=0.3),
    "associated": dict(mu=(0.4, 0.1)),
    "not associated": dict(mu=(0.3, 0.2), p=(0.2, 0.25)),
    "along axes": dict(mu=(0.4, 0.1), p=(0.1, 0.4), axes=True),
    "far apart": dict(mu=(1e-3, 10.0), axes=True),
}
N, SIZES = 60, (1.0, 1e-9, 1e7)


def draw(seed, T, law, along=True):
    """Random nodes: guided ones, held ones and, without ``along``, held ones alone; predictors of all sizes."""
    rng = np.random.default_rng(seed)
    sizes = 10.0 ** rng.uniform(-3, 3, (N, 1))
    reaction, slip = (sizes * rng.standard_normal((N, k)) for k in (T + 1, T))
    reaction[::7, -1] = 0.0
    known = 10.0 ** rng.uniform(-9, 1, (N, 1)) * rng.standard_normal((N, T))
    angle = rng.uniform(0, 2 * np.pi, N)
    f = np.column_stack((np.cos(angle), np.sin(angle)))[:, :T] * along
    f[::5] = 0.0
    f[1::10, :] = np.eye(2)[0, :T] * along if T == 2 else 0.0
    if T == 1:
        f[:] = 0.0
    known -= (known * f).sum(axis=1, keepdims=True) * f
    known[2::4] = 0.0
    free = (slip * f).sum(axis=1, keepdims=True) * f
    given = dict(law)
    if given.pop("axes", False):
        turned = rng.uniform(0, 2 * np.pi, N)
        given["axes"] = np.column_stack((np.cos(turned), np.sin(turned)))
    friction = dc.Friction(**given)
    last = friction.law(T + 1).project(
        np.column_stack((reaction[::-1, :-1], np.abs(reaction[:, -1])))
    )[0]
    gap, rho = sizes[:, 0] * rng.standard_normal(N), 10.0 ** rng.uniform(-1, 1, (2, N))
    return friction, f, known, last, reaction, gap, free + known, rho


def made(T, friction, f, known, last):
    return supported(friction.law(T + 1), friction, np.arange(N), f, known, last[:, :-1])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("T", [1, 2])
def test_what_is_found_is_the_law_of_all_components(law, seed, T):
    """At a fixed point of the predictor the bi-potential's gap is zero, and the part that the body balances is the predictor."""
    if T == 1 and law != "isotropic":
        return
    friction, f, known, last, reaction, gap, slip, rho = draw(seed, T, LAWS[law])
    r, status, by_r, by_w = made(T, friction, f, known, last).return_jacobian(
        reaction, gap, slip, *rho
    )
    assert (r[:, -1] == np.maximum(reaction[:, -1] - rho[0] * gap, 0.0)).all()
    # What the map leaves of the predictor is slip along f: with it the node obeys the law.
    along = (f * (r[:, :-1] - reaction[:, :-1] + rho[1][:, None] * slip)).sum(axis=1)
    slipped = known + f * (along / rho[1])[:, None]
    work = friction.law(T + 1).bipotential_gap(r, np.zeros(N), slipped)
    scale = r[:, -1] * np.linalg.norm(slipped, axis=1) + np.linalg.norm(
        r[:, :-1], axis=1
    ) * np.linalg.norm(slip, axis=1)
    condition = friction.mu.max() / friction.mu.min()  # of directions in the metric of the cone
    assert (work <= 1e-12 * condition * scale).all()
    moved = (known.any(axis=1)) & (r[:, -1] > 0.0)
    assert (status[moved] == dc.Status.SLIP).all()
    assert (status[~known.any(axis=1) & ~f.any(axis=1) & (r[:, -1] > 0)] != dc.Status.SLIP).all()


@pytest.mark.parametrize("law", [name for name in LAWS if name != "far apart"])
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_along_what_is_free_are_those_of_differences(law, seed):
    """By the part along f and by the normal one.  Where friction of the last step is kept across f, what it makes there is left out."""
    friction, f, known, last, reaction, gap, slip, rho = draw(seed, 2, LAWS[law])
    last[::2] = 0.0
    known *= 1e6 ** (
        np.abs(known).max(axis=1, keepdims=True) < 1e-3
    )  # corners sharper than differences
    slip = known + (slip * f).sum(axis=1, keepdims=True) * f
    map = made(2, friction, f, known, last)
    r, _, by_r, by_w = map.return_jacobian(reaction, gap, slip, *rho)
    free = np.concatenate((f[:, None, :] * f[:, :, None], np.zeros((N, 2, 1))), axis=2)
    free = np.concatenate((free, np.tile([[[0.0, 0.0, 1.0]]], (N, 1, 1))), axis=1)
    for k, way in enumerate(np.random.default_rng(seed).standard_normal((4, N, 3))):
        way = np.einsum("nij,nj->ni", free, way)
        step = 1e-6 * np.linalg.norm(reaction, axis=1, keepdims=True) + 1e-9
        ends = []
        for sign in (1, -1):
            if k < 2:
                ends.append(map.return_map(reaction + sign * step * way, gap, slip, *rho))
            else:
                move = sign * step / rho[1][:, None] * way
                ends.append(map.return_map(reaction, gap + move[:, -1], slip + move[:, :-1], *rho))
        change = (ends[0][0] - ends[1][0]) / (2 * step)
        if k < 2:
            exact = np.einsum("nij,nj->ni", by_r, way)
        else:
            exact = np.einsum("nij,nj->ni", by_w, way) / rho[1][:, None]
        for of in (change, exact):
            of[1::2] = np.einsum("nij,nj->ni", free, of)[1::2]
        same = (ends[0][1] == ends[1][1]) & (np.abs(reaction[:, -1] - rho[0] * gap) > 1e-3)
        error = np.abs(change - exact).max(axis=1)
        assert same.sum() > N // 2 and np.median(error[same]) < 1e-7
        assert np.sort(error[same])[int(0.9 * same.sum())] < 1e-4


def test_friction_is_kept_where_nothing_moves():
    """Last friction stays where the cone has room for it, is scaled where it has less, and is gone without pressure."""
    friction, last = dc.Friction((0.4, 0.2)), np.tile([0.2, 0.1, 1.0], (3, 1))
    still = np.zeros((3, 2))
    law = supported(friction.law(3), friction, np.arange(3), still, still, last[:, :-1])
    asked = np.zeros((3, 3))
    asked[:, -1] = 2.0, 0.5, -1.0
    r, status = law.return_map(asked, np.zeros(3), still, np.ones(3), np.ones(3))
    scale = 0.5 / np.hypot(0.5, 0.5)
    assert np.allclose(r, [[0.2, 0.1, 2.0], [0.2 * scale, 0.1 * scale, 0.5], [0, 0, 0]], atol=1e-15)
    assert status.tolist() == [dc.Status.STICK, dc.Status.STICK, dc.Status.OPEN]


def test_nothing_is_replaced_where_nothing_moves():
    """Planes of symmetry along a principal direction, and isotropic friction along any, keep the kernel's law itself."""
    rng, zero = np.random.default_rng(3), np.zeros((N, 2))
    angle = rng.uniform(0, 2 * np.pi, N)
    oblique, straight = np.column_stack((np.cos(angle), np.sin(angle))), np.tile([0.0, 1.0], (N, 1))
    for friction, f in ((dc.Friction(0.3), oblique), (dc.Friction((0.4, 0.1)), straight)):
        law, along = friction.law(3), f * rng.standard_normal((N, 1))
        assert supported(law, friction, np.arange(N), f, zero, along) is law
