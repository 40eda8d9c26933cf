# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many cycles: a simulated cycle counts for many, and an estimated error determines for how many."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dolfinx_contact.contact.laws import rows
from dolfinx_contact.contact.state import OPPOSITE_WEAR, SLIP_KEPT
from dolfinx_contact.results.record import NotConverged
from dolfinx_contact.support.attributes import frozen
from dolfinx_contact.support.checks import a_problem, positive
from dolfinx_contact.support.collective import agree, by_first_rank, raised_together
from dolfinx_contact.support.progress import progress_bar

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.problem import ContactProblem

# The shortest jump: the cycles of its fine run are simulated one by one.
SHORTEST_JUMP = 2

# Jumps aim at a difference of so many accuracies and may miss that by a factor; from one to the next they grow and shrink by these factors at most.
ACCURACIES_AIMED_AT = 1.5
ACCEPTED_EXCESS = 1.5
LARGEST_GROWTH = 6.0
SMALLEST_REDUCTION = 0.1

# Part of the largest mu, or p, by which friction that evolves is to change in a jump.
FRICTION_CHANGE = 0.25

# Part of all that is worn, of which a jump may have the accuracy as its own error, however little it wears itself.
WORN_SHARE = 0.05

RECORD_FILE = "record.json"


@dataclass(frozen=True)
class CycleJump:
    """What ``cycle_jump`` returns.

    Attributes:
        cycles: Number of cycles.
        simulated: Number of simulated cycles, including those of rejected jumps.
        accepted, rejected: Number of jumps.
        volume: Worn volume of all contacts, length cubed (per thickness in two dimensions).
        depth: Largest worn depth, length.
        volume_error: Estimated error of the volume, relative to it.
        depth_error: Largest estimated error of a node's depth, relative to ``depth``.
        profile_error: Integral of the nodes' estimated errors over the surface, relative to the volume.
        reached: Whether all three errors are at most the requested accuracy.
        table: A dictionary for each accepted jump: ``cycle``, the cycle at its end; ``jump``, its length; and ``volume``,
            ``depth`` and ``simulated`` as above.

    Example:
        >>> def cycle(done):
        ...     for way in (0.001, 0.0):
        ...         held.value = (way, 0, -0.01)
        ...         problem.solve()
        >>> found = dc.cycle_jump(problem, cycle, 10, accuracy=0.05)
        >>> found.cycles, found.reached
        (10, True)
    """

    cycles: int
    simulated: int
    accepted: int
    rejected: int
    volume: float
    depth: float
    volume_error: float
    depth_error: float
    profile_error: float
    reached: bool
    table: list[dict[str, Any]] = field(repr=False)  # a row for each jump would hide the rest


def cycle_jump(
    problem: ContactProblem,
    cycle: Callable[[int], object],
    cycles: int,
    accuracy: float = 0.02,
    *,
    longest: float = np.inf,
    max_cycles: int = 500,
    path: str | os.PathLike[str] | None = None,
    monitor: Callable[[dict[str, Any]], object] | None = None,
) -> CycleJump:
    """Simulate wear over many load cycles, of which only a few are computed.  Collective.

    In a jump of n cycles, wear, work and slip of each step of one simulated cycle count n times (``contact.repeats``).  Each jump is computed
    twice from the same state: a coarse run of one simulated cycle, and a fine run of two, each for half of the jump.  First-order errors of the
    coarse run are twice those of the fine one, and Richardson extrapolation removes them.  The jump ends with a step without motion or wear.

    Half the change of the runs' difference since the last jump, beyond the square of lengths, is to be ``accuracy`` times the wear of the jump, or
    a twentieth of that times all wear so far, and evolving friction is to change by at most about a quarter.  Else, or if a step does not converge,
    the jump is repeated with fewer cycles.  The first jumps, until stick and slip zones have settled, have two.  One of the last jumps is
    also computed in three parts, which measures its error.  Those of others follow: over the wear it is as the square of the length.

    Args:
        problem: The ContactProblem, in the state before the first cycle.
        cycle: Function of the number of cycles done, which takes the problem through one cycle by ``problem.solve()``.  It is called
            repeatedly from earlier states, so it must set all loads that its steps need.
        cycles: Number of cycles.
        accuracy: Requested relative error of worn volume, largest depth and profile.
        longest, max_cycles: Largest number of cycles in a jump, and to simulate in this call; a jump that has begun is finished.
        path: Folder of checkpoints, one after every jump; if it contains some, the run continues from the last.
        monitor: None, or a function of a row of the table, called after every jump, in the state at its end.

    Returns:
        A ``CycleJump``; the problem is in the state after the last cycle.  On a terminal there is a progress bar if tqdm is installed.

    Raises:
        NotConverged: a step of cycles simulated one by one did not converge; after any exception, the last jump's end is restored.
        RuntimeError: ``max_cycles`` were simulated; with ``path``, the same call continues.
        ValueError: no contact wears, a cycle has no step, a number is out of range, or the folder belongs to another run.

    Example:
        >>> def cycle(done):
        ...     for way in (0.002, 0.0):
        ...         held.value = (way, 0, -0.01)
        ...         problem.solve()
        >>> dc.cycle_jump(problem, cycle, 4).table[-1]["cycle"]
        4
    """
    given = _begun(problem, cycle, cycles, accuracy, longest, max_cycles, path, monitor)
    return _jump_on(*given, monitor).found()


