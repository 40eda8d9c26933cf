"""An elastic cylinder pressed cyclically on a rigid plane, with the cases of [dSFMH07, Section 3].

A steel punch of radius and height 10 mm stands on a plane; its top face goes 0.1 mm down in five
increments and up again in ten.  Poisson's effect drives the contact nodes outwards against
friction, which is isotropic (case A), orthotropic with the associated slip rule (B), or orthotropic
with a slip rule of its own (C).  Try ``--help``; everything here can be imported by other scripts.

Units: mm, N, MPa.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact._dolfinx import functionspace
from dolfinx_contact._dolfinx import version as dolfinx_version

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import locate_entities
from mpi4py import MPI
from petsc4py import PETSc
from punch_fields import FieldWriter
from punch_figure import draw, gather
from punch_mesh import CONTACT, TOP, punch_mesh
from tqdm import tqdm

CASES = {  # [dSFMH07, Table 1]
    "A": dict(mu=(0.20, 0.20), p=(0.20, 0.20)),
    "B": dict(mu=(0.30, 0.15), p=(0.30, 0.15)),
    "C": dict(mu=(0.30, 0.15), p=(0.05, 0.20)),
}


@dataclass(frozen=True)
class Parameters:
    """A run of the punch: what the paper gives, and what its text leaves open."""

    case: str = "C"
    cycles: int = 1
    tol: float = 1e-10
    refine: int = 0
    depth: float = 0.1  # displacement of the top face when loaded
    loading: int = 5  # increments
    unloading: int = 10
    radius: float = 10.0
    height: float = 10.0
    young: float = 210e3
    poisson: float = 0.3
    # Left open by the paper:
    unload_to: float = 0.02  # displacement of the top face when unloaded
    top: str = "bonded"  # "bonded": the top face does not move sideways; "free": it does
    point: tuple[float, float] | None = None  # P is the contact node nearest to this

    @property
    def target(self) -> tuple[float, float]:
        """Where P is looked for: off both friction axes, at three quarters of the radius."""
        return self.point or (0.75 * self.radius / 2**0.5, 0.75 * self.radius / 2**0.5)


class Punch:
    """Body, plane, friction and supports; ``press`` computes one load step after another.

    Args:
        parameters: What to compute.
        comm: MPI communicator.
        mesh_options: Further arguments of ``punch_mesh``, such as ``divisions``.
    """

    def __init__(self, parameters: Parameters, comm=MPI.COMM_WORLD, **mesh_options):
        self.parameters, self.comm = parameters, comm
        size = dict(radius=parameters.radius, height=parameters.height)
        punch = punch_mesh(comm, parameters.refine, **size, **mesh_options)
        self.mesh, self.facet_tags = punch.mesh, punch.facet_tags
        self.V = functionspace(self.mesh, ("Lagrange", 1, (3,)))
        self.u = fem.Function(self.V, name="displacement")
        self.approach = fem.Constant(self.mesh, PETSc.ScalarType(0))  # u_z of the top face

        # 2 x 2 x 2 Gauss points, as usual for bricks of eight nodes
        dx = ufl.dx(domain=self.mesh, metadata={"quadrature_degree": 3})
        v = ufl.TestFunction(self.V)
        self.F = ufl.inner(self.stress(self.u), ufl.sym(ufl.grad(v))) * dx
        self.bcs = self._supports()

        plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
        friction = dc.Friction(**CASES[parameters.case])
        self.contact = dc.Contact(self.V, punch.facet_tags.find(CONTACT), plane, friction)
        self.problem = dc.ContactProblem(
            self.F, self.u, [self.contact], bcs=self.bcs, tol=parameters.tol
        )
        self.tracked = self._nearest_node(parameters.target)

    def stress(self, u):
        """Hooke's law, as a UFL expression."""
        E, nu = self.parameters.young, self.parameters.poisson
        strain = ufl.sym(ufl.grad(u))
        lame = E * nu / ((1 + nu) * (1 - 2 * nu))
        return lame * ufl.tr(strain) * ufl.Identity(3) + E / (1 + nu) * strain

    def _supports(self):
        """The top face goes down; sideways it is bonded, or held by as little as possible."""
        fdim, R, H = 2, self.parameters.radius, self.parameters.height
        self.mesh.topology.create_connectivity(0, 3)

        def fix(component, dim, entities, value=None):
            V = self.V.sub(component)
            value = fem.Constant(self.mesh, PETSc.ScalarType(0)) if value is None else value
            return fem.dirichletbc(value, fem.locate_dofs_topological(V, dim, entities), V)

        def node_at(*point):
            def close(x):
                return np.linalg.norm(x.T - point, axis=1) < 1e-6 * R

            return locate_entities(self.mesh, 0, close)

        top = self.facet_tags.find(TOP)
        down = fix(2, fdim, top, self.approach)
        if self.parameters.top == "bonded":
            return [down, fix(0, fdim, top), fix(1, fdim, top)]
        if self.parameters.top == "free":
            centre, rim = node_at(0, 0, H), node_at(R, 0, H)
            return [down, fix(0, 0, centre), fix(1, 0, centre), fix(1, 0, rim)]
        raise ValueError(f'top must be "bonded" or "free", got {self.parameters.top!r}.')

    def _nearest_node(self, target) -> int | None:
        """Index of the contact node nearest to ``target`` on the rank that owns it, else None."""
        distance = np.linalg.norm(self.contact.x[:, :2] - target, axis=1)
        mine = distance.min(initial=np.inf)
        _, owner = self.comm.allreduce((mine, self.comm.rank), op=MPI.MINLOC)
        return int(distance.argmin()) if owner == self.comm.rank else None

    def press(self, displacement: float) -> dict:
        """Move the top face to ``displacement`` mm below its first position; one load step.

        Returns:
            What the JSON file says about the step; forces in N, the same on all ranks.
        """
        self.approach.value = -displacement
        step = self.problem.solve()
        contact = self.contact
        tangential = np.linalg.norm(contact.reaction[:, :2], axis=1).sum()
        return {
            "displacement": displacement,
            "normal_reaction": float(contact.force() @ contact.plane.normal),
            "tangential_reaction_sum": float(self.comm.allreduce(tangential)),
            "open": int(step.counts.open),
            "stick": int(step.counts.stick),
            "slip": int(step.counts.slip),
            "error": float(step.error),
            "bipotential_gap": float(step.bipotential_gap),
            "iterations": int(step.iterations),
            "seconds": float(step.seconds),
            "point_reaction": self._at_point(contact.reaction),
            "point_slip_increment": self._at_point(contact.slip_increment),
        }

    def _at_point(self, values) -> list[float]:
        """Row of the tracked node P, on all ranks."""
        mine = None if self.tracked is None else values[self.tracked].tolist()
        return next(row for row in self.comm.allgather(mine) if row is not None)

    def head(self) -> dict:
        """What was computed, and by what."""
        return {
            "case": self.parameters.case,
            "parameters": asdict(self.parameters),
            "friction": CASES[self.parameters.case],
            "versions": {
                "dolfinx": dolfinx_version,
                "petsc": ".".join(map(str, PETSc.Sys.getVersion())),
                "dolfinx_contact": version("dolfinx_contact"),
            },
            "unknowns": self.V.dofmap.index_map.size_global * self.V.dofmap.index_map_bs,
            "contact_nodes": self.comm.allreduce(self.contact.nodes.size),
            "point": self._at_point(self.contact.x),
            "ranks": self.comm.size,
        }


