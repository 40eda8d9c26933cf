# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A load history in increments that are halved if a step fails, and grow again."""

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

# Steps in a row after which an increment is doubled again; twice as many each time that the doubled one fails at once.
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

    The increment from one point to the next is first tried as a whole.  If a step does not converge, it is repeated with half the
    increment, from the last converged state.  After two converged steps, increments are doubled again; if the doubled one fails, only after
    four, then eight.  Every point is the end of a step.  ``logging.getLogger("dolfinx_contact")`` reports halved increments; on a terminal there is a progress bar if tqdm is installed.

    Args:
        problem: The ContactProblem.  Collective.
        load_history: Function of a parameter, such as time, that sets loads, boundary values and planes.
        points: Increasing values of the parameter.
        start: Value of the parameter in the problem's present state.
        smallest: Smallest increment, relative to the distance of its two points.
        history: ``History`` that records every step, with the column ``t``; None makes one.
        monitor: None, or a function of parameter and record, called after every step.

    Returns:
        The ``History``.

    Raises:
        NotConverged: a step with the smallest increment did not converge; problem and table are at the last converged step.
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
            _in_increments(problem, load_history, now, end, smallest, accepted)
    return history


def _checked(
    comm: MPI.Comm, load_history: object, points: Any, start: Any, smallest: Any, monitor: object
) -> tuple[list, float, float]:
    """Points, start and smallest increment as numbers, the same on all ranks.  Collective."""
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


def _in_increments(
    problem: ContactProblem,
    load_history: Callable,
    now: float,
    end: float,
    smallest: float,
    accepted: Callable,
) -> None:
    """Steps from ``now`` to ``end``; parameter and record of each are ``accepted``."""
    whole, begun = end - now, now
    # Increments are the whole over ``parts``, of which so many are done.
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
