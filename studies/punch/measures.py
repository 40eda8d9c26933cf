# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Measures of a run: stick zones, reverse slip, plateaus, force-slip curves, work of friction."""

from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from studies.punch.contact_map import STICK
from studies.punch.run import Run

RIM = 0.75  # of the radius: beyond it a node is called peripheral
STILL = 0.02  # a plateau: slip increments below this part of the largest one of the cycle


class Zones(NamedTuple):
    """Stick zones after a step: pieces of the disc that are connected along the mesh's edges."""

    count: int
    fraction: float  # of the disc's area
    central: bool  # the centre sticks
    peripheral: float  # part of the peripheral area that sticks
    inner: float  # radius of the innermost node that slips inwards, over R; nan if there is none


def zones(run: Run, step: int) -> Zones:
    """Stick zones and reverse slip after a step."""
    disc, area = run.disc(step), run.area
    stick, radius = disc.status == STICK, np.linalg.norm(disc.x, axis=1) / run.parameters.radius
    a, b = disc.faces.ravel(), np.roll(disc.faces, -1, axis=1).ravel()
    both = stick[a] & stick[b]
    graph = coo_matrix((np.ones(both.sum()), (a[both], b[both])), shape=(len(stick),) * 2)
    _, label = connected_components(graph, directed=False)
    rim, reverse = radius > RIM, disc.inward()
    return Zones(
        count=len(np.unique(label[stick])),
        fraction=area[stick].sum() / area.sum(),
        central=bool(stick[radius.argmin()]),
        peripheral=area[stick & rim].sum() / area[rim].sum(),
        inner=radius[reverse].min() if reverse.any() else np.nan,
    )


def tracked(run: Run, quantity: str, node: int = 0) -> np.ndarray:
    """Both tangential components at a tracked node from the start on, ``shape=(2, steps + 1)``."""
    return np.c_[[0.0, 0.0], [run.table[f"node{node}_{quantity}_{t}"] for t in ("t1", "t2")]]


def slip_of_point(run: Run, node: int = 0) -> np.ndarray:
    """|u_t| of a tracked node relative to the plane, from the start on, mm, ``shape=(steps + 1,)``."""
    return np.hypot(*tracked(run, "displacement", node))


def force(run: Run) -> np.ndarray:
    """Normal force on the punch from the start on, N, ``shape=(steps + 1,)``."""
    return np.r_[0.0, run.table["contact0_force_z"]]


def nonlinearity(run: Run, first: int, last: int) -> float:
    """Largest distance in slip of the force-slip curve of P from its chord, over its range of slip."""
    F, s = force(run)[first : last + 1], slip_of_point(run)[first : last + 1]
    chord = s[0] + (s[-1] - s[0]) * (F - F[0]) / (F[-1] - F[0])
    return float(np.abs(s - chord).max() / (np.ptp(s) or 1.0))


def hysteresis(run: Run, cycle: int) -> float:
    """Largest difference in slip of P between loading and unloading at equal force, over the range."""
    start, top, end = run.unloaded(cycle - 1), run.loaded(cycle), run.unloaded(cycle)
    F, s = force(run), slip_of_point(run)
    up, down = slice(start, top + 1), slice(end, top - 1, -1)  # force increasing in both
    at = np.linspace(max(F[start], F[end]), F[top], 101)
    difference = np.interp(at, F[up], s[up]) - np.interp(at, F[down], s[down])
    return float(np.abs(difference).max() / (np.ptp(s[start : end + 1]) or 1.0))


def plateau(run: Run, cycle: int) -> tuple[float, float]:
    """Parts of loading and unloading, next to the peak, in which P is still."""
    start, top, end = run.unloaded(cycle - 1), run.loaded(cycle), run.unloaded(cycle)
    moved = np.linalg.norm(np.diff(tracked(run, "displacement")), axis=0)[start:end]
    still = moved < STILL * moved.max()
    before, after = still[: top - start][::-1], still[top - start :]
    return tuple(float(np.argmin(np.r_[s, False])) / len(s) for s in (before, after))


def total(run: Run, cycle: int) -> float:
    """Dissipation of one cycle, N mm."""
    return float((run.dissipation(cycle) - run.dissipation(cycle - 1)).sum())
