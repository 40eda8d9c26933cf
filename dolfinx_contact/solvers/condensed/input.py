# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Checks of the input arrays of a condensed problem."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.law.friction import Friction, as_friction
from dolfinx_contact.support.checks import finite, free_memory

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from dolfinx_contact.contact.contact_step import ContactStep

# Compliance, relative to the mean one, that counts as zero; the same value as the kernel's
# Tuning::negligible.
NEGLIGIBLE_COMPLIANCE = 1e-14


def checked_problem(q: ArrayLike, W: Any, friction: Any, r0: Any) -> tuple:
    """Check the input of ``solve_condensed``; return ``q``, ``W``, a ``Friction`` and ``r0``.

    Returns:
        ``q``, ``shape=(n, dim)``; ``W``, ``shape=(dim n, dim n)``; the ``Friction``; and ``r0``, an
        array of the size of ``q`` or None.

    Raises:
        ValueError: an array has the wrong shape, is not real and finite, or does not fit the
            others.
    """
    q = finite("q", q)
    dim = q.shape[1] if q.ndim == 2 else 3
    if dim not in (2, 3) or q.ndim not in (1, 2) or q.size % dim:
        raise ValueError(f"q must have shape (n, 3), (n, 2) or (3n,), not {q.shape}.")
    if q.size == 0:
        raise ValueError(f"q is empty, of shape {q.shape}: there is no contact to solve for.")
    q = q.reshape(-1, dim)
    W = checked_compliance(W)
    if W.shape != (q.size, q.size):
        raise ValueError(
            f"W must have shape {(q.size, q.size)} for q of {len(q)} contacts, not {W.shape}."
        )
    if isinstance(friction, (np.ndarray, list, tuple)):
        mu = finite("friction", friction)
        if mu.shape != (len(q),):
            raise ValueError(
                f"friction as an array has one coefficient per contact, shape {(len(q),)}, not "
                f"{mu.shape}; those of two directions are a Friction((mu_1, mu_2))."
            )
        friction = Friction(np.column_stack((mu, mu)))
    friction = as_friction(friction)
    if not isinstance(friction, Friction):
        raise ValueError(f"friction must be a Friction, a number or an array, not {friction!r}.")
    if friction.field:
        raise ValueError(
            f"{friction!r}: give numbers for the contacts, there are no positions here."
        )
    for name, rows in (("coefficients", friction.mu), ("axes", friction.axes)):
        if rows is not None and rows.ndim == 2 and len(rows) != len(q):
            raise ValueError(f"friction has {name} for {len(rows)} contacts, q has {len(q)}.")
    friction.law(dim)  # refuses what has no meaning in two dimensions
    diagonal = W.diagonal()
    if (diagonal < 0).any():
        at = max(np.flatnonzero(diagonal < 0), key=lambda k: k % dim)  # a normal one, if there is
        direction = "normal" if at % dim == dim - 1 else "tangential"
        raise ValueError(
            f"W has a negative {direction} diagonal entry, {diagonal[at]:g} at contact {at // dim}: a contact must give "
            "way to its reaction."
        )
    own = diagonal[dim - 1 :: dim]
    stiff = np.flatnonzero((own > 0) & (own < NEGLIGIBLE_COMPLIANCE * own.mean()))
    if stiff.size:
        raise ValueError(
            f"W has the normal diagonal entry {own[stiff[0]]:g} at contact {stiff[0]}, less than {NEGLIGIBLE_COMPLIANCE:g} of their mean: so small a "
            "compliance cannot be told from none, beside the others. Set it to zero if the contact does not give way, or "
            "give contacts units of their own, in which all diagonal entries are about 1: the law does not depend on them."
        )
    if r0 is not None:
        r0 = finite("r0", r0)
        if r0.size != q.size:
            raise ValueError(f"r0 must have the shape of q, {q.shape}, not {r0.shape}.")
    return q, W, friction, r0


def checked_compliance(W: Any) -> np.ndarray:
    """Return ``W`` as a dense array, without a copy if possible.

    Raises:
        ValueError: ``W`` is not real and finite.
        MemoryError: a sparse ``W`` is too large for a dense array and its factors.
    """
    if not hasattr(W, "tocsc"):
        return finite("W", W, copy=False)
    needed, free = 8 * 5 * W.shape[0] * W.shape[1], free_memory()
    if needed > free:
        raise MemoryError(
            f"W is solved as a dense matrix, which takes about {needed / 1e9:.1f} GB with its factors, {free / 1e9:.1f} GB "
            "are free: piles of thousands of rigid contacts need a solver that is made for them, as Siconos is."
        )
    return finite("W", W.toarray(), copy=False)


def proved_infeasible(W: np.ndarray, q: np.ndarray, tol: float) -> bool:
    """Whether the condensed problem is proved infeasible: for all reactions, a gap is negative.

    This holds if there are pressures ``y >= 0`` with ``W^T y = 0`` and ``q . y < 0``: then
    ``y . w = q . y + (W^T y) . r < 0`` (Farkas' lemma).  They are computed by non-negative least
    squares [C. L. Lawson, R. J. Hanson, Solving Least Squares Problems (1974)].  Because ``W^T y``
    is zero only up to rounding, the proof covers reactions up to the largest ones that the kernel
    accepts in a solution.

    Args:
        W: Compliance, ``shape=(dim n, dim n)``, the normal component of a contact last.
        q: Displacement without reactions, ``shape=(n, dim)``.
        tol: Largest error of a solution, relative to the load.
    """
    from scipy.optimize import nnls  # a large module, needed only here

    dim, gaps, eps = q.shape[1], q[:, -1], np.finfo(float).eps
    columns = W[dim - 1 :: dim].T
    sizes = [float(np.abs(part).max()) or 1.0 for part in (columns, gaps)]
    system = np.vstack((columns / sizes[0], gaps / sizes[1]))
    try:
        y = nnls(system, -np.eye(len(system))[-1])[0]  # W^T y = 0 and q . y < 0
    except RuntimeError:  # too many iterations
        return False
    own = W.diagonal()[dim - 1 :: dim]
    own = np.maximum(own, NEGLIGIBLE_COMPLIANCE * own.mean() or 1.0)  # as in the kernel
    load = np.linalg.norm(np.column_stack((q[:, :-1], np.minimum(gaps, 0))) / own[:, None])
    moved = np.linalg.norm(columns @ y) + eps * np.linalg.norm(np.abs(columns) @ y)
    allowed = math.sqrt(tol) * load * (own @ y)  # the kernel accepts an error of tol
    return bool(-gaps @ y > moved * load / math.sqrt(eps) + allowed)


def joint_friction(
    laws: Sequence[Friction], contacts: Sequence[ContactStep], gather: Callable
) -> Friction:
    """Combine the friction of all contacts in one ``Friction`` with coefficients for each node.

    If all contacts have the same coefficients, the result is one uniform law.

    Args:
        laws: Friction of each contact.
        contacts: The contacts of the body.
        gather: Function that gathers nodal rows from all ranks.  Collective.
    """
    first = laws[0]
    uniform = first.mu.ndim == 1 and all(
        np.array_equal(f.mu, first.mu) and np.array_equal(f.p, first.p) for f in laws
    )
    if gather(np.array([uniform])).all():
        return Friction(first.mu, np.where(first.mu > 0, first.p, 1.0))
    sizes = [len(contact.nodes) for contact in contacts]
    mu, p = (
        gather(
            np.concatenate([np.broadcast_to(getattr(f, name), (n, 2)) for f, n in zip(laws, sizes)])
        )
        for name in ("mu", "p")
    )
    return Friction(mu, np.where(mu > 0, p, 1.0))
