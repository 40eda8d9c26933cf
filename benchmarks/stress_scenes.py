# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The scenes of the stress matrix: a block on a plane in all the ways that may break a solver."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import ufl
from mpi4py import MPI

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

from dolfinx_contact._dolfinx import functionspace

A = dict(mu=0.2)
B = dict(mu=(0.3, 0.15))
C = dict(mu=(0.3, 0.15), p=(0.05, 0.20))
LAWS = {"A": A, "B": B, "C": C}


@dataclass
class Scene:
    """A name, a group for tables, and what ``build`` or a random problem is made of."""

    group: str
    name: str
    programme: str = "press"
    body: dict = field(default_factory=dict)
    seed: int | None = None  # of a random condensed problem
    most_steps: int | None = None  # of the programme

    @property
    def tops(self) -> list[tuple]:
        """Displacements of the top, step by step, scene's axes."""
        return PROGRAMMES[self.programme][: self.most_steps]


def cycles(count, high=0.01, low=0.002):
    """Up and down in 5 + 10 increments, as the paper; displacement of the top, scene's axes."""
    steps, start = [], 0.0
    for _ in range(count):
        steps += list(np.linspace(start, high, 6)[1:]) + list(np.linspace(high, low, 11)[1:])
        start = low
    return [(0, 0, -d) for d in steps]


def turning(steps=16):
    """Pressed, then dragged around a circle."""
    angles = np.linspace(0, 2 * np.pi, steps + 1)
    return [(0, 0, -0.01)] + [(0.004 * np.cos(a), 0.004 * np.sin(a), -0.01) for a in angles]


