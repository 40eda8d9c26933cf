# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch to an accuracy that is asked for: bricks of 27 nodes on a quarter of it, graded and curved, refined until two
differences are small.

The work of friction is that of a fine mesh with large increments, plus what smaller increments change on a coarse mesh, where
they cost little, and beyond them by extrapolation: the error of backward Euler falls with a power of the increment, the first or
the second (docs/dissipation.md).  Forces hardly depend on increments; they are those of the fine mesh.  What is estimated:

- mesh: the difference to the next coarser mesh with the same increments. That is the error of the coarser one, if the finer one is
  much better; of the finer one it is a guess on the safe side.
- increments: how far the extrapolated work moved when they were halved for the last time; of forces twice what halving them
  changes. That the mesh changes what increments change is not in it.

An estimate, no bound: measured against limits in notes/2026-11-22-accurate-punch.md.
"""

from dataclasses import dataclass, replace
from functools import partial

import dolfinx_contact as dc
from dolfinx_contact.petsc.linear_solver import DIRECT_OPTIONS
from studies.punch.contact_map import gather
from studies.punch.model import Parameters, Punch, programme

# isort: split
import numpy as np

DIVISIONS = (2, 4, 6, 8, 10)  # of the meshes, one after another
TRIAL = 1  # the place in them of the finest one on which increments are tried
SHARE = 0.7  # of the accuracy that is left to the increments
HALVINGS = 6  # of the increments, at most


@dataclass
class Found:
    """A run and what it is worth; errors over the work of friction and over the largest forces of the cycle."""

    punch: Punch
    records: list
    maps: list
    dissipation: float  # N mm
    increments: float = 0.0  # of it, what smaller increments would change; the steps do not have it
    dissipation_error: float = np.inf
    force_error: float = np.inf
    tried: tuple = ()  # of every run: divisions, increments, work of friction

    @property
    def error(self) -> float:
        return max(self.dissipation_error, self.force_error)


class NotAccurate(RuntimeError):
    """The finest mesh and smallest increments do not suffice; has the best run as ``found``."""

    def __init__(self, message: str, found: Found):
        super().__init__(message)
        self.found = found


def mesh_options(divisions: int) -> dict:
    """A mesh of second order: twice as many layers, cells at rim and plane as wide and high as the square of their number says."""
    return dict(divisions=divisions, layers=2 * divisions, order=2, rim=divisions**-2)


def accurate(parameters: Parameters, accuracy: float, shown=(), comm=None) -> Found:
    """Run the programme on finer and finer meshes, with smaller and smaller increments, until it is accurate.  Collective.

    Args:
        parameters: Of the punch; its increments are the largest that are tried. ``refine`` and ``lowest`` are not used.
        accuracy: Relative, of the work of friction and of forces.
        shown: Increments of the programme after which the disc is kept to be drawn, by name.

    Raises:
        NotAccurate: the estimate stayed above ``accuracy``.
    """
    if not 0 < accuracy < 1:
        raise ValueError(f"accuracy must be between 0 and 1, got {accuracy!r}.")
    runs: dict[tuple[int, int], Found] = {}
    punches: dict[int, Punch] = {}

    def at(level: int, halvings: int) -> Found:
        if (level, halvings) not in runs:
            if level not in punches:
                punches[level] = build(parameters, DIVISIONS[level], comm)
            runs[level, halvings] = run(punches[level], parameters, 2**halvings, shown)
        return runs[level, halvings]

    for level in range(1, len(DIVISIONS)):
        trial = min(level - 1, TRIAL)
        halvings, change, *increments = smaller_increments(partial(at, trial), accuracy)
        coarse, fine = at(level - 1, halvings), at(level, halvings)
        errors = [float(m + i) for m, i in zip(difference(fine, coarse), increments)]
        tried = tuple(
            (DIVISIONS[tried], 2**k, of.dissipation) for (tried, k), of in sorted(runs.items())
        )
        work = fine.dissipation + change
        found = Found(fine.punch, fine.records, fine.maps, work, change, *errors, tried)
        if found.error <= accuracy:
            return found
    raise NotAccurate(
        f"the estimated error is {found.error:.1e}, of the increments {max(increments):.1e}: more than {accuracy:g}, "
        "and the finest mesh is reached.",
        found,
    )


def smaller_increments(at, accuracy: float) -> tuple[int, float, float, float]:
    """How often increments are halved for the forces' sake, what smaller ones change of the work then, and the errors that are left.

    Args:
        at: Run with increments halved so many times.
        accuracy: Of work and forces, relative; increments may take SHARE of it.

    Returns:
        Halvings; change of the work, N mm; error of the work with it, and of the forces without, relative.
    """
    runs = [at(0), at(1)]
    while True:
        limit, moved = extrapolated([run.dissipation for run in runs])
        forces = [2 * difference(one, other)[1] for one, other in zip(runs, runs[1:])]
        enough = [k for k, error in enumerate(forces) if error <= SHARE * accuracy]
        error = moved / max(run.dissipation for run in runs)
        if (enough and error <= SHARE * accuracy) or len(runs) > HALVINGS:
            break
        runs.append(at(len(runs)))
    halvings = (enough or [len(forces) - 1])[0]
    return halvings, limit - runs[halvings].dissipation, error, forces[halvings]


def extrapolated(values: list) -> tuple[float, float]:
    """Limit of values (two or more) whose steps are halved, and how far it moved with the last one.

    Richardson's extrapolation; the order is that of the last three values, between 1 and 2, or 1 without a third.
    """
    (*_, before, last), moved = values, abs(values[-1] - values[-2])
    order = 1.0
    if len(values) > 2:
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.abs(np.divide(before - values[-3], last - before))
        order = float(np.clip(np.log2(ratio), 1, 2)) if ratio > 0 else 1.0
    limit = last + (last - before) / (2**order - 1)
    if len(values) > 2:
        moved = abs(limit - extrapolated(values[:-1])[0])
    return limit, moved


def build(parameters: Parameters, divisions: int, comm=None) -> Punch:
    """The punch on a mesh of so many divisions: a quarter of it, where the point P lies in that and the mesh can be divided."""
    lowest = parameters.height / (2 * divisions) ** 2
    given = {} if comm is None else {"comm": comm}
    # the compliance of the contact nodes takes thousands of solves: by a factorisation, on fine meshes, too
    given |= dict(solver=dc.CondensedNewton(), petsc_options=DIRECT_OPTIONS)
    quarter = min(parameters.target) >= 0 and divisions % 2 == 0
    parameters = replace(parameters, refine=0, lowest=lowest)
    return Punch(parameters, **given, **mesh_options(divisions), quarter=quarter)


def run(punch: Punch, parameters: Parameters, factor: int, shown=()) -> Found:
    """One run, with ``factor`` times as many increments, from the undeformed punch."""
    punch.restart(loading=factor * parameters.loading, unloading=factor * parameters.unloading)
    records, maps = [], []
    for index, displacement in enumerate(programme(punch.parameters), start=1):
        records.append(punch.press(displacement))
        name = dict(shown).get(index // factor - 1) if index % factor == 0 else None
        if name is not None:
            maps.append((f"{name}, {displacement:g} mm", gather(punch)))
    return Found(punch, records, maps, punch.dissipation())


def column(records: list, name: str, every: int) -> np.ndarray:
    """A value of every so many records, the last one among them."""
    return np.array([record[name] for record in records[every - 1 :: every]])


def difference(one: Found, other: Found) -> tuple[float, float]:
    """Relative differences of the work of friction, and of total normal and tangential forces at the steps of both.

    Forces over the largest of the cycle: after unloading friction has turned round, and its sum is small.
    """
    work = abs(one.dissipation - other.dissipation) / max(one.dissipation, other.dissipation)
    steps = min(len(one.records), len(other.records))
    forces = 0.0
    for name in ("normal_reaction", "tangential_reaction_sum"):
        a, b = (column(of.records, name, len(of.records) // steps) for of in (one, other))
        forces = max(forces, float(np.abs(a - b).max() / np.abs(a).max()))
    return work, forces
