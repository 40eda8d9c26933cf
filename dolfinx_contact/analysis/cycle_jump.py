# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many load cycles by cycle jumps, whose length is controlled by an estimated error."""

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

# Length of the shortest jump, cycles: its fine run simulates every cycle.
SHORTEST_JUMP = 2

# Step size control.  The target of the estimated difference, as a multiple of the requested
# accuracy; the factor by which an accepted jump may exceed the target; the largest and smallest
# ratio of the lengths of successive jumps.
ACCURACIES_AIMED_AT = 1.5
ACCEPTED_EXCESS = 1.5
LARGEST_GROWTH = 6.0
SMALLEST_REDUCTION = 0.1

# Target of the change of evolving friction in a jump, relative to the largest mu or p.
FRICTION_CHANGE = 0.25

# Fraction of the total wear that is added to the wear of a jump where its error is made relative.
# Without it, jumps with little wear would need an unreasonably small error.
WORN_SHARE = 0.05

RECORD_FILE = "record.json"


@dataclass(frozen=True)
class CycleJump:
    """Result of ``cycle_jump``: worn volume, wear depth and their estimated errors.

    Attributes:
        cycles: Number of load cycles.
        simulated: Number of simulated cycles, including the cycles of rejected jumps.
        accepted, rejected: Number of accepted and rejected jumps.
        volume: Worn volume of all contacts, length cubed (per thickness in two dimensions).
        depth: Largest wear depth, length.
        volume_error: Estimated error of the worn volume, relative to ``volume``.
        depth_error: Largest estimated error of a nodal wear depth, relative to ``depth``.
        profile_error: Integral of the estimated errors of the nodal wear depths over the surface,
            relative to ``volume``.
        reached: Whether all three errors are at most the requested accuracy.
        table: A dictionary for each accepted jump: ``cycle``, the cycle at its end; ``jump``, its
            length in cycles; ``volume``, ``depth`` and ``simulated`` at its end, defined as above.

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

    In a jump of n cycles, the wear, dissipation and slip of one simulated cycle are multiplied by n
    (``contact.repeats``).  Each jump is computed twice from the same state.  The coarse run
    simulates one cycle for the whole jump.  The fine run simulates two cycles, each for half of
    the jump.  The first-order error of the coarse run is about twice the error of the fine run.
    Richardson extrapolation removes both.  The jump ends with one step without motion or wear.

    The length of a jump is controlled by the difference between the two runs.  If the error were
    purely of first order, this difference would grow with the square of the length.  Half of the
    deviation from this prediction must be at most about ``accuracy`` times the sum of the wear in
    the jump and a twentieth of the total wear.  Evolving friction must change by at most about a
    quarter.  If a jump violates these limits, or one of its steps does not converge, it is repeated
    with fewer cycles.  The first jumps have two cycles until the stick and slip zones have settled.

    One of the last jumps is also computed in three parts, to estimate its error.  The errors of the
    other jumps follow from it: relative to the wear in the jump, they grow with the square of the
    length.

    Args:
        problem: The ContactProblem in the state before the first cycle.
        cycle: Function of the number of completed cycles.  It simulates one cycle by calls of
            ``problem.solve()``.  Since it is also called from earlier states, it must set all
            loads.
        cycles: Number of load cycles.
        accuracy: Requested relative error of worn volume, largest wear depth and wear profile.
        longest: Largest number of cycles in a jump.
        max_cycles: Largest number of cycles to simulate in this call; the current jump is
            completed.
        path: Folder of checkpoints, written after every jump.  If it contains checkpoints, the run
            continues from the last one.
        monitor: None, or a function of a row of the table, called after every jump in the state at
            the end of the jump.

    Returns:
        A ``CycleJump``.  The problem is in the state after the last cycle.  On a terminal, a
        progress bar is shown if tqdm is installed.

    Raises:
        NotConverged: a step of a jump of minimal length did not converge.  After any exception, the
            problem is in the state at the end of the last jump.
        RuntimeError: ``max_cycles`` cycles were simulated.  If ``path`` is given, the same call
            continues the run.
        ValueError: no contact has a wear law, a cycle has no load step, a number is out of range,
            or the folder belongs to another run.

    Example:
        >>> def cycle(done):
        ...     for way in (0.002, 0.0):
        ...         held.value = (way, 0, -0.01)
        ...         problem.solve()
        >>> dc.cycle_jump(problem, cycle, 4).table[-1]["cycle"]
        4
    """
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
    _run_jumps(run, cycles, max_cycles, folder, monitor)
    return run.result()


