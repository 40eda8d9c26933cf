# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""An elastic cylinder pressed cyclically on a rigid plane with orthotropic friction; units: mm, N, MPa.

A steel punch of radius and height 10 mm stands on a plane; its top face goes 0.1 mm down in five increments and up
again in ten. Poisson's effect drives the contact nodes outwards against friction, which is isotropic (case A),
orthotropic with the associated slip rule (B), or orthotropic with one of its own (C) [dSFMH07, Section 3].

[dSFMH07]: G. de Saxcé, Z.-Q. Feng, Z. Mróz, M. Hjiaj, "Comportement hystérétique du frottement
anisotrope", 18e Congrès Français de Mécanique, 2007.
"""

from dataclasses import asdict, dataclass, replace
from importlib.metadata import version

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs
from dolfinx_contact.compat import functionspace
from dolfinx_contact.compat import version as dolfinx_version

# isort: split
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.mesh import locate_entities, locate_entities_boundary
from mpi4py import MPI
from petsc4py import PETSc

from mechanics.material import elasticity, stress
from studies.punch.mesh import CONTACT, TOP, punch_mesh

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
    lowest: float | None = None  # height of the elements on the plane, mm; None: all are as high
    # Left open by the paper:
    unload_to: float | tuple[float, ...] = 0.02  # top face when unloaded; or one per cycle
    top: str = "bonded"  # "bonded": the top face does not move sideways; "free": it does
    point: tuple[float, float] | None = None  # P is the contact node nearest to this

    @property
    def target(self) -> tuple[float, float]:
        """Where P is looked for: off both friction axes, at three quarters of the radius."""
        return self.point or (0.75 * self.radius / 2**0.5, 0.75 * self.radius / 2**0.5)


class Punch:
    """Body, plane, friction and supports; ``press`` computes one load step after another.

    ``solver``, ``petsc_options`` as in ``dc.ContactProblem``; ``friction``: arguments of ``dc.Friction`` in place of the case's;
    ``degree``: of the displacements, in place of the cells' order; ``on``: another Punch of these options, whose mesh it takes; ``mesh_options`` as in ``punch_mesh``, such as ``divisions``.  With ``quarter=True`` only a quarter is computed, planes of symmetry
    hold it, and the sums of forces and work that ``press`` and ``dissipation`` return are those of the whole.
    """

    def __init__(
        self,
        parameters: Parameters,
        comm=MPI.COMM_WORLD,
        solver=None,
        friction=None,
        petsc_options=None,
        degree=None,
        on=None,
        **mesh_options,
    ):
        self.parameters, self.comm = parameters, comm
        self.friction = friction or CASES[parameters.case]
        self.parts = 4 if mesh_options.get("quarter") else 1  # of the whole punch
        shape = {key: getattr(parameters, key) for key in ("radius", "height", "lowest")}
        punch = on or punch_mesh(comm, parameters.refine, **shape, **mesh_options)
        self.mesh, self.facet_tags = punch.mesh, punch.facet_tags
        order = degree or mesh_options.get("order", 1)
        self.V = functionspace(self.mesh, ("Lagrange", order, (3,)))
        self.u = fem.Function(self.V, name="displacement")
        self.approach = fem.Constant(self.mesh, PETSc.ScalarType(0))  # u_z of the top face

        # 2 x 2 x 2 Gauss points for bricks of eight nodes, 3 x 3 x 3 for those of 27, as usual
        dx = ufl.dx(domain=self.mesh, metadata={"quadrature_degree": 2 * order + 1})
        v = ufl.TestFunction(self.V)
        self.F = elasticity(self.u, v, parameters.young, parameters.poisson, dx)
        self.bcs = self._supports() + (self._symmetry() if self.parts > 1 else [])

        plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1), axis=(1, 0, 0))
        friction = dc.Friction(**self.friction)
        self.contact = dc.Contact(self.V, punch.facet_tags.find(CONTACT), plane, friction)
        self.problem = dc.ContactProblem(
            self.F, self.u, [self.contact], bcs=self.bcs, solver=solver, tol=parameters.tol, petsc_options=petsc_options
        )  # fmt: skip
        x = np.concatenate(comm.allgather(self.contact.x))
        self.tracked = np.linalg.norm(x[:, :2] - parameters.target, axis=1).argmin()  # P

    def stress(self, u):
        """Hooke's law, as a UFL expression."""
        return stress(u, self.parameters.young, self.parameters.poisson)

    def _supports(self):
        """The top face goes down; sideways it is bonded, or held by as little as possible."""
        R, H = self.parameters.radius, self.parameters.height
        top, zero = self.facet_tags.find(TOP), fem.Constant(self.mesh, PETSc.ScalarType(0))
        self.mesh.topology.create_connectivity(0, 3)

        def fix(component, dim, entities, value=zero):
            V = self.V.sub(component)
            return fem.dirichletbc(value, fem.locate_dofs_topological(V, dim, entities), V)

        def node_at(*point):
            at, near = np.array(point)[:, None], 1e-6 * R
            return locate_entities(self.mesh, 0, lambda x: np.abs(x - at).max(axis=0) < near)

        down = fix(2, 2, top, self.approach)
        if self.parameters.top == "bonded":
            return [down, fix(0, 2, top), fix(1, 2, top)]
        if self.parameters.top == "free":
            centre, rim = node_at(0, 0, H), node_at(R, 0, H)
            return [down, fix(0, 0, centre), fix(1, 0, centre), fix(1, 0, rim)]
        raise ValueError(f'top must be "bonded" or "free", got {self.parameters.top!r}.')

    def _symmetry(self):
        """The planes x = 0 and y = 0 of a quarter: no displacement across."""
        zero, near, bcs = (
            fem.Constant(self.mesh, PETSc.ScalarType(0)),
            1e-9 * self.parameters.radius,
            [],
        )
        for k in range(2):
            facets = locate_entities_boundary(self.mesh, 2, lambda x, k=k: np.abs(x[k]) < near)
            bcs.append(
                fem.dirichletbc(
                    zero, fem.locate_dofs_topological(self.V.sub(k), 2, facets), self.V.sub(k)
                )
            )
        return bcs

    def restart(self, **changed) -> None:
        """Back to the undeformed punch, with other ``parameters`` of case and increments; what is known of its stiffness stays."""
        self.parameters = replace(self.parameters, **changed)
        if "case" in changed:
            self.friction = CASES[self.parameters.case]
            self.contact.friction = dc.Friction(**self.friction)
        self.problem.reset()

    def move_top(self, displacement: float) -> None:
        """Move the top face to ``displacement`` mm below its first position."""
        self.approach.value = -displacement

    def press(self, displacement: float) -> dict:
        """Move the top face: one load step; what is said of it."""
        self.move_top(displacement)
        step = self.problem.solve()
        contact = self.contact
        tangential = np.linalg.norm(contact.reaction[:, :2], axis=1).sum()
        return {
            "displacement": displacement,
            "normal_reaction": self.parts * float(contact.force() @ contact.surface.normal),
            "tangential_reaction_sum": self.parts * float(self.comm.allreduce(tangential)),
            **{name: int(count) for name, count in step.counts._asdict().items()},
            "error": float(step.error),
            "bipotential_gap": float(step.bipotential_gap),
            "iterations": int(step.iterations),
            "seconds": float(step.seconds),
            "point_reaction": self._at_point(contact.reaction),
            "point_slip_increment": self._at_point(contact.slip_increment),
        }

    def dissipation(self) -> float:
        """Work of friction up to here, on all ranks."""
        return self.parts * self.comm.allreduce(float(self.contact.dissipation.sum()))

    def _at_point(self, values) -> list[float]:
        """Row of P, on all ranks."""
        return np.concatenate(self.comm.allgather(values))[self.tracked].tolist()

    def head(self) -> dict:
        """What was computed, and by what."""
        return {
            "case": self.parameters.case,
            "parameters": asdict(self.parameters),
            "friction": self.friction,
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
    for name in ("cycles", "loading", "unloading"):
        if getattr(parameters, name) < 1:
            raise ValueError(f"{name} must be at least 1, got {getattr(parameters, name)}.")
    lows, high, cycles = np.ravel(parameters.unload_to), parameters.depth, parameters.cycles
    if len(lows) not in (1, cycles) or not ((0 <= lows) & (lows < high)).all():
        raise ValueError(f"unload_to must be one number in [0, depth), or one per cycle, got "
                         f"{parameters.unload_to} with depth {high} and {cycles} cycles.")  # fmt: skip
    start, steps = 0.0, []
    for low in np.broadcast_to(lows, cycles):
        steps += np.linspace(start, high, parameters.loading + 1)[1:].tolist()
        steps += np.linspace(high, low, parameters.unloading + 1)[1:].tolist()
        start = low
    return steps


def add_options(parser, cycles: int = Parameters.cycles) -> None:
    """What both programs, the demo and the study, let vary of the parameters, on the command line."""
    add, default = parser.add_argument, Parameters()
    add("--cycles", type=int, default=cycles, help="of loading and unloading")
    add("--loading", type=int, default=default.loading, help="increments of a loading")
    add("--unloading", type=int, default=default.unloading, help="increments of an unloading")
    add("--top", choices=("bonded", "free"), default=default.top, help="top face, sideways")
    add("--tol", type=float, default=default.tol, help="error at which a step ends")
    add("--refine", type=int, default=default.refine, help="0 is the paper's mesh; 1 doubles it")
