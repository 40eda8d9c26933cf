# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A belt on a drum that turns under it: the forces at its ends are in the ratio exp(mu phi) [L. Euler 1769]."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from scenes import COMM
from way_scenes import stretched

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace

THICK, PULL = 0.01, 1e-3


@pytest.mark.parametrize("cells, mu, steps", [(24, 0.2, 1), (24, 0.5, 3), (48, 0.5, 1)])
def test_ends_of_a_belt(cells, mu, steps):
    """Over a quarter of the drum but half a cell at the held end, in one step or more; nothing is said of a turn of 1e-4."""
    belt = mesh.create_rectangle(COMM, [np.zeros(2), np.ones(2)], [cells, 2], mesh.CellType.quadrilateral)  # fmt: skip
    places = ((0, 0.0), (0, 1.0))
    pulled, held = (mesh.locate_entities_boundary(belt, 1, lambda x, k=k, at=at: np.isclose(x[k], at)) for k, at in places)  # fmt: skip
    inner = mesh.locate_entities_boundary(belt, 1, lambda x: np.isclose(x[1], 0.0) & (x[0] < 1 - 0.5 / cells))  # fmt: skip
    x = belt.geometry.x
    angle, radius = np.pi / 2 * x[:, 0], 1.0 + THICK * x[:, 1]
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    V = functionspace(belt, ("Lagrange", 1, (2,)))
    u, F = stretched(V)
    tags = mesh.meshtags(belt, 1, np.sort(pulled), np.ones(pulled.size, dtype=np.int32))
    ds = ufl.Measure("ds", domain=belt, subdomain_data=tags)(1)
    F += PULL / THICK * ufl.TestFunction(V)[1] * ds
    bc = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(V, 1, held), V)
    drum = dc.RigidSphere((0, 0), 1.0)
    contact = dc.Contact(V, inner, drum, mu)
    problem = dc.ContactProblem(F, u, contact, bcs=[bc])
    problem.solve()
    for turn in -0.05 * np.arange(1, steps + 1) / steps:
        drum.rotation = turn
        step = problem.solve()
    assert step.counts.slip == cells
    ends = contact.force() - [0, PULL]  # what the held end carries is the opposite of both
    wrapped = np.pi / 2 * (1 - 0.5 / cells)
    assert ends[0] / PULL == pytest.approx(np.exp(mu * wrapped), rel=0.01)
