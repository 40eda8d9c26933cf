# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Load steps with adaptive increments: halved if a step does not converge, later doubled again."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.results.history import History
from dolfinx_contact.results.record import NotConverged, Step
from dolfinx_contact.support.checks import a_problem, finite, number, positive
from dolfinx_contact.support.collective import agree, raised_together
from dolfinx_contact.support.progress import progress_bar

if TYPE_CHECKING:
    from mpi4py import MPI

    from dolfinx_contact.problem import ContactProblem

logger = logging.getLogger("dolfinx_contact")

# Number of consecutive converged steps after which the increment is doubled.  If the first step
# with the doubled increment does not converge, this number is doubled for the current interval.
EASY_STEPS = 2


def advance(
    problem: ContactProblem,
    load_history: Callable[[float], object],
    points: Sequence[float],
    *,
    start: float = 0.0,
    smallest: float = 1 / 64,
    history: History | None = None,
    monitor: Callable[[float, Step], object] | None = None,
) -> History:
    """Solve the load steps of a load history, from ``start`` through all ``points``.

    The first increment covers the whole interval between two points.  If a step does not converge,
    it is repeated from the last converged state with half the increment.  After two consecutive
    converged steps, the increment is doubled again.  If the doubled increment fails at once, the
    next doubling takes place only after four converged steps, then eight.  Every point is the end
    of a step.  ``logging.getLogger("dolfinx_contact")`` reports halved increments.  On a terminal,
    a progress bar is shown if tqdm is installed.

    Args:
        problem: The ContactProblem.  Collective.
        load_history: Function of a load parameter, such as time.  It sets the loads, boundary
            values and positions of rigid surfaces.
        points: Increasing values of the load parameter.
        start: Value of the load parameter in the present state of the problem.
        smallest: Smallest increment, relative to the interval between two points.
        history: ``History`` that records every step; the load parameter is its column ``t``.  If
            None, a new ``History`` is created.
        monitor: None, or a function of the load parameter and the ``Step``, called after every
            converged step.

    Returns:
        The ``History`` with one row for each converged step.

    Raises:
        NotConverged: a step with the smallest increment did not converge.  The problem and the
            history keep the last converged step.
        ValueError: ``points`` do not increase.

    Example:
        >>> def load_history(t): held.value = (0, 0, -0.01 * t)
        >>> table = dc.advance(problem, load_history, points=[0.5, 1.0])
    """
    comm = a_problem(problem).body.comm
    ends, start, smallest = _checked(comm, load_history, points, start, smallest, monitor)
    history = History(problem) if history is None else history
    now = start

    def accepted(at: float, step: Step) -> None:
        nonlocal now
        history.record(step, t=at)
        if monitor is not None:
            with raised_together(comm):
                monitor(at, step)
        shown(at)
        now = at

    with progress_bar(comm.rank, ends[-1], start) as shown:
        for end in ends:
            _solve_in_increments(problem, load_history, now, end, smallest, accepted)
    return history


def _checked(
    comm: MPI.Comm, load_history: object, points: Any, start: Any, smallest: Any, monitor: object
) -> tuple[list, float, float]:
    """Return points, start and smallest increment as checked numbers.  Collective.

    Raises:
        ValueError: an argument of ``advance`` is invalid or differs between ranks.
    """
    with raised_together(comm):
        start, ends = number("start", start), np.atleast_1d(finite("points", points))
        if ends.ndim != 1 or ends.size == 0 or not (np.diff(ends, prepend=start) > 0).all():
            raise ValueError(f"points must rise from start = {start!r}, got {points!r}.")
        smallest = positive("smallest", smallest, finite=True)
        if not callable(load_history):
            raise ValueError(
                f"load_history must be a function of one number, got {load_history!r}."
            )
        if not (monitor is None or callable(monitor)):
            raise ValueError(
                f"monitor must be a function of parameter and record, got {monitor!r}."
            )
    agree(comm, points=ends.tolist(), start=start, smallest=smallest)
    return ends.tolist(), start, smallest


def _solve_in_increments(
    problem: ContactProblem,
    load_history: Callable,
    now: float,
    end: float,
    smallest: float,
    accepted: Callable,
) -> None:
    """Solve the load steps from ``now`` to ``end``, halving increments that do not converge.

    Args:
        problem: The ContactProblem.  Collective.
        load_history: Function of the load parameter that sets the loads.
        now: Value of the load parameter in the last converged state.
        end: Value of the load parameter at the end of the last step.
        smallest: Smallest increment, relative to ``end - now``.
        accepted: Function of load parameter and ``Step``, called after every converged step.

    Raises:
        NotConverged: a step with the smallest increment did not converge.
    """
    whole, begun = end - now, now
    # The interval is divided into ``parts`` equal increments, of which ``done`` have converged.
    parts, done, easy, wait, grown = 1, 0, 0, EASY_STEPS, False
    while done < parts:
        at = end if done + 1 == parts else begun + whole * ((done + 1) / parts)
        with raised_together(problem.body.comm):
            load_history(at)
        try:
            step = problem.solve()
        except NotConverged as failure:
            if 0.5 / parts < smallest:
                raise
            parts, done, easy, wait, grown = 2 * parts, 2 * done, 0, wait * (1 + grown), False
            if problem.body.comm.rank == 0:
                logger.info(f"increments halved to {whole / parts:.3g} at {now:.6g}: {failure}")
            continue
        now, done, easy, grown = at, done + 1, easy + 1, False
        accepted(at, step)
        if easy >= wait and parts > 1 and done % 2 == 0:
            parts, done, easy, grown = parts // 2, done // 2, 0, True
