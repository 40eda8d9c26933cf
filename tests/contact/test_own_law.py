# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A law of one's own, written in Python: solvers that ask it find its states, those that read coefficients are refused."""

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace
from mechanics.material import elasticity

pytestmark = pytest.mark.ranks
E, MU = 1000.0, 0.3


class MagnetLaw:
    """A law of the kernel with reactions moved by a pull along the normal; see docs/extending.md."""

    def __init__(self, law, pull):
        self._law, self._pull = law, pull

    def __getattr__(self, name):
        function, pull = getattr(self._law, name), self._pull

        def moved(reaction, *state):
            down = np.zeros_like(reaction)
            down[:, -1] = pull
            found = function(reaction + down, *state)
            return (found[0] - down, *found[1:]) if isinstance(found, tuple) else found

        return moved


class Magnet(dc.Friction):
    """Friction under an attraction per node."""

    def __init__(self, mu, pull):
        self.pull = pull
        super().__init__(mu)

    def law(self, dim):
        return MagnetLaw(super().law(dim), self.pull)


def lifted(gdim, solver):
    """Contact of a unit block on a magnet of 20 N, lifted by less and dragged, and the step that found it."""
    create, kind = ((mesh.create_unit_cube, mesh.CellType.hexahedron) if gdim == 3 else (mesh.create_unit_square, mesh.CellType.quadrilateral))  # fmt: skip
    domain = create(scenes.COMM, *[3] * gdim, kind)
    foot, top = (mesh.locate_entities_boundary(domain, gdim - 1, lambda x, z=z: np.isclose(x[gdim - 1], z)) for z in (0, 1))  # fmt: skip
    V = functionspace(domain, ("Lagrange", 1, (gdim,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    held = fem.Constant(domain, np.zeros(gdim))
    bc = fem.dirichletbc(held, fem.locate_dofs_topological(V, gdim - 1, top), V)
    plane = dc.RigidPlane(np.zeros(gdim), np.eye(gdim)[-1])
    contact = dc.Contact(V, foot, plane, MU)
    contact.friction = Magnet(MU, 20.0 * contact.area)
    problem = dc.ContactProblem(elasticity(u, v, E, 0.3), u, [contact], bcs=[bc], solver=solver)
    held.value = [0.1, *[0.0] * (gdim - 2), 0.005]
    return contact, problem.solve()


@pytest.mark.parametrize("solver", [dc.SparseNewton(), dc.FixedPoint(), None], ids=repr)
@pytest.mark.parametrize("gdim", [2, 3])
def test_friction_is_that_of_all_that_presses(solver, gdim):
    """Nodes that a magnet holds and supports lift slide with the friction of pull less lift, by Coulomb's law for their sum."""
    contact, step = lifted(gdim, solver)
    reaction, pull = contact.reaction, 20.0 * contact.area
    assert contact.force()[-1] < 0.0 and contact.force()[0] < 0.0 and step.counts.open == 0
    friction = np.linalg.norm(reaction[:, :-1], axis=1)
    assert friction == pytest.approx(MU * (reaction[:, -1] + pull), rel=1e-6)


def test_solver_that_reads_coefficients_is_refused():
    """The condensed problem knows no pull: the law judges what it finds, and the step is refused."""
    with pytest.raises(dc.NotConverged):
        lifted(2, dc.CondensedNewton())