def programme(parameters: Parameters) -> list[float]:
    """Displacements of the top face at the end of every load step [dSFMH07, Fig. 2]."""
    low, high = parameters.unload_to, parameters.depth
    if not 0 <= low < high:
        raise ValueError(f"unload_to must lie in [0, depth), got {low} with depth {high}.")
    start, steps = 0.0, []
    for _ in range(parameters.cycles):
        steps += np.linspace(start, high, parameters.loading + 1)[1:].tolist()
        steps += np.linspace(high, low, parameters.unloading + 1)[1:].tolist()
        start = low
    return steps


def run(punch: Punch, after_step=lambda index, record: None) -> list[dict]:
    """Compute the whole programme with a progress bar, and return the records of all steps."""
    records = []
    displacements = programme(punch.parameters)
    bar = tqdm(displacements, f"case {punch.parameters.case}", disable=punch.comm.rank != 0)
    for index, displacement in enumerate(bar):
        record = punch.press(displacement)
        records.append(record)
        after_step(index, record)
        counts = "{open} open, {stick} stick, {slip} slip".format(**record)
        bar.set_postfix_str(f"{displacement:.3f} mm, error {record['error']:.0e}, {counts}")
    return records


def table(records: list[dict]) -> str:
    """The records as text, one line a step."""
    lines = [
        "  step    d [mm]   normal [N]  tangential [N]   open stick  slip   error  iter.  seconds"
    ]
    for index, record in enumerate(records, start=1):
        lines.append(
            f"{index:6d}"
            "{displacement:10.4f}{normal_reaction:13.1f}{tangential_reaction_sum:16.1f}"
            "{open:7d}{stick:6d}{slip:6d}{error:8.0e}{iterations:7d}{seconds:9.3f}".format(**record)
        )
    return "\n".join(lines)