def _run_jumps(
    run: _Run, cycles: int, most: int, folder: _Folder | None, monitor: Callable | None
) -> None:
    """Compute jumps until all cycles are completed.  Collective.

    In any case, also after an exception, the problem is left in the state at the end of the last
    jump.

    Raises:
        RuntimeError: ``most`` cycles were simulated before all ``cycles`` were completed.
    """
    comm = run.problem.body.comm
    begun = run.record["simulated"]
    with progress_bar(comm.rank, cycles, run.record["done"]) as shown:
        try:
            while run.record["done"] < cycles:
                if run.record["simulated"] - begun >= most:
                    raise RuntimeError(run.limit_message(cycles, folder is not None))
                row = run.jump(cycles)
                if folder is not None:
                    folder.write()
                if monitor is not None:
                    with raised_together(comm):
                        monitor(row)
                shown(run.record["done"])
        finally:
            run.restore_end()


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
    """State of the problem at the beginning or end of a jump.

    Attributes:
        snapshot: Snapshot of the problem, for ``problem.restore``.
        depth: Wear depths at this rank's nodes, on both sides of all contacts with wear, length.
        sums: Accumulated history variables of each contact, by name.
        friction: Coefficients mu of the friction cone and p of the slip rule at this rank's nodes,
            two components each, ``shape=(n, 4)``.
    """

    snapshot: Any
    depth: np.ndarray
    sums: list[dict[str, np.ndarray]]
    friction: np.ndarray  # mu and p, shape=(n, 4)


