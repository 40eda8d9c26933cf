# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Table with one row per load step: totals of the contacts, and results at tracked nodes."""

from __future__ import annotations

import csv
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike

from dolfinx_contact.results.record import Step
from dolfinx_contact.support.checks import a_problem
from dolfinx_contact.support.collective import by_first_rank, raised_together

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.problem import ContactProblem


class History:
    """Table of totals and of results at tracked nodes after every load step, also as a CSV file.

    Every row begins with the number of the step (``step``), the user's own columns and the record
    of the step.  For each contact (``contact0_...``), it contains the total reaction in global
    components, the sum of the norms of the tangential reactions, the accumulated dissipation and
    worn volume, and, if its surface was driven by force when the table was created, the
    displacement of the surface.  For each tracked node (``node0_...``), it contains the reaction
    and the displacement relative to the surface, both in the local frame, slip path, dissipation,
    load function, gap and status.

    Args:
        problem: The ContactProblem to record.
        path: CSV file, written by rank 0; with None, the rows are kept in memory only.
        points: Positions of the nodes to track, ``shape=(m, gdim)``, global frame, length units.
            For each position, the nearest contact node of ``contact`` is tracked.
        contact: Index of the contact with the tracked nodes.
        resume: Number of rows of an existing file to keep, for instance the number of steps before
            a checkpoint.

    Raises:
        ValueError: ``points`` have another dimension, the folder of the file does not exist, or the
            file has fewer rows than ``resume``.

    Attributes:
        rows: Rows of the table, a list of dictionaries, the same on all ranks.
        positions: Reference positions of the tracked nodes, ``shape=(m, 3)``, global frame, length
            units.

    Example:
        >>> history = dc.History(problem)
        >>> row = history.record(problem.solve(), way=0.004)
        >>> history.column("way").tolist()
        [0.004]
    """

    def __init__(
        self,
        problem: ContactProblem,
        path: str | PathLike[str] | None = None,
        *,
        points: ArrayLike = (),
        contact: int = 0,
        resume: int = 0,
    ) -> None:
        self.problem, self.comm = problem, a_problem(problem).body.comm
        with raised_together(self.comm):
            self.path = None if path is None else Path(path)
            if path is not None and self.comm.rank == 0 and not self.path.parent.is_dir():
                raise ValueError(
                    f"there is no folder {self.path.parent} for {self.path.name}: make it, or give another path."
                )
            if path is not None and self.comm.rank == 0 and self.path.is_dir():
                raise ValueError(f"{self.path} is a folder: give the path of a file.")
            if contact not in range(len(problem.contacts)):
                raise ValueError(f"contact {contact!r}: the problem has {len(problem.contacts)}.")
            if not isinstance(resume, (int, np.integer)) or resume < 0:
                raise ValueError(f"resume must be a number of rows, 0 or more, got {resume!r}.")
        self._tracked = problem.contacts[contact]
        self._driven = [bool(contact.surface.free) for contact in problem.contacts]
        at, gdim = np.asarray(points, dtype=float), self._tracked.points.dim
        if at.size and (at.ndim != 2 or at.shape[1] != gdim):
            raise ValueError(f"points must have shape (m, {gdim}), got {at.shape}.")
        self._nodes = [self._nearest(point) for point in at]
        self.positions = np.array([self._at(node, self._tracked.x) for node in self._nodes])
        self.rows: list[dict[str, Any]] = []
        if resume:
            self.rows = by_first_rank(self.comm, lambda _: self._rows_of_file(resume))
        self._written = 0
        if self.rows:
            self._write()

    def record(self, step: Step, **columns: object) -> dict[str, Any]:
        """Append a row to the table, write it to the file, and return it.  Collective.

        If a row cannot be written, for instance since the disk is full, it is kept and written
        together with the next row.

        Args:
            step: Record of the load step, as returned by ``problem.solve()``.
            columns: Further values by name, which follow the number of the step.

        Raises:
            ValueError: the columns differ from the columns of the first row.
            OSError: on all ranks, if the file cannot be written.
        """
        row = {"step": len(self.rows) + 1, **columns}
        for name in ("error", "slip_error", "bipotential_gap", "iterations", "seconds"):
            row[name] = getattr(step, name)
        row.update(step.counts._asdict())
        for k, contact in enumerate(self.problem.contacts):
            row.update((f"contact{k}_{name}", value) for name, value in self._totals(contact))
            moved = zip("xyz", contact.surface.displacement if self._driven[k] else ())
            row.update((f"contact{k}_plane_{axis}", float(value)) for axis, value in moved)
        for k, node in enumerate(self._nodes):
            row.update((f"node{k}_{name}", value) for name, value in self._state(node))
        with raised_together(self.comm):
            if self.rows and list(row) != list(self.rows[0]):
                other = sorted(set(row) ^ set(self.rows[0])) or "in another order"
                raise ValueError(f"the columns are not those of the first row: {other}.")
        self.rows.append(row)
        self._write()
        return row

    def column(self, name: str) -> np.ndarray:
        """Return a column of the table, one value for each step, ``shape=(steps,)``.

        Raises:
            ValueError: there is no such column; the message lists the existing ones.
        """
        if self.rows and name not in self.rows[0]:
            raise ValueError(f"there is no column {name!r}; there are {', '.join(self.rows[0])}.")
        return np.array([row[name] for row in self.rows])

    def _totals(self, contact: Contact):
        for axis, force in zip("xyz", contact.force()):
            yield f"force_{axis}", float(force)
        tangential = np.linalg.norm(contact.reaction[:, :-1], axis=1).sum()
        sums = np.array([tangential, contact.dissipation.sum()])
        self.comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
        names = ("tangential_reaction_sum", "dissipation", "worn_volume")
        yield from zip(names, (*sums.tolist(), sum(contact.worn_volume())))

    def _state(self, node: Any):
        contact = self._tracked
        directions = ("t1", "t2", "n") if contact.points.dim == 3 else ("t", "n")
        for quantity in ("reaction", "displacement"):
            for direction, value in zip(directions, self._at(node, getattr(contact, quantity))):
                yield f"{quantity}_{direction}", value
        for quantity in ("slip_path", "dissipation", "load_function", "gap", "status"):
            yield quantity, self._at(node, getattr(contact, quantity))

    def _nearest(self, point: np.ndarray) -> tuple[int, int]:
        """Return rank and local index of the contact node nearest to a point.  Collective.

        If nodes of several ranks have the same distance, the lowest rank is returned.
        """
        distance = np.linalg.norm(self._tracked.x[:, : point.size] - point, axis=1)
        nearest = int(distance.argmin()) if distance.size else -1
        _, owner = self.comm.allreduce(
            (distance.min(initial=np.inf), self.comm.rank), op=MPI.MINLOC
        )
        return owner, nearest

    def _at(self, node: Any, values: Any):
        owner, index = node
        mine = values[index].tolist() if self.comm.rank == owner else None
        return self.comm.bcast(mine, root=owner)

    def _write(self) -> None:
        """Append the rows that are not yet in the file; rank 0 writes.  Collective."""
        with raised_together(self.comm):
            if self.path is not None and self.comm.rank == 0:
                new = not self._written
                with open(self.path, "w" if new else "a", newline="") as file:
                    writer = csv.DictWriter(file, fieldnames=self.rows[0].keys())
                    if new:
                        writer.writeheader()
                    writer.writerows(self.rows[self._written :])
        self._written = len(self.rows)

    def _rows_of_file(self, count: int) -> list[dict]:
        if self.path is None or not self.path.exists():
            raise ValueError(f"cannot resume after {count} steps: there is no file {self.path}.")
        try:
            with open(self.path, newline="") as file:
                rows = list(csv.DictReader(file, strict=True))
        except (csv.Error, UnicodeDecodeError) as error:
            raise ValueError(f"cannot resume: {self.path} is no table: {error}.") from None
        if len(rows) < count:
            raise ValueError(
                f"cannot resume after {count} steps: {self.path} has {len(rows)} rows."
            )
        for k, row in enumerate(rows[:count], start=1):
            if None in row or None in row.values() or row.get("step") != str(k):
                raise ValueError(
                    f"cannot resume: row {k} of {self.path} is broken or not that of step {k}. Resume after fewer steps, "
                    "or without the file."
                )
        return [{k: _number(v) for k, v in row.items()} for row in rows[:count]]


def _number(text: str):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text