PROGRAMMES = {
    "press": [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.01, 0, -0.002)],
    "six cycles": cycles(6),
    "one step": [(0, 0, -0.01)],
    "one large step": [(0, 0, -0.1)],
    "to zero and again": cycles(2, low=0.0),
    "into the air": [(0, 0, -0.01), (0, 0, 0.05), (0.01, 0, 0.05), (0.01, 0, -0.01), (0, 0, 0.01)],
    "reversals": [(0.004 * (-1) ** k, 0.002 * (-1) ** (k // 2), -0.01) for k in range(12)],
    "turning": turning(),
    "1000 tiny steps": [(1e-5 * k, 0, -1e-5 * k) for k in range(1, 1001)],
    "rocking": [(0, 0, -0.005), (0.02, 0, -0.005), (-0.02, 0, -0.003), (0, 0.02, -0.004)],
}


def build(
    mu=0.2, p=None, cells=(4, 4, 2), E=210e3, nu=0.3, length=1.0, turn=None, aspect=1.0, jump=1.0,
    spring=None,
):  # fmt: skip
    """A block of edges 1, 1, 0.6 over ``aspect``, top held rigidly or by a soft ``spring``.

    ``jump`` is the ratio of the moduli of neighbouring cells; ``spring`` its stiffness over E.
    """
    turn = np.eye(3) if turn is None else turn
    domain = mesh.create_box(
        MPI.COMM_SELF,
        [np.array([-0.5, -0.5, 0.0]), np.array([0.5, 0.5, 0.6])],
        cells,
        mesh.CellType.hexahedron,
    )
    facets = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0.0))
    top = mesh.locate_entities_boundary(domain, 2, lambda x: np.isclose(x[2], 0.6))
    domain.geometry.x[:, 2] /= aspect
    domain.geometry.x[:] = length * domain.geometry.x @ turn.T
    V = functionspace(domain, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Function(V)
    modulus = fem.Function(functionspace(domain, ("Discontinuous Lagrange", 0)))
    modulus.x.array[:] = E * np.where(np.arange(modulus.x.array.size) % 2, jump, 1.0)
    nu = fem.Constant(domain, float(nu))
    lmbda, shear = modulus * nu / ((1 + nu) * (1 - 2 * nu)), modulus / (2 * (1 + nu))
    eps = ufl.sym(ufl.grad(u))
    sigma = lmbda * ufl.tr(eps) * ufl.Identity(3) + 2 * shear * eps
    F = ufl.inner(sigma, ufl.sym(ufl.grad(v))) * ufl.dx
    bcs = []
    if spring is None:
        bcs = [fem.dirichletbc(held, fem.locate_dofs_topological(V, 2, top))]
    else:
        tags = mesh.meshtags(domain, 2, np.sort(top), np.ones(top.size, dtype=np.int32))
        ds = ufl.Measure("ds", domain=domain, subdomain_data=tags)
        stiffness = fem.Constant(domain, spring * E / length)
        F = F + stiffness * ufl.inner(u - held, v) * ds(1)
    plane = dc.RigidPlane(point=(0, 0, 0), normal=turn[:, 2], axis=turn[:, 0])
    friction = dc.Friction(mu=mu, p=p)
    contact = dc.Contact(V, facets, plane, friction)

    def move_top(displacement):
        held.x.array[:] = np.tile(
            length / aspect * turn @ np.asarray(displacement, dtype=float), held.x.array.size // 3
        )

    return SimpleNamespace(V=V, u=u, F=F, bcs=bcs, contact=contact, move_top=move_top, turn=turn)


def small(scene: Scene) -> Scene:
    """The same scene for slow programs: nine contact nodes where it names no number of cells, and of a
    thousand steps the first 90."""
    return replace(scene, body={"cells": (2, 2, 1)} | scene.body, most_steps=90)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.linalg.det(q)


def scenes() -> list[Scene]:
    """All scenes, in an order that does not change."""
    found = []

    def add(group, name, programme="press", **body):
        found.append(Scene(group, f"{name}, {programme}", programme, body))

    for (law, friction), programme in product(LAWS.items(), PROGRAMMES):
        add("paper's laws", law, programme, **friction)
    for mu, programme in product(
        (0, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.3, 0.5, 0.8, 1, 3, 10, 100, 1e3),
        ("press", "reversals", "turning"),
    ):
        add("isotropic mu", f"mu {mu:g}", programme, mu=mu)
    for ratio, swap, programme in product(
        (3, 10, 30, 100, 300, 1e3), (1, -1), ("press", "turning")
    ):
        add("mu ratio", f"{ratio:g} {swap:+d}", programme, mu=(0.3, 0.3 / ratio)[::swap])
    for ratio, kind, mu, programme in product(
        (3, 10, 30, 100, 300, 1e3),
        ("aligned", "crossed"),
        ((0.3, 0.15), (0.3, 0.03), (1.0, 0.1)),
        ("press", "reversals"),
    ):
        p = (1.0, 1 / ratio) if kind == "aligned" else (1 / ratio, 1.0)
        add("p ratio", f"{ratio:g} {kind} mu {mu}", programme, mu=mu, p=p)
    for nu, (law, friction), programme in product(
        (0.0, 0.45, 0.49, 0.499, 0.49999), LAWS.items(), ("press", "into the air")
    ):
        add("nearly incompressible", f"nu {nu} {law}", programme, nu=nu, **friction)
    for length, E, (law, friction) in product(
        (1e-9, 1.0, 1e9), (1e-6, 1.0, 2.1e5, 1e15), LAWS.items()
    ):
        add("units", f"length {length:g} E {E:g} {law}", length=length, E=E, **friction)
    for seed, (law, friction), programme in product(
        range(6), LAWS.items(), ("press", "into the air")
    ):
        add("inclined", f"rotation {seed} {law}", programme, turn=rotation(seed), **friction)
    for aspect, (law, friction) in product((10, 1e2, 1e3, 1e4), LAWS.items()):
        add("slivers", f"aspect {aspect:g} {law}", aspect=aspect, **friction)
    for jump, (law, friction) in product((1e-6, 1e-3, 1e3, 1e6), LAWS.items()):
        add("stiffness jumps", f"jump {jump:g} {law}", jump=jump, **friction)
    for spring, (law, friction), programme in product(
        (1.0, 1e-2, 1e-4, 1e-6), LAWS.items(), ("press", "rocking")
    ):
        add("soft spring", f"spring {spring:g} {law}", programme, spring=spring, **friction)
    for cells, (law, friction) in product(((1, 1, 1), (2, 1, 1), (8, 8, 2)), LAWS.items()):
        add("few and many nodes", f"cells {cells} {law}", cells=cells, **friction)
    for seed in range(150):
        found.append(Scene("random condensed", f"seed {seed}", "condensed", seed=seed))
    found.sort(key=lambda scene: scene.programme == "1000 tiny steps")  # the long ones last
    return found