class _Run:
    """Progress of a ``cycle_jump`` simulation, which computes one jump after another.

    Attributes:
        end: ``_State`` at the end of the last jump.
        coarse: ``_State`` at the end of the coarse run of the last jump, from which the first-order
            error is estimated.
        record: Progress that a checkpoint contains beside the two states: number of cycles ``done``
            and ``simulated``, number of jumps ``rejected``, length of the ``next`` jump, the
            ``table``, and ``measured``: table row of the jump that was also computed in three
            parts, and the estimated absolute errors of volume, depth and profile in this jump.
    """

    def __init__(self, problem: ContactProblem, cycle: Callable, accuracy: float, longest: float):
        self.problem, self._cycle = problem, cycle
        self._accuracy, self._longest = accuracy, longest
        self._worn = [contact for contact in problem.contacts if contact.wear is not None]
        self._area = np.concatenate(
            [area for c in self._worn for area in (c.whole_area, c.opposite_area)]
        )
        self.end = self.coarse = self.current_state()
        self.record: dict[str, Any] = {
            "done": 0,
            "simulated": 0,
            "rejected": 0,
            "next": float(SHORTEST_JUMP),
            "table": [],
            "measured": [0] + 3 * [np.inf],
        }

    def current_state(self) -> _State:
        """Return the present ``_State`` of the problem."""
        depths = [depth for c in self._worn for depth in (c.wear_depth, c.opposite_wear_depth)]
        sums = [_sums(contact) for contact in self.problem.contacts]
        friction = [rows(c.friction, c.nodes.size)[:, :4] for c in self.problem.contacts]
        return _State(
            self.problem.snapshot(), np.concatenate(depths), sums, np.concatenate(friction)
        )

    def restore_end(self) -> None:
        """Restore the state of the problem at the end of the last jump."""
        self._count(1)
        self.problem.restore(self.end.snapshot)

    def result(self) -> CycleJump:
        table, record, errors = self.table, self.record, self._relative_errors()
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

    def limit_message(self, cycles: int, kept: bool) -> str:
        """Return the error message for a run that has simulated ``max_cycles`` cycles.

        Args:
            cycles: Requested number of load cycles.
            kept: Whether checkpoints are written, so that the same call continues the run.
        """
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
        """Compute the next jump and return its row of the table.  Collective.

        Args:
            cycles: Number of load cycles of the whole run, which the jump does not exceed.
        """
        while True:
            length = int(max(min(self.record["next"], self._longest), SHORTEST_JUMP))
            left = cycles - self.record["done"]
            length = _even_length(left, length)
            late = 2 * length >= left or _even_length(left - length, length) <= SHORTEST_JUMP
            row = self._try_jump(length, late)
            if row is not None:
                self.restore_end()
                return row
            self.record["rejected"] += 1

    def _try_jump(self, length: int, late: bool) -> dict[str, Any] | None:
        """Compute a jump and return its row of the table, or None if it is rejected.  Collective.

        The length of the next jump is stored in ``record``.

        Args:
            length: Number of cycles of the jump.
            late: Whether this is one of the last jumps; if so, its error is estimated by a run in
                three parts.
        """
        plain = length <= SHORTEST_JUMP  # the fine run simulates all
        coarse = self._simulate([length], must=length == 1)
        fine = end = coarse
        if length > 1 and (plain or coarse):
            fine = end = self._simulate(_parts(length, 2), must=plain)
        if coarse and fine and not plain:
            end = self._extrapolate(coarse, fine, length)
        volume, depth, local = self._compare_runs(coarse, fine, end, length)
        over = max(local / (ACCURACIES_AIMED_AT * self._accuracy), self._friction_change(end) ** 2)
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
            self._estimate_errors(fine, end, length)
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

    def _simulate(self, parts: list[int], must: bool = False) -> _State | None:
        """Return the state after one simulated cycle for each of ``parts``.  Collective.

        Args:
            parts: Numbers of load cycles that each simulated cycle represents.
            must: Whether a step that does not converge raises ``NotConverged``; if False, None is
                returned.
        """
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
        return self.current_state()

    def _extrapolate(self, coarse: _State, fine: _State, length: int) -> _State | None:
        """Return the state after Richardson extrapolation.  Collective.

        Accumulated history variables of the fine run are corrected by their first-order error.  One
        step without motion or wear then restores equilibrium.  If it does not converge, None is
        returned.
        """
        more = _extrapolation_factor(length, 1, 2)
        for contact, *sums in zip(self.problem.contacts, self.end.sums, coarse.sums, fine.sums):
            start, one, two = sums
            _set_sums(
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
        return self.current_state()

    def _count(self, times: int) -> None:
        for contact in self.problem.contacts:
            contact.repeats = times

    def _compare_runs(self, coarse: Any, fine: Any, end: Any, length: int) -> tuple[float, ...]:
        """Return worn volume, largest wear depth and relative deviation of a jump.  Collective.

        The fine and the coarse run of a jump of n cycles differ by ``n^2 a + n^3 b``.  The last
        jump gives ``a``.  The deviation is the remaining part of the difference, relative to the
        wear in the jump.  It is about twice the error of the extrapolated state.

        Args:
            coarse, fine: States at the end of the coarse and the fine run, or None.
            end: State after extrapolation, or None if it did not converge.
            length: Number of cycles of the jump.

        Returns:
            Worn volume and largest wear depth at the end of the jump, over all ranks, and the
            deviation.  The deviation is infinite if a run did not converge, and for the first jump.
        """
        if end is None:
            return 0.0, 0.0, np.inf
        body, area, last = self.problem.body, self._area, self.table[-1] if self.table else None
        worn, off = end.depth - self.end.depth, np.zeros_like(area)
        if last and fine is not coarse and coarse:
            before = (self.end.depth - self.coarse.depth) / (
                1.0 + _extrapolation_factor(last["jump"], 1, 2)
            )
            off = fine.depth - coarse.depth - (length / last["jump"]) ** 2 * before
        volume, more, new = map(
            float, body.total([area @ depths for depths in (end.depth, worn, np.abs(off))])
        )
        depth, deeper, most = (body.largest(np.abs(depths)) for depths in (end.depth, worn, off))
        local = max(
            _ratio(new, more + WORN_SHARE * volume), _ratio(most, deeper + WORN_SHARE * depth)
        )
        return volume, depth, local if last and coarse else np.inf

    def _estimate_errors(self, fine: _State, end: _State, length: int) -> None:
        """Estimate the errors of a jump by a run in three parts.  Collective.

        The estimated errors are stored in ``record``.  The error of the extrapolated run in three
        parts is about a third of the error of the jump.  If the run does not converge, nothing is
        stored.

        Args:
            fine: State at the end of the fine run, in two parts.
            end: State at the end of the jump.
            length: Number of cycles of the jump.
        """
        third = self._simulate(_parts(length, 3))
        if third is None:
            return
        better = third.depth + _extrapolation_factor(length, 2, 3) * (third.depth - fine.depth)
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

    def _relative_errors(self) -> list[float]:
        """Return the estimated relative errors of volume, depth and profile.

        They are extrapolated from the jump that was also computed in three parts.  The error of a
        jump, relative to the wear in this jump, grows with the square of its length.  Volume errors
        accumulate, and decrease in proportion to the wear rate, since both satisfy the same
        linearised equation.  Other errors of the profile decay within one jump.
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
            _ratio(a, self.table[-1][name]) for a, name in zip(made, ("volume", "depth", "volume"))
        )
        fall = min(1.0, _ratio(float(rates[-1]), float(rates[row])))
        total = _ratio(float(np.minimum(rates, rates[-1]) @ cubes), float(rates[row] * cubes[row]))
        added = (total - fall) * volume
        return (
            [total * volume, added + fall * depth, added + fall * profile]
            if total > 0.0
            else [0.0] * 3
        )

    def _friction_change(self, end: _State | None) -> float:
        """Return the largest change of mu or p in a jump, relative to its target.  Collective.

        The target is ``FRICTION_CHANGE`` times the largest mu or p.

        Args:
            end: State at the end of the jump; with None, the change is zero.
        """
        if end is None:
            return 0.0
        largest, parts = self.problem.body.largest, []
        for columns in (slice(0, 2), slice(2, 4)):
            before, now = (side.friction[:, columns].ravel() for side in (self.end, end))
            parts.append(_ratio(largest(np.abs(now - before)), largest(np.maximum(before, now))))
        return max(parts) / FRICTION_CHANGE


def _even_length(left: int, length: int) -> int:
    """Return the length of the next jump, such that the remaining jumps have nearly equal lengths.

    Args:
        left: Number of remaining cycles.
        length: Largest length of a jump.
    """
    return -(-left // -(-left // length))


def _parts(length: int, number: int) -> list[int]:
    """Divide the length of a jump into integer parts that differ by at most one cycle."""
    return np.diff(np.arange(number + 1) * length // number).tolist()


def _extrapolation_factor(length: int, fewer: int, more: int) -> float:
    """Return the factor for Richardson extrapolation from two runs of a jump.

    The factor times the difference between both runs is the first-order correction of the run with
    more parts.  The first-order error of a simulated cycle that represents n cycles is proportional
    to ``n (n - 1)``, so it is zero for single cycles.

    Args:
        length: Number of cycles of the jump.
        fewer, more: Numbers of parts in which the two runs divide the jump.
    """
    one, two = (sum(n * (n - 1) for n in _parts(length, number)) for number in (fewer, more))
    return two / (one - two) if one > two else 0.0


def _ratio(amount: float, whole: float) -> float:
    """Return ``amount / whole``; zero if ``amount`` is zero, infinity if only ``whole`` is zero."""
    return amount / whole if amount > 0.0 and whole > 0.0 else np.inf if amount > 0.0 else 0.0


def _is_record(record: Any) -> bool:
    """Return whether a record read from a file is a complete record of a ``_Run``.

    Raises:
        ValueError, TypeError, KeyError or IndexError: the record has another structure.
    """
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
    """Folder with the checkpoints of a ``cycle_jump`` run.

    It contains two checkpoints of the problem and a record file.  The record file determines the
    names of the checkpoints and is replaced last.  If the computer stops at any time, the record
    and its checkpoints are complete.
    """

    def __init__(self, path: str | PathLike[str], run: _Run):
        self._path, self._run, self._comm = Path(path), run, run.problem.body.comm
        self._written: list[str] = []

    def read(self, cycles: int) -> None:
        """Continue the run from the checkpoints in the folder, if there are any.  Collective.

        Raises:
            ValueError: the record is invalid, or the run in the folder has completed more than
                ``cycles`` cycles.
        """
        record = by_first_rank(self._comm, lambda _: self._record(cycles))
        if record is None:
            return
        run = self._run
        run.record = record
        states = []
        for name in self._names():
            run.problem.load(self._path / name)
            states.append(run.current_state())
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
        """Return the names of both checkpoint files: after the coarse run, and after the jump."""
        return [f"{self._run.record['done']}{suffix}.npz" for suffix in ("_coarse", "")]

    def write(self) -> None:
        """Write the checkpoints and the record of the last jump.  Collective."""
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
                for name in self._written:  # checkpoints of the previous jump
                    with suppress(OSError):
                        (self._path / name).unlink()
        self._written = names


def _sums(contact: Contact) -> dict[str, np.ndarray]:
    """Return the accumulated nodal dissipation, slip and wear by name, each with ``shape=(n,)``."""
    return {name: values for name, values in contact.history.sums.items() if name != SLIP_KEPT}


def _set_sums(contact: Contact, sums: dict[str, np.ndarray]) -> None:
    """Replace the accumulated history variables from which the next step starts.

    Collective if a deformable surface wears.

    Args:
        contact: The contact.
        sums: New values by name, not negative.
    """
    sums = contact.history.sums | {name: frozen(values) for name, values in sums.items()}
    worn = contact.geometry.on_all_ranks(sums[OPPOSITE_WEAR]) if OPPOSITE_WEAR in sums else None
    contact.set_history(contact.history.replaced(sums=sums, worn=worn))
