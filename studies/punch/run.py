"""Runs of the punch for the study: kept on disk step by step, continued where they stopped.

A run has a directory with ``run.json`` (what it is), ``history.csv`` (totals, energies and tracked
nodes, one row a step), ``disc.npz`` (the contact disc), ``steps/0001.npz``, ... (the fields on it)
and one checkpoint.
"""

from __future__ import annotations

import csv
import json
import shutil
from dataclasses import asdict
from pathlib import Path

import dolfinx_contact as dc
from studies.punch.contact_map import ContactMap, gather
from studies.punch.model import CASES, Parameters, Punch, programme

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

FAILED = "not_converged.txt"
FIELDS = ("gap", "displacement", "dissipation", "slip_path")  # beside those of a ContactMap


class EnergyBalance:
    """The terms of the energy balance of each step, N mm.

    Equilibrium at the end of a step, ``K u = R + r`` with the platen's forces R and the reactions r,
    times the increment Delta u gives, because of ``r_n x_n = 0`` at the end of the step,

        F Delta d = Delta W + D + half Delta u.K.Delta u + sum r_n x_n(before)

    with F the force on the platen, d its displacement, W the elastic energy and ``D = - sum r_t.Delta u_t``
    the dissipation with forces of the end of the step. The last two terms are what the scheme
    adds; both are >= 0. With means of old and new forces (trapezoidal rule) the third term
    vanishes and the last is ``half sum (r_n x_n(before) - r_n(before) x_n)``. Neither D is the work of friction,
    ``work_of_friction``, which stands beside them: docs/dissipation.md says why.

    F is taken from the contact law, W from the form that UFL integrates over the body, so that the
    sums close only if equilibrium, complementarity and the bookkeeping of slip do.
    """

    def __init__(self, punch: Punch):
        self.punch = punch
        self.increment = fem.Function(punch.V)
        dx = ufl.dx(domain=punch.mesh, metadata={"quadrature_degree": 3})

        def energy(u):
            return fem.form(0.5 * ufl.inner(punch.stress(u), ufl.sym(ufl.grad(u))) * dx)

        self.forms = energy(punch.u), energy(self.increment)

    def open(self) -> None:
        """Remember the state before a step.  Collective."""
        contact = self.punch.contact
        self.u = self.punch.u.x.array.copy()
        self.before = contact.reaction.copy(), contact.gap.copy(), contact.dissipation.copy()
        self.energy, self.force = self._integral(0), contact.force()[2]
        self.depth = float(self.punch.approach.value)

    def close(self) -> dict[str, float]:
        """The terms of the step that was solved since ``open``.  Collective."""
        contact = self.punch.contact
        reaction, gap, dissipation = self.before
        self.increment.x.array[:] = self.punch.u.x.array - self.u
        force, moved = contact.force()[2], self.depth - float(self.punch.approach.value)
        end, mean = (
            -(forces[:, :2] * contact.slip_increment).sum()
            for forces in (contact.reaction, 0.5 * (reaction + contact.reaction))
        )
        closing = (contact.reaction[:, 2] * gap).sum()
        opening = (reaction[:, 2] * contact.gap).sum()
        work = (contact.dissipation - dissipation).sum()
        sums = np.array([end, mean, work, closing, opening])
        self.punch.comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
        end, mean, work, closing, opening = sums.tolist()
        row = {
            "platen_work": force * moved,
            "elastic_change": self._integral(0) - self.energy,
            "dissipation_end": end,
            "half_du_K_du": self._integral(1),
            "closing": closing,
        }
        row["residual"] = row["platen_work"] - sum(list(row.values())[1:])
        row["work_of_friction"] = work
        row["platen_work_mean"] = 0.5 * (self.force + force) * moved
        row["dissipation_mean"] = mean
        row["closing_mean"] = 0.5 * (closing - opening)
        row["residual_mean"] = (
            row["platen_work_mean"] - row["elastic_change"] - mean - row["closing_mean"]
        )
        return {name: float(value) for name, value in row.items()}

    def _integral(self, which: int) -> float:
        return self.punch.comm.allreduce(fem.assemble_scalar(self.forms[which]).real)


def settings(parameters: Parameters, points, mesh_options) -> dict:
    """All that the numbers of a run depend on, as JSON knows it."""
    everything = dict(parameters=asdict(parameters), points=list(points), mesh=mesh_options)
    return json.loads(json.dumps(everything))


