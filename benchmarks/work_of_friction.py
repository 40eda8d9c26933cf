# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Work of friction against the increments: the punch, and one node on a spring, around circles and corners; tables of docs/dissipation.md.

    python -m benchmarks.work_of_friction [increments ...]      (default 15 30 60 120 240 480; some minutes)

Four rules get the same states: the library's; `chord`, mean normal force times the work per way and force of the
chord; `mean`, mean force times slip (trapezoidal); `end`, force of the end of the step times slip.
"""

from __future__ import annotations

import sys
from itertools import product

import numpy as np
from scipy.optimize import brentq

import dolfinx_contact as dc
from dolfinx_contact.law.dissipation import work_of_friction
from studies.punch import CASES, Parameters, Punch, programme

RULES = ("library", "chord", "mean", "end")
CORNERS = (dict(mu=(0.3, 0.05)), dict(mu=(0.3, 0.05), p=(0.05, 0.3)))


def works(friction, before, slipped, reaction, slip) -> np.ndarray:
    """Work of a step by the four rules, summed over the nodes."""
    nothing = np.zeros(len(slip), dtype=bool)
    mean, end = (-(r[:, :2] * slip).sum() for r in (0.5 * (before + reaction), reaction))
    by = (
        work_of_friction(friction, before, s, reaction, slip)[0].sum() for s in (slipped, nothing)
    )
    return np.array([*by, mean, end])


def punch(case: str, increments: int):
    """First cycle of the paper's punch: works, work of the platen with mean forces, last state."""
    parameters = Parameters(case=case, loading=increments // 3, unloading=2 * increments // 3)
    body = Punch(parameters)
    contact, total, platen, depth, force = body.contact, np.zeros(4), 0.0, 0.0, 0.0
    for displacement in programme(parameters):
        before, slipped, kept = (
            contact.reaction,
            contact.status == dc.Status.SLIP,
            contact.slip_kept,
        )
        body.press(displacement)
        slip = kept + contact.slip_increment
        slip[contact.status == dc.Status.STICK] = 0.0
        total += works(contact.friction, before, slipped, contact.reaction, slip)
        last, force = force, contact.force()[2]
        platen += 0.5 * (last + force) * (displacement - depth)
        depth = displacement
    assert abs(total[0] / contact.dissipation.sum() - 1) < 1e-12
    return total, platen, contact.reaction


def node_on_a_spring(law: dict, path: np.ndarray, lag: float, start: int = 0) -> np.ndarray:
    """Works by the four rules from step ``start`` on; unit normal force, the spring's other end goes along ``path``.

    The spring yields by ``lag`` under the largest friction force. Backward Euler, step by step.
    """
    friction = dc.Friction(**law)
    mu, q = friction.mu, (friction.p.max() / friction.p) ** 2
    stiffness = mu.max() / lag
    force, slipped, total = np.zeros(2), False, np.zeros(4)
    for k, moved in enumerate(np.diff(path, axis=0)):
        trial, before = force + stiffness * moved, force

        def beyond(slip, trial=trial):
            return np.linalg.norm(trial / (1 + slip * q) / mu) - 1

        slip = brentq(beyond, 0, 1e6, xtol=1e-300, rtol=1e-15) if beyond(0) > 0 else 0.0
        force = trial / (1 + slip * q)
        if k >= start:
            old, new = (np.array([[*-f, 1.0]]) for f in (before, force))
            moved = (trial - force)[None] / stiffness
            total += works(friction, old, np.array([slipped]), new, moved)
        slipped = slip > 0
    return total


def circle(steps: int) -> np.ndarray:
    """1.5 times around the unit circle."""
    angle = 0.35 + 3 * np.pi * np.arange(steps + 1) / steps
    return np.column_stack((np.cos(angle), np.sin(angle)))


def corner(turn: float, steps: int) -> np.ndarray:
    """Five steps along the first axis, then a way of one in ``steps`` steps, turned by an angle."""
    first = np.column_stack((np.arange(6.0), np.zeros(6)))
    ways = np.linspace(0, 1, steps + 1)[1:, None]
    return np.concatenate((first, first[-1] + ways * [np.cos(turn), np.sin(turn)]))


def main(increments) -> None:
    print("case increments |", *RULES, "| platen, mean | change of the last reactions")
    for case in CASES:
        last = None
        for n in increments:
            total, platen, r = punch(case, n)
            change = np.nan if last is None else np.linalg.norm(r - last) / np.linalg.norm(r)
            sums = " ".join(f"{work:.2f}" for work in total)
            print(f"{case} {n} | {sums} | {platen:.2f} | {change:.1e}", flush=True)
            last = r
    print("case lag steps | error in % by", *RULES)
    for case, lag in product(CASES, (0.01, 0.1, 0.5)):
        half, whole = (node_on_a_spring(CASES[case], circle(n), lag)[0] for n in (5000, 10000))
        limit = 2 * whole - half  # the error is of first order
        for steps in (48, 96, 192, 384):
            errors = 100 * (node_on_a_spring(CASES[case], circle(steps), lag) / limit - 1)
            print(case, lag, steps, "|", *(f"{e:+.2f}" for e in errors), flush=True)
    print("law, lag, turn in degrees | one step after a corner over 1000 by", *RULES)
    for law, lag, turn in product(CORNERS, (0.001, 0.1, 0.5), (15, 30, 45, 75)):
        one, many = (node_on_a_spring(law, corner(np.radians(turn), n), lag, 5) for n in (1, 1000))
        print(law, lag, turn, "|", *(f"{ratio:.2f}" for ratio in one / many[1]), flush=True)


if __name__ == "__main__":
    main([int(n) for n in sys.argv[1:]] or [15, 30, 60, 120, 240, 480])