def _begun(
    problem: ContactProblem,
    cycle: Any,
    cycles: Any,
    accuracy: Any,
    longest: Any,
    max_cycles: Any,
    path: Any,
    monitor: Any,
) -> tuple:
    """The run as it begins or goes on, the numbers of cycles, and the folder, from checked arguments of ``cycle_jump``.  Collective."""
    comm = a_problem(problem).body.comm
    with raised_together(comm):
        cycles = int(positive("cycles", cycles, whole=True))
        max_cycles = int(positive("max_cycles", max_cycles, whole=True))
        accuracy, longest = (
            positive("accuracy", accuracy, finite=True),
            positive("longest", longest),
        )
        _check(problem, cycle, monitor)
    numbers = dict(cycles=cycles, accuracy=accuracy, longest=longest, max_cycles=max_cycles)
    agree(comm, **numbers, path=None if path is None else str(path))
    run, folder = _Run(problem, cycle, accuracy, longest), None
    if path is not None:
        folder = _Folder(path, run)
        folder.read(cycles)
    return run, cycles, max_cycles, folder


def _jump_on(
    run: _Run, cycles: int, most: int, folder: _Folder | None, monitor: Callable | None
) -> _Run:
    """Jump until all cycles are done, or ``most`` are simulated; whatever happens the problem is at the end of the last jump.  Collective."""
    comm = run.problem.body.comm
    begun = run.record["simulated"]
    with progress_bar(comm.rank, cycles, run.record["done"]) as shown:
        try:
            while run.record["done"] < cycles:
                if run.record["simulated"] - begun >= most:
                    raise RuntimeError(run.told(cycles, folder is not None))
                row = run.jump(cycles)
                if folder is not None:
                    folder.write()
                if monitor is not None:
                    with raised_together(comm):
                        monitor(row)
                shown(run.record["done"])
        finally:
            run.show()
    return run


def _check(problem: Any, cycle: object, monitor: object) -> None:
    if not any(contact.wear is not None for contact in problem.contacts):
        raise ValueError(
            "no contact of the problem has a law of wear: contact.wear = dc.Wear(...)."
        )
    if not callable(cycle):
        raise ValueError(f"cycle must be a function of the number of cycles done, got {cycle!r}.")
    if not (monitor is None or callable(monitor)):
        raise ValueError(f"monitor must be a function of a row of the table, got {monitor!r}.")


class _State(NamedTuple):
    """Snapshot of the problem, depths at this rank's nodes that wear, sums of each contact, and friction at this rank's nodes."""

    snapshot: Any
    depth: np.ndarray
    sums: list[dict[str, np.ndarray]]
    friction: np.ndarray  # mu and p, shape=(n, 4)