def arguments(argv=None) -> argparse.Namespace:
    default = Parameters()
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    add = parser.add_argument
    add("--case", choices=CASES, default=default.case, help="friction, Table 1 of the paper")
    add("--cycles", type=int, default=default.cycles, help="of loading and unloading")
    add("--unload-to", type=float, default=default.unload_to, help="end of unloading, mm")
    add("--loading", type=int, default=default.loading, help="increments of a loading")
    add("--unloading", type=int, default=default.unloading, help="increments of an unloading")
    add("--top", choices=("bonded", "free"), default=default.top, help="top face, sideways")
    add("--point", type=float, nargs=2, metavar=("X", "Y"), help="P, mm; 3/4 R at 45 degrees")
    add("--tol", type=float, default=default.tol, help="error at which a step ends")
    add("--refine", type=int, default=default.refine, help="0 is the paper's mesh; 1 doubles it")
    add("--json", type=Path, metavar="FILE", help="numbers of all steps; DIR/punch.json")
    add("--output", type=Path, metavar="DIR", default=Path("results/punch"), help="what is written")
    return parser.parse_args(argv)


def main(argv=None) -> None:
    options = vars(arguments(argv))
    output = options.pop("output")
    json_file = options.pop("json") or output / "punch.json"
    point = options.pop("point")
    parameters = Parameters(**options, point=None if point is None else tuple(point))

    punch = Punch(parameters)
    root = punch.comm.rank == 0
    steps = len(programme(parameters))
    loaded = steps - 1 - parameters.unloading
    shown = {loaded: "loaded", (loaded + steps - 1) // 2: "unloading", steps - 1: "unloaded"}
    maps = []
    output.mkdir(parents=True, exist_ok=True)
    with FieldWriter(punch, output) as fields:

        def keep(index, record):
            fields.write(index + 1)
            if index in shown:
                maps.append((f"{shown[index]}, {record['displacement']:g} mm", gather(punch)))

        records = run(punch, keep)
    head = punch.head()
    if root:
        print(table(records))
        json_file.parent.mkdir(parents=True, exist_ok=True)
        json_file.write_text(json.dumps({"head": head, "steps": records}, indent=1) + "\n")
        title = "Punch, case {case}: $\\mu$ = {friction[mu]}, $p$ = {friction[p]}".format(**head)
        title += f"; cycle {parameters.cycles}; x to the right, y up"
        draw(maps, title, output / "punch.png", head["point"])
        print(f"\npicture  {output / 'punch.png'}\nnumbers  {json_file}\nParaView {fields.path}")


if __name__ == "__main__":
    main()
