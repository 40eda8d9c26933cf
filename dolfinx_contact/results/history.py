"""A table of a run, one row a step: totals of the contacts and what tracked nodes do."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from mpi4py import MPI


class History:
    """Records totals and tracked nodes after every step, and writes them to a CSV file as it goes.

    Every row has ``step``, the caller's own columns, the step's record, and for each contact
    (``contact0_...``) the total reaction in global components, the sum of the norms of the
    tangential reactions, dissipation and worn volume so far; for each tracked node
    (``node0_...``) its local reaction, displacement relative to the plane, slip path, dissipation, gap and
    status.

    Args:
        problem: The ContactProblem that is recorded.
        path: CSV file, written by rank 0; None keeps the rows in memory only.
        points: Positions of the nodes to track, ``shape=(m, gdim)``, global frame, length units: the
            nearest contact node of ``contact`` is taken.
        contact: Index of the contact that has the tracked nodes.
        resume: Keep this many rows of an existing file, those of the steps before a checkpoint.

    Raises:
        ValueError: points of another dimension, or fewer rows in the file than ``resume``.

    Attributes:
        rows: List of dictionaries, the same on all ranks.
        positions: Of the tracked nodes, ``shape=(m, 3)``, global frame.
    """

    def __init__(self, problem, path=None, points=(), contact: int = 0, resume: int = 0):
        self.problem, self.path = problem, None if path is None else Path(path)
        self.comm = problem.body.comm
        self._tracked = problem.contacts[contact]
        points, gdim = np.asarray(points, dtype=float), self._tracked.points.dim
        if points.size and (points.ndim != 2 or points.shape[1] != gdim):
            raise ValueError(f"points must have shape (m, {gdim}), got {points.shape}.")
        self._nodes = [self._nearest(point) for point in points]
        self.positions = np.array([self._at(node, self._tracked.x) for node in self._nodes])
        self.rows = self._read(resume) if resume else []
        if self.path is not None and self.comm.rank == 0:
            self._write(self.rows)

    def record(self, step, **columns) -> dict:
        """Append a row for ``step``, the record of the last solve; ``columns`` come first.  Collective."""
        row = {"step": len(self.rows) + 1, **columns}
        for name in ("error", "slip_error", "bipotential_gap", "iterations", "seconds"):
            row[name] = getattr(step, name)
        row.update(step.counts._asdict())
        for k, contact in enumerate(self.problem.contacts):
            row.update((f"contact{k}_{name}", value) for name, value in self._totals(contact))
        for k, node in enumerate(self._nodes):
            row.update((f"node{k}_{name}", value) for name, value in self._state(node))
        self.rows.append(row)
        if self.path is not None and self.comm.rank == 0:
            self._write([row], append=len(self.rows) > 1)
        return row

    def column(self, name: str) -> np.ndarray:
        """One column over all steps, ``shape=(steps,)``."""
        return np.array([row[name] for row in self.rows])

    def _totals(self, contact):
        for axis, force in zip("xyz", contact.force()):
            yield f"force_{axis}", float(force)
        volume = contact.wear_depth @ contact.area if contact.wear is not None else 0.0
        tangential = np.linalg.norm(contact.reaction[:, :-1], axis=1).sum()
        sums = np.array([tangential, contact.dissipation.sum(), volume])
        self.comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
        names = ("tangential_reaction_sum", "dissipation", "worn_volume")
        yield from zip(names, sums.tolist())

    def _state(self, node):
        contact = self._tracked
        directions = ("t1", "t2", "n") if contact.points.dim == 3 else ("t", "n")
        for quantity in ("reaction", "displacement"):
            for direction, value in zip(directions, self._at(node, getattr(contact, quantity))):
                yield f"{quantity}_{direction}", value
        for quantity in ("slip_path", "dissipation", "load_function", "gap", "status"):
            yield quantity, self._at(node, getattr(contact, quantity))

    def _nearest(self, point) -> tuple[int, int]:
        """Rank and index of the contact node nearest to a point; the lowest rank of equals."""
        distance = np.linalg.norm(self._tracked.x[:, : point.size] - point, axis=1)
        nearest = int(distance.argmin()) if distance.size else -1
        _, owner = self.comm.allreduce(
            (distance.min(initial=np.inf), self.comm.rank), op=MPI.MINLOC
        )
        return owner, nearest

    def _at(self, node, values):
        owner, index = node
        mine = values[index].tolist() if self.comm.rank == owner else None
        return self.comm.bcast(mine, root=owner)

    def _write(self, rows, append=False) -> None:
        if not append and not rows:
            return
        with open(self.path, "a" if append else "w", newline="") as file:
            writer = csv.DictWriter(file, fieldnames=rows[0].keys())
            if not append:
                writer.writeheader()
            writer.writerows(rows)

    def _read(self, count: int) -> list[dict]:
        rows = None
        if self.comm.rank == 0 and self.path is not None and self.path.exists():
            with open(self.path, newline="") as file:
                rows = [{k: _number(v) for k, v in row.items()} for row in csv.DictReader(file)]
        rows = self.comm.bcast(rows, root=0)
        if rows is None or len(rows) < count:
            found = "no file" if rows is None else f"{len(rows)} rows"
            raise ValueError(f"cannot resume after {count} steps: {self.path} has {found}.")
        return rows[:count]


def _number(text: str):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            pass
    return text