class _Run:
    """A programme on its way.

    Attributes:
        end: The ``_State`` after the last jump.
        coarse: That of its coarse run, which tells the error of first order.
        record: What a checkpoint has beside them: cycles ``done`` and ``simulated``, jumps ``rejected``, length of the
            ``next`` one, the ``table``, and ``measured``: row of a jump, and errors of volume, depth and profile that it made.
    """

    def __init__(self, problem: ContactProblem, cycle: Callable, accuracy: float, longest: float):
        self.problem, self._cycle = problem, cycle
        self._accuracy, self._longest = accuracy, longest
        self._worn = [contact for contact in problem.contacts if contact.wear is not None]
        self._area = np.concatenate(
            [area for c in self._worn for area in (c.whole_area, c.opposite_area)]
        )
        self.end = self.coarse = self.present()
        self.record: dict[str, Any] = {
            "done": 0,
            "simulated": 0,
            "rejected": 0,
            "next": float(SHORTEST_JUMP),
            "table": [],
            "measured": [0] + 3 * [np.inf],
        }

    def present(self) -> _State:
        """The present state."""
        depths = [depth for c in self._worn for depth in (c.wear_depth, c.opposite_wear_depth)]
        sums = [_sums(contact) for contact in self.problem.contacts]
        friction = [rows(c.friction, c.nodes.size)[:, :4] for c in self.problem.contacts]
        return _State(
            self.problem.snapshot(), np.concatenate(depths), sums, np.concatenate(friction)
        )

    def show(self) -> None:
        """Put the problem into the state after the last jump."""
        self._count(1)
        self.problem.restore(self.end.snapshot)

    def found(self) -> CycleJump:
        table, record, errors = self.table, self.record, self._errors()
        worn = table[-1]["volume"], table[-1]["depth"]
        return CycleJump(
            record["done"],
            record["simulated"],
            len(table),
            record["rejected"],
            *worn,
            *errors,
            max(errors) <= self._accuracy,
            table,
        )

    def told(self, cycles: int, kept: bool) -> str:
        """Why it ends before so many cycles."""
        done, last = self.record["done"], self.table[-1]
        on = (
            "the same call goes on from there"
            if kept
            else f"another call goes on from there, with cycles={cycles - done}; path= keeps the state in a folder"
        )
        return f"cycle_jump has simulated max_cycles and is at cycle {done} of {cycles}, the last jump was of {last['jump']}. The problem is there, and {on}. A larger accuracy allows longer jumps, more steps in a cycle or a finer mesh often does."

    @property
    def table(self) -> list[dict[str, Any]]:
        return self.record["table"]

    def jump(self, cycles: int) -> dict[str, Any]:
        """Make the next jump towards so many cycles; returns its row of the table.  Collective."""
        while True:
            length = int(max(min(self.record["next"], self._longest), SHORTEST_JUMP))
            left = cycles - self.record["done"]
            length = _even(left, length)
            late = 2 * length >= left or _even(left - length, length) <= SHORTEST_JUMP
            row = self._tried(length, late)
            if row is not None:
                self.show()
                return row
            self.record["rejected"] += 1

    def _tried(self, length: int, late: bool) -> dict[str, Any] | None:
        """The row of a jump of so many cycles, None where it is rejected; says how long the next one may be, and measures a late one.  Collective."""
        plain = length <= SHORTEST_JUMP  # the fine run simulates all
        coarse = self._through([length])
        fine = end = coarse
        if length > 1 and (plain or coarse):
            fine = end = self._through(_parts(length, 2), must=plain)
        if coarse and fine and not plain:
            end = self._extrapolated(coarse, fine, length)
        volume, depth, local = self._compared(coarse, fine, end, length)
        over = max(local / (ACCURACIES_AIMED_AT * self._accuracy), self._changed(end) ** 2)
        accepted = end is not None and (plain or over <= ACCEPTED_EXCESS)
        factor = (
            min(max(over**-0.5, SMALLEST_REDUCTION), LARGEST_GROWTH if accepted else 0.5)
            if over > 0.0
            else LARGEST_GROWTH
        )
        self.record["next"] = max(factor * length, float(SHORTEST_JUMP))
        if not accepted:
            return None
        if late and not plain and length > self.table[self.record["measured"][0]]["jump"]:
            self._measure(fine, end, length)
        self.end, self.coarse = end, coarse or end
        self.record["done"] += length
        self.table.append(
            {
                "cycle": self.record["done"],
                "jump": length,
                "volume": volume,
                "depth": depth,
                "simulated": self.record["simulated"],
            }
        )
        return self.table[-1]

    def _through(self, parts: list[int], must: bool = False) -> _State | None:
        """The state after a cycle for each of ``parts`` that counts so many times; None where it does not converge, unless it must."""
        problem, done = self.problem, self.record["done"]
        problem.restore(self.end.snapshot)
        try:
            for part in parts:
                self._count(part)
                before = problem.snapshot()
                with raised_together(problem.body.comm):
                    self._cycle(done)
                    if problem.snapshot() is before:
                        raise ValueError(
                            "cycle has made no step of this problem: it takes the problem through one cycle by problem.solve()."
                        )
                self.record["simulated"] += 1
                done += part
        except NotConverged:
            if must:
                raise
            return None
        return self.present()

    def _extrapolated(self, coarse: _State, fine: _State, length: int) -> _State | None:
        """The state with the fine run's sums less their error of first order, in equilibrium; None where that does not converge."""
        more = _extrapolation(length, 1, 2)
        for contact, *sums in zip(self.problem.contacts, self.end.sums, coarse.sums, fine.sums):
            start, one, two = sums
            _take_sums(
                contact,
                {
                    name: np.maximum(
                        two[name] + more * (two[name] - one[name]), start.get(name, 0.0)
                    )
                    for name in two
                },
            )
        self._count(0)
        try:
            self.problem.solve()
        except NotConverged:
            return None
        return self.present()

    def _count(self, times: int) -> None:
        for contact in self.problem.contacts:
            contact.repeats = times

    def _compared(self, coarse: Any, fine: Any, end: Any, length: int) -> tuple[float, ...]:
        """Volume and largest depth at the end of a jump, and by how much runs differ in another way than in the last jump, over what it wears.

        All reduced over the ranks.  Coarse and fine run of n cycles differ by ``n^2 a + n^3 b``, of which the last jump's tells ``a``; what is
        left is about twice the error of the extrapolated end; infinite where a run did not converge, and for the first jump.
        """
        if end is None:
            return 0.0, 0.0, np.inf
        body, area, last = self.problem.body, self._area, self.table[-1] if self.table else None
        worn, off = end.depth - self.end.depth, np.zeros_like(area)
        if last and fine is not coarse and coarse:
            before = (self.end.depth - self.coarse.depth) / (
                1.0 + _extrapolation(last["jump"], 1, 2)
            )
            off = fine.depth - coarse.depth - (length / last["jump"]) ** 2 * before
        volume, more, new = map(
            float, body.total([area @ depths for depths in (end.depth, worn, np.abs(off))])
        )
        depth, deeper, most = (body.largest(np.abs(depths)) for depths in (end.depth, worn, off))
        local = max(
            _part(new, more + WORN_SHARE * volume), _part(most, deeper + WORN_SHARE * depth)
        )
        return volume, depth, local if last and coarse else np.inf

    def _measure(self, fine: _State, end: _State, length: int) -> None:
        """Errors of a jump by a run in three parts, which, extrapolated, has a third of them.  Collective."""
        third = self._through(_parts(length, 3))
        if third is None:
            return
        better = third.depth + _extrapolation(length, 2, 3) * (third.depth - fine.depth)
        off = 1.5 * (end.depth - np.maximum(better, self.end.depth))
        volume, profile = map(
            float, self.problem.body.total([self._area @ off, self._area @ np.abs(off)])
        )
        if profile > 0.0:
            self.record["measured"] = [
                len(self.table),
                abs(volume),
                self.problem.body.largest(np.abs(off)),
                profile,
            ]

    def _errors(self) -> list[float]:
        """Estimated errors of volume, depth and profile, relative, from those of the measured jump.

        Over what it wears, a jump is off by the square of its length.  Errors of the volume add up, and fall as the rate of wear does, since both
        obey the equation linearised; what is off in the shape beside that wears off in a jump.
        """
        lengths, volumes = (
            np.array([row[name] for row in self.table], float) for name in ("jump", "volume")
        )
        rates, cubes = (
            np.diff(volumes, prepend=0.0) / lengths,
            lengths * (lengths - 1.0) * (lengths - 2.0),
        )
        row, *made = self.record["measured"]
        volume, depth, profile = (
            _part(a, self.table[-1][name]) for a, name in zip(made, ("volume", "depth", "volume"))
        )
        fall = min(1.0, _part(float(rates[-1]), float(rates[row])))
        total = _part(float(np.minimum(rates, rates[-1]) @ cubes), float(rates[row] * cubes[row]))
        added = (total - fall) * volume
        return (
            [total * volume, added + fall * depth, added + fall * profile]
            if total > 0.0
            else [0.0] * 3
        )

    def _changed(self, end: _State | None) -> float:
        """By how much mu or p have changed in a jump, over CHANGE of the largest."""
        if end is None:
            return 0.0
        largest, parts = self.problem.body.largest, []
        for columns in (slice(0, 2), slice(2, 4)):
            before, now = (side.friction[:, columns].ravel() for side in (self.end, end))
            parts.append(_part(largest(np.abs(now - before)), largest(np.maximum(before, now))))
        return max(parts) / FRICTION_CHANGE


