# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Contact patch tests: an even stress is found exactly on every cell, first and second order, by both solvers."""

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import pytest
from patches import passes_patch_test, pressed
from scenes import COMM, MPI

from dolfinx_contact.petsc import linear_solver

pytestmark = pytest.mark.ranks
SLIPS = pytest.mark.parametrize("slips", [False, True], ids=["stick", "slip"])
TILTED = pytest.mark.parametrize("tilted", [False, True], ids=["flat", "tilted"])


@SLIPS
@TILTED
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_patch(cell, degree, tilted, slips):
    """On distorted meshes an even stress is found exactly, and reactions are pressure times nodal area."""
    passes_patch_test(pressed(cell, degree, slips, tilted))


@SLIPS
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_patch_of_curved_cells(cell, slips):
    """The same with curved cells, their edges curved within the plane; of tetrahedra only inside the body."""
    found = pressed(cell, 2, slips, tilted=True, curved=True)
    middles = found.V.tabulate_dof_coordinates()
    assert COMM.allreduce(
        len(found.mesh.geometry.x) == len(middles), op=MPI.LAND
    )  # of second order, too
    passes_patch_test(found)


@SLIPS
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_the_fixed_point_passes_the_patch_test(cell, slips):
    """So does the other solver; the default has taken Newton's method above."""
    found = pressed(cell, 2, slips, tilted=True, solver=dc.FixedPoint())
    passes_patch_test(found)
    assert found.step.solver == "FixedPoint"
    assert pressed(cell, 2, slips, tilted=True).step.solver == "CondensedNewton"


@SLIPS
def test_multigrid_passes_the_patch_test(slips):
    """Multigrid on a body of second order, whose near-nullspace has the rotations of all its nodes."""
    options = {**linear_solver.MULTIGRID_OPTIONS, "ksp_rtol": 1e-13, "pc_gamg_coarse_eq_limit": 50}
    found = pressed(
        "hexahedron", 2, slips, tilted=True, solver=dc.FixedPoint(), petsc_options=options
    )
    passes_patch_test(found)
    assert found.problem.body.ksp.getPC().getType() == "mg"
