# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Wear over many cycles: one that is simulated counts for many, and the error that this makes says for how many it may."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dolfinx_contact.results.record import NotConverged
from dolfinx_contact.support.checks import positive
from dolfinx_contact.support.collective import agree, by_first_rank, raised_together
from dolfinx_contact.support.progress import progress_bar

if TYPE_CHECKING:
    from dolfinx_contact.problem import ContactProblem

# The shortest jump: its halves are cycles simulated one by one.
SHORTEST = 2

# Jumps aim at this part of the accuracy; from one to the next they grow and shrink by these factors at most.
SAFETY, GROW, SHRINK = 0.7, 4.0, 0.1

# Part of all that is worn, of which a jump may have the accuracy as its own error, however little it wears itself.
SHARE = 0.05

RECORD = "record.json"

ERRORS = ("volume_error", "depth_error", "profile_error")


@dataclass(frozen=True)
class CycleJump:
    """What ``cycle_jump`` returns.

    Attributes:
        cycles: Number of cycles.
        simulated: Cycles that were simulated for it, including those of rejected jumps.
        accepted, rejected: Number of jumps.
        volume: Worn, of all contacts.
        depth: The largest.
        volume_error: Estimated error of the volume, over it.
        depth_error: The largest of the estimated errors of the nodes' depths, over the largest depth.
        profile_error: The integral of these errors, over the volume.
        reached: Whether all three are at most what was asked for.
        table: A dictionary for each accepted jump: ``cycle`` at its end, ``jump``, its length, and of the attributes above
            ``volume``, ``depth``, the errors and ``simulated``.

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
    path: str | os.PathLike[str] | None = None,
    monitor: Callable[[dict[str, Any]], object] | None = None,
) -> CycleJump:
    """Wear through a number of cycles, of which few are simulated.  Collective.

    In a jump of n cycles, what each step of one simulated cycle wears, works and slips counts n times (``contact.repeats``).  Two
    runs go side by side: a coarse one with a simulated cycle for each jump, and a fine one with two, each for half of it.  The fine
    one is the result, their difference its estimated error: of a method of first order, half of the coarse one's.  Lengths are
    chosen so that what a jump adds to this is ``accuracy`` of what it wears, or a twentieth of that of all that is worn; a jump that adds more,
    or in which a step does not converge, is made again, shorter.  The halves of the shortest jump are two cycles simulated one by one, so programmes
    begin with these: as long as stick and slip have not settled, twice the first is not the first and the second.

    Args:
        problem: The ContactProblem, in the state in which the programme begins.
        cycle: Function of the number of cycles done that takes the problem through one cycle by ``problem.solve()``.  It is
            called again from earlier states, so all loads that its steps need are set in it.
        cycles: How many.
        accuracy: Relative, of worn volume, largest depth and profile.
        longest: Jump.
        path: Folder of checkpoints, written after every jump; if there are some, the programme goes on from there.
        monitor: None, or a function of a row of the table, called after every jump in the state at its end.

    Returns:
        A ``CycleJump``; the problem is in the state after the last cycle.  On a terminal there is a progress bar if tqdm is installed.

    Raises:
        NotConverged: a step of cycles simulated one by one did not converge; after any error the problem is at the end of the last jump.
        ValueError: no contact wears, numbers that make no sense, a folder of another programme.

    Example:
        >>> def cycle(done):
        ...     for way in (0.002, 0.0):
        ...         held.value = (way, 0, -0.01)
        ...         problem.solve()
        >>> dc.cycle_jump(problem, cycle, 4).table[-1]["cycle"]
        4
    """
    comm = problem.body.comm
    with raised_together(comm):
        cycles, accuracy = int(positive("cycles", cycles, whole=True)), positive("accuracy", accuracy, finite=True)  # fmt: skip
        longest = positive("longest", longest)
        _check(problem, cycle, monitor)
    agree(comm, cycles=cycles, accuracy=accuracy, longest=longest, path=None if path is None else str(path))  # fmt: skip
    run = _Run(problem, cycle, accuracy, longest)
    folder = None if path is None else _Folder(path, run)
    if folder is not None:
        folder.read(cycles)
    _jump_on(run, cycles, folder, monitor)
    return run.found()


def _jump_on(run: _Run, cycles: int, folder: _Folder | None, monitor: Callable | None) -> None:
    """Jump until all cycles are done; whatever happens the problem is at the end of the last jump.  Collective."""
    comm = run.problem.body.comm
    with progress_bar(comm.rank, cycles) as shown:
        try:
            while run.record["done"] < cycles:
                row = run.jump(cycles)
                if folder is not None:
                    folder.write()
                if monitor is not None:
                    with raised_together(comm):
                        monitor(row)
                shown(run.record["done"])
        finally:
            run.show()


def _check(problem: Any, cycle: object, monitor: object) -> None:
    if not any(contact.wear is not None for contact in problem.contacts):
        raise ValueError(
            "no contact of the problem has a law of wear: contact.wear = dc.Wear(...)."
        )
    if not callable(cycle):
        raise ValueError(f"cycle must be a function of the number of cycles done, got {cycle!r}.")
    if not (monitor is None or callable(monitor)):
        raise ValueError(f"monitor must be a function of a row of the table, got {monitor!r}.")


class _Run:
    """The two runs of a programme, and what has been made of it.

    Attributes:
        fine, coarse: Snapshot of the problem and depths of this rank's nodes, of each run; the same object as long as all
            cycles were simulated.
        record: What a checkpoint has beside them: cycles ``done`` and ``simulated``, jumps ``rejected``, length of the
            ``next`` one, and the ``table``.
    """

    def __init__(self, problem: ContactProblem, cycle: Callable, accuracy: float, longest: float):
        self.problem, self._cycle = problem, cycle
        self._accuracy, self._longest = accuracy, longest
        self._worn = [contact for contact in problem.contacts if contact.wear is not None]
        self._area = np.concatenate([area for c in self._worn for area in (c.whole_area, c.opposite_area)])  # fmt: skip
        self.fine = self.coarse = self.present()
        self.record: dict[str, Any] = {"done": 0, "simulated": 0, "rejected": 0, "next": float(SHORTEST), "table": []}  # fmt: skip

    def present(self) -> tuple:
        """Snapshot and depths of the present state."""
        depths = [depth for c in self._worn for depth in (c.wear_depth, c.opposite_wear_depth)]
        return self.problem.snapshot(), np.concatenate(depths)

    def show(self) -> None:
        """Put the problem into the state after the last jump."""
        self._count(1)
        self.problem.restore(self.fine[0])

    def found(self) -> CycleJump:
        table, record = self.table, self.record
        last = table[-1]
        errors = [last[name] for name in ERRORS]
        reached = max(errors) <= self._accuracy
        worn = last["volume"], last["depth"]
        return CycleJump(record["done"], record["simulated"], len(table), record["rejected"], *worn, *errors, reached, table)  # fmt: skip

    @property
    def table(self) -> list[dict[str, Any]]:
        return self.record["table"]

    def jump(self, cycles: int) -> dict[str, Any]:
        """Make the next jump towards so many cycles; returns its row of the table.  Collective."""
        while True:
            length = int(max(min(self.record["next"], self._longest), SHORTEST))
            length = min(length, cycles - self.record["done"])
            row = self._tried(length)
            if row is not None:
                self.record["done"] += length
                self.table.append(row)
                self.show()
                return row
            self.record["rejected"] += 1

    def _tried(self, length: int) -> dict[str, Any] | None:
        """The row of a jump of so many cycles, None where it is rejected; says how long the next one may be.  Collective."""
        plain = length <= SHORTEST  # its halves are cycles simulated one by one
        exact = plain and self.fine is self.coarse
        fine = self._through(self.fine, [length - length // 2, length // 2], plain)
        coarse = fine and self._through(self.coarse, [length], plain and not exact)
        volume, depth, errors, local = self._compared(fine, coarse)
        coarse, errors = (fine, [0.0] * len(ERRORS)) if exact else (coarse, errors)
        accepted = plain or local <= self._accuracy
        over = local / (SAFETY * self._accuracy)
        factor = min(max(1.0 / over, SHRINK), GROW if accepted else 0.5) if over > 0.0 else GROW
        self.record["next"] = max(factor * length, float(SHORTEST))
        if not accepted:
            return None
        self.fine, self.coarse = fine, coarse
        return {
            "cycle": self.record["done"] + length,
            "jump": length,
            "volume": volume,
            "depth": depth,
            **dict(zip(ERRORS, errors)),
            "simulated": self.record["simulated"],
        }

    def _through(self, state: Any, parts: list[int], must: bool) -> tuple | None:
        """The state after a cycle for each of ``parts`` that counts so many times; None where it does not converge, unless it must."""
        self.problem.restore(state[0])
        done = self.record["done"]
        try:
            for part in filter(None, parts):
                self._count(part)
                with raised_together(self.problem.body.comm):
                    self._cycle(done)
                self.record["simulated"] += 1
                done += part
        except NotConverged:
            if must:
                raise
            return None
        return self.present()

    def _count(self, times: int) -> None:
        for contact in self.problem.contacts:
            contact.repeats = times

    def _compared(self, fine: Any, coarse: Any) -> tuple[float, float, list[float], float]:
        """Volume and largest depth at the end of a jump, the errors, and those that this jump has made, over what it wears.

        All reduced over the ranks.  Errors are infinite where a run did not converge.
        """
        if fine is None:
            return 0.0, 0.0, [np.inf] * len(ERRORS), np.inf
        body, area = self.problem.body, self._area
        other = fine if coarse is None else coarse
        worn, off = fine[1] - self.fine[1], fine[1] - other[1]
        made = off - (self.fine[1] - self.coarse[1])
        integrals = [area @ of for of in (fine[1], worn, off, np.abs(off), np.abs(made))]
        volume, more, missing, profile, new = map(float, body.total(integrals))
        depth, deeper, most, highest = (
            body.largest(np.abs(of)) for of in (fine[1], worn, off, made)
        )
        errors = [_part(abs(missing), volume), _part(most, depth), _part(profile, volume)]
        local = max(_part(new, more + SHARE * volume), _part(highest, deeper + SHARE * depth))
        return volume, depth, errors, np.inf if coarse is None else local


def _part(of: float, whole: float) -> float:
    """``of`` over ``whole``, none of nothing."""
    return of / whole if of > 0.0 and whole > 0.0 else np.inf if of > 0.0 else 0.0


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
        run.fine, run.coarse, self._written = states[-1], states[0], self._names()

    def _record(self, cycles: int) -> dict | None:
        file = self._path / RECORD
        try:
            record = json.loads(file.read_text())
            done = record["done"]
            complete = (
                done == record["table"][-1]["cycle"]
                and {"simulated", "rejected", "next", "exact"} <= record.keys()
            )
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
                f"{self._path} has a programme that is {done} cycles on, further than cycles = {cycles}."
            )
        return record

    def _names(self) -> list[str]:
        """Names of the checkpoints, the coarse run's first, the fine one's last."""
        record = self._run.record
        return [f"{record['done']}_coarse.npz"] * (not record["exact"]) + [f"{record['done']}.npz"]

    def write(self) -> None:
        """Write the state after the last jump.  Collective."""
        run = self._run
        run.record["exact"] = run.fine is run.coarse
        names = self._names()
        for name, state in zip(names, [run.coarse, run.fine][-len(names) :]):
            run.problem.restore(state[0])
            run.problem.save(self._path / name)
        with raised_together(self._comm):
            if self._comm.rank == 0:
                unfinished = self._path / f"{RECORD}.unfinished"
                with open(unfinished, "w") as file:
                    json.dump(run.record, file)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(unfinished, self._path / RECORD)
                for name in self._written:  # before
                    with suppress(OSError):
                        (self._path / name).unlink()
        self._written = names
