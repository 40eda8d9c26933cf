# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Base class of checks of modelling assumptions, which run after each step and warn at most once.

Each check is a class.  Modules with special checks are imported only if these apply.
"""

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

# Negligible rotation, radians, or length relative to the size of a body.
NEGLIGIBLE_PART = 1e-6

logger = logging.getLogger("dolfinx_contact")


class CheckedStep(NamedTuple):
    """State at the end of a step, the argument of checks.

    Attributes:
        body: The body.
        contacts: All contacts, with ``reaction``, ``gap`` etc. at the end of the step.
        stiffness: Nodal stiffness of each contact.
        u: Displacement, owned degrees of freedom and ghosts.
        counts: Number of nodes of all contacts by status.
        over: Class names of finished checks, which have warned or no longer apply.
    """

    body: ElasticBody
    contacts: Sequence[Contact]
    stiffness: Sequence[NodalStiffness]
    u: np.ndarray
    counts: Counts
    over: frozenset[str] = frozenset()


class Check(ABC):
    """Base class of the checks in ``problem.checks``, see docs/extending.md.

    Attributes:
        level: ``logging`` level of the message; None issues a Python warning instead.
    """

    level: ClassVar[int | None] = None

    @abstractmethod
    def run(self, step: CheckedStep) -> str | None:
        """Message for the user, an empty string if the check no longer applies, or None.
        Collective.

        The check is finished after a message or an empty string.  None repeats it after the next
        step.  The result is the same on all ranks.

        Args:
            step: State at the end of the step.
        """


def run_checks(
    checks: Sequence[Check], step: CheckedStep
) -> tuple[tuple[Check, ...], frozenset[str]]:
    """Run checks, and return the unfinished ones and the class names of finished ones.  Collective.

    Messages are logged, or issued as warnings at the line that called ``solve``.

    Args:
        checks: Checks to run.
        step: State at the end of the step.
    """
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
    """Tuple of the given checks, a single one or several.

    Raises:
        ValueError: An object is not an instance of ``Check``.
    """
    checks = (checks,) if isinstance(checks, Check) else tuple(checks)
    for check in checks:
        if not isinstance(check, Check):
            raise ValueError(
                f"problem.checks must be a list of objects of classes derived from dolfinx_contact.extend.Check, see docs/extending.md; got {check!r}."
            )
    return checks


def place_of(where: Sequence[float]) -> str:
    """Text of a position, such as "(1, 0, 0.5)"; negligible components become zero."""
    where = np.where(np.abs(where) < NEGLIGIBLE_PART * np.abs(where).max(), 0.0, where)
    return f"({', '.join(f'{x:.3g}' for x in where)})"
