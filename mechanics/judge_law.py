# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The law of contact and friction at nodes, as the judge (judge.py) reads it: defects that are forces."""

from __future__ import annotations

import numpy as np


def norm(values) -> float:
    """Euclidean, without under- or overflow of squares."""
    values = np.abs(np.asarray(values, dtype=float)).ravel()
    largest = float(values.max(initial=0.0))
    return largest * float(np.linalg.norm(values / largest)) if 0 < largest < np.inf else largest


def against(r_t, p):
    """Unit vectors along P^-2 r_t, against which nodes slip; zero without a tangential force."""
    d = r_t / (p / np.max(p)) ** 2
    largest = np.abs(d).max(axis=1, keepdims=True)
    d = d / np.where(largest > 0, largest, 1)  # of order one, so that no square under- or overflows
    length = np.sqrt((d**2).sum(axis=1, keepdims=True))
    return d / np.where(length > 0, length, 1)


def law_defects(r, gap, slip, k_n, K_t, mu, p):
    """Defects of Signorini's conditions, of the cone and of the slip rule, each ``shape=(n,)``, forces.

    - normal: ``|min(r_n, k_n gap)|``, zero where a pushing force at a closed gap or a gap without a force is.
    - cone: the smaller of the changes of r_t or r_n that bring the force into the cone.
    - slip: the least of three ways to obey the rule: to stick (``|K_t du|``); to be on the edge of the cone and slip along
      ``-P^-2 r_t`` as far as the node does; to carry no force.
    """
    r_t, r_n, zero = r[:, :-1], r[:, -1], np.zeros(len(r))
    normal = np.abs(np.minimum(r_n, k_n * gap))
    tangential = np.linalg.norm(r_t, axis=1)
    if not np.any(mu):
        return normal, tangential, zero
    length, push = np.linalg.norm(r_t / mu, axis=1), np.maximum(r_n, 0)
    some = np.where(length > 0, length, 1)
    short = np.minimum(np.abs(length - push), tangential * np.abs(1 - push / some))
    cone = np.where(length > push, short, 0)
    slack = np.where(length > push, 0, np.where(length > 0, short, np.min(mu) * push))

    def force(du):
        return np.linalg.norm(np.einsum("nij,nj->ni", K_t, du), axis=1)

    opposite = slip + np.linalg.norm(slip, axis=1)[:, None] * against(r_t, p)
    ways = (force(slip), np.maximum(force(opposite), slack), np.linalg.norm(r, axis=1))
    return normal, cone, np.where(push > 0, np.min(ways, axis=0), 0)