def compute(parameters, directory, points=(), bar=None, comm=MPI.COMM_WORLD, **mesh_options) -> str:
    """Compute a run, or what is missing of it.  Collective.

    Args:
        parameters: Of the punch.
        directory: Of the run. What is there with other settings is removed.
        points: Nodes to track beside P, pairs (x, y), mm: the contact nodes nearest to them.
        bar: A tqdm bar that is moved on by one per step; None for none.
        comm: MPI communicator; a run continues on the number of ranks that it was begun on.
        mesh_options: Further arguments of ``punch_mesh``.

    Returns:
        The step that did not converge and why; empty if all did. Such a run is not tried again, as
        long as its directory is there.
    """
    directory = Path(directory)
    wanted = settings(parameters, points, mesh_options)
    displacements = programme(parameters)
    done, reason = comm.bcast(_found(directory, wanted) if comm.rank == 0 else None)
    if bar is not None:
        bar.update(done)
    if done == len(displacements) or reason:
        return reason
    punch = Punch(parameters, comm, **mesh_options)
    contact, balance = punch.contact, EnergyBalance(punch)
    positions = [(*xy, 0.0) for xy in (parameters.target, *points)]
    if done:
        punch.problem.load(_checkpoint(directory, done))
        punch.approach.value = -displacements[done - 1]
    else:
        _begin(punch, directory, wanted)
    comm.barrier()
    history = dc.History(punch.problem, directory / "history.csv", positions, resume=done)
    per_cycle = parameters.loading + parameters.unloading
    for index, displacement in enumerate(displacements[done:], start=done):
        balance.open()
        punch.approach.value = -displacement
        try:
            step = punch.problem.solve()
        except dc.NotConverged as error:
            reason = f"step {index + 1}: {error}"
            if comm.rank == 0:
                (directory / FAILED).write_text(reason)
            return reason
        cycle = index // per_cycle + 1
        history.record(step, cycle=cycle, displacement=displacement, **balance.close())
        names = (*ContactMap._fields[2:], *FIELDS)
        fields = {name: _gathered(punch, getattr(contact, name)) for name in names}
        if comm.rank == 0:
            np.savez(directory / "steps" / f"{index + 1:04d}.npz", **fields)
        punch.problem.save(_checkpoint(directory, index + 1))  # last: now the step is done
        if comm.rank == 0:
            _checkpoint(directory, index).unlink(missing_ok=True)
        if bar is not None:
            bar.update()
    return ""


def _begin(punch, directory: Path, wanted: dict) -> None:
    """An empty directory with what the run is.  Collective."""
    disc, area, head = gather(punch), _gathered(punch, punch.contact.area), punch.head()
    if punch.comm.rank == 0:
        shutil.rmtree(directory, ignore_errors=True)
        (directory / "steps").mkdir(parents=True)
        np.savez(directory / "disc.npz", x=disc.x, faces=disc.faces, area=area)
        description = json.dumps({"settings": wanted, "head": head}, indent=1)
        (directory / "run.json").write_text(description + "\n")


def _checkpoint(directory: Path, step: int) -> Path:
    return directory / f"checkpoint_{step:04d}.npz"


def _found(directory: Path, wanted: dict) -> tuple[int, str]:
    """Steps that are kept, and what did not converge then; nothing if they have other settings."""
    try:
        found = json.loads((directory / "run.json").read_text())["settings"]
    except (FileNotFoundError, json.JSONDecodeError):
        found = None
    if found != wanted:
        return 0, ""
    steps = [int(file.stem[-4:]) for file in directory.glob("checkpoint_*.npz")]
    failed = directory / FAILED
    return max(steps, default=0), failed.read_text() if failed.exists() else ""


def _gathered(punch, values):
    """Nodal values of all ranks in the order of ``gather``, on rank 0; None on the others."""
    numbering = punch.V.dofmap.index_map
    mine = numbering.local_to_global(punch.contact.nodes.astype(np.int32)), values
    parts = punch.comm.gather(mine)
    if parts is None:
        return None
    node, values = (np.concatenate(part) for part in zip(*parts, strict=True))
    return values[np.argsort(node)]


class Run:
    """What ``compute`` left in a directory, read by one rank.

    Attributes:
        parameters: Of the punch.
        head: What was computed, and by what.
        points: Tracked nodes beside P are those nearest to these, mm.
        table: Columns of the history, arrays over the steps.
        area: Nodal areas, ``shape=(n,)``, mm^2.
    """

    def __init__(self, directory):
        self.directory = Path(directory)
        description = json.loads((self.directory / "run.json").read_text())
        self.head = description["head"]
        stored = description["settings"]["parameters"]
        self.points = description["settings"]["points"]
        lists = {key: tuple(value) for key, value in stored.items() if isinstance(value, list)}
        self.parameters = Parameters(**{**stored, **lists})
        with open(self.directory / "history.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.table = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
        disc = np.load(self.directory / "disc.npz")
        self.x, self.faces, self.area = disc["x"], disc["faces"], disc["area"]
        self.friction = CASES[self.parameters.case]

    @property
    def case(self) -> str:
        return self.parameters.case

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
        return ContactMap(self.x, self.faces, *(fields[name] for name in ContactMap._fields[2:]))

    def dissipation(self, cycle: int):
        """Work of friction per node up to the end of a cycle, ``shape=(n,)``, N mm."""
        return self.fields(self.unloaded(cycle))["dissipation"] if cycle else 0 * self.area