def _even(left: int, length: int) -> int:
    """The length of the next jump, such that the last ones have one length."""
    return -(-left // -(-left // length))


def _parts(length: int, number: int) -> list[int]:
    """A jump's length in so many parts, as equal as can be."""
    return np.diff(np.arange(number + 1) * length // number).tolist()


def _extrapolation(length: int, fewer: int, more: int) -> float:
    """Error of first order of a run in more parts, over its difference to one in fewer: it is as ``n (n - 1)``, none of single cycles."""
    one, two = (sum(n * (n - 1) for n in _parts(length, number)) for number in (fewer, more))
    return two / (one - two) if one > two else 0.0


def _part(amount: float, whole: float) -> float:
    """``of`` over ``whole``, none of nothing."""
    return amount / whole if amount > 0.0 and whole > 0.0 else np.inf if amount > 0.0 else 0.0


def _is_record(record: Any) -> bool:
    """Whether it is one that ``_Run`` has written; errors say that it is not, too."""
    counts = [record[name] for name in ("done", "simulated", "rejected")]
    at, *errors = record["measured"]
    rows = [
        [row[name] for name in ("volume", "depth", "cycle", "jump", "simulated")]
        for row in record["table"]
    ]
    whole = [*counts, at, *(number for row in rows for number in row[2:])]
    return (
        all(type(number) is int and number >= 0 for number in whole)
        and np.isfinite([record["next"], *(number for row in rows for number in row)]).all()
        and record["next"] >= SHORTEST_JUMP
        and len(errors) == 3
        and all(error >= 0.0 for error in errors)
        and at < len(rows)
        and np.array_equal(np.cumsum([row[3] for row in rows]), [row[2] for row in rows])
        and counts[0] == rows[-1][2]
    )


class _Folder:
    """Checkpoints of a programme: two of the problem, and a record that names them, which is replaced last.

    Whenever the machine stops, the record and what it names are whole.
    """

    def __init__(self, path: str | PathLike[str], run: _Run):
        self._path, self._run, self._comm = Path(path), run, run.problem.body.comm
        self._written: list[str] = []

    def read(self, cycles: int) -> None:
        """Go on from where the folder says, if it is one.  Collective.

        Raises:
            ValueError: the record is broken, or of more cycles.
        """
        record = by_first_rank(self._comm, lambda _: self._record(cycles))
        if record is None:
            return
        run = self._run
        run.record = record
        states = []
        for name in self._names():
            run.problem.load(self._path / name)
            states.append(run.present())
        run.coarse, run.end = states
        self._written = self._names()

    def _record(self, cycles: int) -> dict | None:
        file = self._path / RECORD_FILE
        try:
            record = json.loads(file.read_text())
            done, complete = record["done"], _is_record(record)
        except FileNotFoundError:
            self._path.mkdir(parents=True, exist_ok=True)
            return None
        except (ValueError, TypeError, KeyError, IndexError):
            complete = False
        if not complete:
            raise ValueError(
                f"{file} is no record of cycle_jump: take another folder, or delete this one."
            )
        if done > cycles:
            raise ValueError(
                f"{self._path} has a run that has done {done} cycles, more than cycles = {cycles}."
            )
        return record

    def _names(self) -> list[str]:
        """Names of the checkpoints: of the coarse run and of the end of the last jump."""
        return [f"{self._run.record['done']}{suffix}.npz" for suffix in ("_coarse", "")]

    def write(self) -> None:
        """Write the state after the last jump.  Collective."""
        run = self._run
        names = self._names()
        for name, state in zip(names, (run.coarse, run.end)):
            run.problem.restore(state.snapshot)
            run.problem.save(self._path / name)
        with raised_together(self._comm):
            if self._comm.rank == 0:
                unfinished = self._path / f"{RECORD_FILE}.unfinished"
                with open(unfinished, "w") as file:
                    json.dump(run.record, file)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(unfinished, self._path / RECORD_FILE)
                for name in self._written:  # before
                    with suppress(OSError):
                        (self._path / name).unlink()
        self._written = names


def _sums(contact: Contact) -> dict[str, np.ndarray]:
    """What nodes have worked, slipped and worn since the start, ``shape=(n,)`` each, by name."""
    return {name: values for name, values in contact.history.sums.items() if name != SLIP_KEPT}


def _take_sums(contact: Contact, sums: dict[str, np.ndarray]) -> None:
    """Let the next step start from other ``sums``, none of them negative.  Collective where a deformable surface wears."""
    sums = contact.history.sums | {name: frozen(values) for name, values in sums.items()}
    worn = contact.geometry.everywhere(sums[OPPOSITE_WEAR]) if OPPOSITE_WEAR in sums else None
    contact.go_back(contact.history.but(sums=sums, worn=worn))
