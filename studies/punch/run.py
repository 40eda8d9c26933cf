# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Runs of the punch for the study: kept on disk step by step, continued where they stopped.

A run has a directory with ``run.json`` (what it is), ``history.csv`` (totals, energies and tracked nodes, one row a
step), ``disc.npz`` (the contact disc), ``steps/0001.npz``, ... (the fields on it) and one checkpoint.
"""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

import dolfinx_contact as dc
from studies.punch.contact_map import VALUES, ContactMap, at_nodes, gather
from studies.punch.model import Parameters, Punch, programme

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from tqdm import tqdm

COMM = MPI.COMM_WORLD
FAILED = "not_converged.txt"
FIELDS = (*VALUES, "displacement", "dissipation")  # kept after every step


class EnergyBalance:
    """The terms of the energy balance of each step, N mm.

    Equilibrium at the end of a step, ``K u = R + r`` with the platen's forces R and the reactions r, times the
    increment Delta u gives, because of ``r_n x_n = 0`` at the end of the step,

        F Delta d = Delta W + D + half Delta u.K.Delta u + sum r_n x_n(before)

    with F the force on the platen (from the contact law), d its displacement, W the elastic energy (by UFL over the
    body) and ``D = - sum r_t.Delta u_t`` with forces of the end of the step. The last two terms are what the scheme
    adds; both are >= 0. With means of old and new forces the third term vanishes and the last is
    ``half sum (r_n x_n(before) - r_n(before) x_n)``. Neither D is the work of friction, ``frictional_work``, which
    stands beside them: docs/dissipation.md says why.
    """

    def __init__(self, punch: Punch):
        self.punch, self.w = punch, fem.Function(punch.V)
        dx = ufl.dx(domain=punch.mesh, metadata={"quadrature_degree": 3})
        strain = ufl.sym(ufl.grad(self.w))
        self.form = fem.form(0.5 * ufl.inner(punch.stress(self.w), strain) * dx)

    def _energy(self, values) -> float:
        """Elastic energy of a displacement."""
        self.w.x.array[:] = values
        return self.punch.comm.allreduce(fem.assemble_scalar(self.form).real)

    def open(self) -> None:
        """Remember the state before a step.  Collective."""
        contact, u = self.punch.contact, self.punch.u.x.array.copy()
        nodal = contact.reaction, contact.gap, contact.dissipation, contact.displacement[:, :2]
        totals = self._energy(u), contact.force()[2], -float(self.punch.approach.value)
        self.state = u, *nodal, *totals

    def close(self) -> dict[str, float]:
        """The terms of the step that was solved since ``open``.  Collective."""
        u0, r0, gap0, work0, at0, W0, force0, depth0 = self.state
        self.open()
        u1, r1, gap1, work1, at1, W1, force1, depth1 = self.state
        moved, slip = depth1 - depth0, at1 - at0  # of the whole way, as the platen's work
        frictions = -r1[:, :2] * slip, -0.5 * (r0 + r1)[:, :2] * slip, work1 - work0
        nodal = (*frictions, r1[:, 2] * gap0, r0[:, 2] * gap1)
        sums = self.punch.comm.allreduce(np.array([values.sum() for values in nodal]))
        end, mean, friction, closing, opening = sums
        terms = {
            "elastic_change": W1 - W0,
            "dissipation_end": end,
            "half_du_K_du": self._energy(u1 - u0),
            "closing": closing,
        }
        work, left = force1 * moved, 0.5 * (force0 + force1) * moved - (W1 - W0) - mean
        row = {"platen_work": work, **terms, "residual": work - sum(terms.values())}
        row |= {"work_of_friction": friction, "residual_mean": left - 0.5 * (closing - opening)}
        return {name: float(value) for name, value in row.items()}


def compute(parameters, directory, points=(), bar=None, **mesh_options) -> str:
    """Compute a run, or what is missing of it, on the number of ranks that it was begun on.  Collective.

    What is in ``directory`` with other settings is removed; ``points`` are nodes to track beside P, pairs (x, y), mm;
    ``bar``, of tqdm, is moved on by one per step. Returns the step that did not converge and why; empty if all did.
    Such a run is not tried again, as long as its directory is there.
    """
    directory, bar = Path(directory), tqdm(disable=True) if bar is None else bar
    settings = dict(parameters=asdict(parameters), points=list(points), mesh=mesh_options)
    settings = json.loads(json.dumps(settings))  # all that the numbers depend on, as JSON knows it
    displacements = programme(parameters)
    done, reason = COMM.bcast(_found(directory, settings) if COMM.rank == 0 else None)
    bar.update(done)
    if done == len(displacements) or reason:
        return reason
    punch = Punch(parameters, **mesh_options)
    contact, balance = punch.contact, EnergyBalance(punch)
    positions = [(*xy, 0.0) for xy in (parameters.target, *points)]
    if done:
        punch.problem.load(_checkpoint(directory, done))
        punch.move_top(displacements[done - 1])
    else:
        _begin(punch, directory, settings)
    COMM.barrier()
    history = dc.History(punch.problem, directory / "history.csv", points=positions, resume=done)
    for number, displacement in enumerate(displacements[done:], start=done + 1):
        balance.open()
        punch.move_top(displacement)
        try:
            step = punch.problem.solve()
        except dc.NotConverged as error:
            reason = f"step {number}: {error}"
            if COMM.rank == 0:
                (directory / FAILED).write_text(reason)
            return reason
        cycle = (number - 1) // (parameters.loading + parameters.unloading) + 1
        history.record(step, cycle=cycle, displacement=displacement, **balance.close())
        _, *fields = at_nodes(punch, *(getattr(contact, name) for name in FIELDS))
        if COMM.rank == 0:
            np.savez(directory / "steps" / f"{number:04d}.npz", **dict(zip(FIELDS, fields)))
        punch.problem.save(_checkpoint(directory, number))  # last: now the step is done
        if COMM.rank == 0:
            _checkpoint(directory, number - 1).unlink(missing_ok=True)
        bar.update()
    return ""


def _begin(punch, directory: Path, settings: dict) -> None:
    """An empty directory with what the run is.  Collective."""
    disc, (_, area), head = gather(punch), at_nodes(punch, punch.contact.area), punch.head()
    if COMM.rank == 0:
        shutil.rmtree(directory, ignore_errors=True)
        (directory / "steps").mkdir(parents=True)
        np.savez(directory / "disc.npz", x=disc.x, faces=disc.faces, area=area)
        description = json.dumps({"settings": settings, "head": head}, indent=1)
        (directory / "run.json").write_text(description + "\n")


def _checkpoint(directory: Path, step: int) -> Path:
    return directory / f"checkpoint_{step:04d}.npz"


def _found(directory: Path, settings: dict) -> tuple[int, str]:
    """Steps that are kept, and what did not converge then; nothing if they have other settings."""
    try:
        found = json.loads((directory / "run.json").read_text())["settings"]
    except (FileNotFoundError, json.JSONDecodeError):
        found = None
    if found != settings:
        return 0, ""
    steps = [int(file.stem[-4:]) for file in directory.glob("checkpoint_*.npz")]
    failed = directory / FAILED
    return max(steps, default=0), failed.read_text() if failed.exists() else ""


class Run:
    """What ``compute`` left in a directory, read by one rank.

    ``table`` has the columns of the history; ``x``, ``faces``, ``area`` are the contact disc's nodes, quadrilaterals
    and nodal areas, mm^2.
    """

    def __init__(self, directory):
        self.directory = Path(directory)
        description = json.loads((self.directory / "run.json").read_text())
        self.head, settings = description["head"], description["settings"]
        self.points, stored = settings["points"], settings["parameters"]
        lists = {key: tuple(value) for key, value in stored.items() if isinstance(value, list)}
        self.parameters = Parameters(**{**stored, **lists})
        self.table = np.genfromtxt(self.directory / "history.csv", delimiter=",", names=True)
        disc = np.load(self.directory / "disc.npz")
        self.x, self.faces, self.area = disc["x"], disc["faces"], disc["area"]

    def loaded(self, cycle: int) -> int:
        """Number of the step at whose end the punch is fully loaded, from 1."""
        return self.unloaded(cycle) - self.parameters.unloading

    def unloaded(self, cycle: int) -> int:
        """Number of the last step of a cycle; 0 for cycle 0."""
        return cycle * (self.parameters.loading + self.parameters.unloading)

    def fields(self, step: int):
        """All nodal fields after a step, by name."""
        return np.load(self.directory / "steps" / f"{step:04d}.npz")

    def disc(self, step: int) -> ContactMap:
        """The contact disc after a step."""
        fields = self.fields(step)
        return ContactMap(self.x, self.faces, *(fields[name] for name in VALUES))

    def dissipation(self, cycle: int):
        """Work of friction per node up to the end of a cycle, ``shape=(n,)``, N mm."""
        return self.fields(self.unloaded(cycle))["dissipation"] if cycle else 0 * self.area
