# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A body, or a part of it, that nothing holds is refused; one that something holds is not."""

from contextlib import suppress

import numpy as np
import pytest
import scenes
import ufl
from dolfinx import fem, mesh

import dolfinx_contact as dc
from dolfinx_contact.compat import functionspace, model_to_mesh

gmsh = pytest.importorskip("gmsh")


@pytest.fixture(scope="module")
def two_cubes():
    """One mesh of two unit cubes, 0.5 apart in x, both standing on z = 0."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        if scenes.COMM.rank == 0:
            boxes = [gmsh.model.occ.addBox(x, 0, 0, 1, 1, 1) for x in (0.0, 1.5)]
            gmsh.model.occ.synchronize()
            gmsh.model.addPhysicalGroup(3, boxes, 1)
            gmsh.option.setNumber("Mesh.MeshSizeMin", 0.5)
            gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
            gmsh.model.mesh.generate(3)
        return model_to_mesh(gmsh.model, scenes.COMM, 0, gdim=3).mesh
    finally:
        gmsh.finalize()


@pytest.mark.ranks
@pytest.mark.parametrize(
    "state, message",
    [
        ("missing file", "the gmsh model is empty"),
        ("not synchronized", "the gmsh model is empty"),
        ("no group", "no physical group of dimension 3"),
        ("group of faces", "no physical group of dimension 3"),
    ],
)
def test_a_model_without_cells_is_refused(state, message):
    """What gmsh and DOLFINx answer with an IndexError, an AssertionError or a mesh of faces is a ValueError on all ranks."""
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        if scenes.COMM.rank == 0:
            if state == "missing file":
                with suppress(Exception):  # of late gmsh itself
                    gmsh.open("no such file.msh")
            else:
                gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
            if state in ("no group", "group of faces"):
                gmsh.model.occ.synchronize()
                gmsh.model.mesh.generate(3)
            if state == "group of faces":
                gmsh.model.addPhysicalGroup(2, [1], 1)
        with pytest.raises(ValueError, match=message):
            model_to_mesh(gmsh.model, scenes.COMM, 0)
    finally:
        gmsh.finalize()


@pytest.mark.parametrize("held", ["both", "one", "one and a spring"])
def test_every_part_of_a_body_must_be_held(two_cubes, held):
    """Holding one of two separate cubes is not enough, though a factorisation would go through."""
    V = functionspace(two_cubes, ("Lagrange", 1, (3,)))
    u, v = fem.Function(V), ufl.TestFunction(V)
    F = scenes.elasticity(u, v, 210e3, 0.3)
    bottom = mesh.locate_entities_boundary(two_cubes, 2, lambda x: np.isclose(x[2], 0.0))
    top = mesh.locate_entities_boundary(
        two_cubes, 2, lambda x: np.isclose(x[2], 1.0) & ((x[0] < 1.2) | (held == "both"))
    )
    held_by = fem.Function(V)
    held_by.x.array[2::3] = -0.01
    bcs = [fem.dirichletbc(held_by, fem.locate_dofs_topological(V, 2, top))]
    if held == "one and a spring":
        second = ufl.conditional(ufl.gt(ufl.SpatialCoordinate(two_cubes)[0], 1.2), 1.0, 0.0)
        F += second * ufl.inner(u, v) * ufl.ds
    plane = dc.RigidPlane(point=(0, 0, 0), normal=(0, 0, 1))
    contact = dc.Contact(V, bottom, plane, dc.Friction(mu=0.2))
    problem = dc.ContactProblem(F, u, [contact], bcs=bcs)
    if held == "one":
        with pytest.raises(ValueError, match="one of its 2 separate parts: 6 rigid"):
            problem.solve()
    else:
        assert problem.solve().error <= 1e-8
        cubes = 2 if held == "both" else 1
        assert contact.force()[2] == pytest.approx(cubes * 210e3 * 0.01, rel=0.2)
