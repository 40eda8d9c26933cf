# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""What steps take for granted, checked after each of them until the user has been told: one class a check, imported where it applies."""

from __future__ import annotations

import logging
import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from dolfinx_contact.bodies.elastic import ElasticBody
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.interface import NodalStiffness
    from dolfinx_contact.results.record import Counts

# What is rounding, radians, or over the size of a body.
NEGLIGIBLE_PART = 1e-6

logger = logging.getLogger("dolfinx_contact")


class CheckedStep(NamedTuple):
    """The state that a step has ended in, as checks get it.

    Attributes:
        body: The body.
        contacts: All contacts, whose ``reaction``, ``gap`` and the like are those of the step.
        stiffness: Of their nodes.
        u: Displacement, degrees of freedom of this rank with those of ghosts.
        counts: Nodes of all contacts by status.
        over: Names of the classes of checks that are over: the user was told, or nothing is left to be looked at.
    """

    body: ElasticBody
    contacts: Sequence[Contact]
    stiffness: Sequence[NodalStiffness]
    u: np.ndarray
    counts: Counts
    over: frozenset[str] = frozenset()


class Check(ABC):
    """Base class of checks; ``problem.checks`` has those of a problem, see docs/extending.md.

    Attributes:
        level: At which ``logging`` is told; None warns.
    """

    level: ClassVar[int | None] = None

    @abstractmethod
    def run(self, step: CheckedStep) -> str | None:
        """What the user is to be told, once; empty where nothing is left to be looked at, None where the next step is.  Collective.

        The same on all ranks.
        """


def run_checks(
    checks: Sequence[Check], step: CheckedStep
) -> tuple[tuple[Check, ...], frozenset[str]]:
    """Run checks, warn in the name of who called ``solve``; those that are left, and names of those that are over.  Collective."""
    left = []
    for check in checks:
        message = check.run(step)
        if message is None:
            left.append(check)
            continue
        step = step._replace(over=step.over | {type(check).__name__})
        if message and check.level is None:
            warnings.warn(message, stacklevel=3)
        elif message and step.body.comm.rank == 0:
            logger.log(check.level, message)
    return tuple(left), step.over


def checked_checks(checks: Any) -> tuple[Check, ...]:
    """Checks, all of classes derived from ``Check``."""
    checks = (checks,) if isinstance(checks, Check) else tuple(checks)
    for check in checks:
        if not isinstance(check, Check):
            raise ValueError(
                f"problem.checks must be a list of objects of classes derived from dolfinx_contact.extend.Check, see docs/extending.md; got {check!r}."
            )
    return checks


def place_of(where: Sequence[float]) -> str:
    """A position in words."""
    where = np.where(np.abs(where) < NEGLIGIBLE_PART * np.abs(where).max(), 0.0, where)
    return f"({', '.join(f'{x:.3g}' for x in where)})"
