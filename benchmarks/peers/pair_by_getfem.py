# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Two elastic bodies in the plane by GetFEM (Debian's python3-getfem); run by the system's Python, knows nothing of us.

    python3 benchmarks/peers/pair_by_getfem.py given.npz found.npz

Its brick of integral contact between meshes that do not match, an augmented Lagrangian (Alart and Curnier) with multipliers of first
order on the upper face; quadrilaterals of first order.
"""

import sys
from time import process_time

import numpy as np


def body(getfem, model, number: int, given):
    """Displacements ``u1`` above or ``u2`` below, elasticity, far sides held: mesh, integration, our nodes and their first unknowns."""
    x, up = given["x"], 3 - 2 * number
    cells = given["cells"][given["above"] == (up > 0)]
    mesh = getfem.Mesh("empty", 2)
    mesh.add_convex(getfem.GeoTrans("GT_QK(2,1)"), np.transpose(x[cells], (2, 1, 0)))
    mf = getfem.MeshFem(mesh, 2)
    mf.set_fem(getfem.Fem("FEM_QK(2,1)"))
    mim = getfem.MeshIm(mesh, getfem.Integ("IM_PRODUCT(IM_GAUSS1D(3),IM_GAUSS1D(3))"))
    far = [mesh.outer_faces_with_direction(way, 0.01) for way in ([1, 0], [-1, 0], [0, up])]
    near, small = x[np.intersect1d(cells, given["near"])], 1e-9 * np.abs(x).max()
    mesh.set_region(1, np.hstack(far))
    mesh.set_region(2, mesh.outer_faces_in_box(near.min(axis=0) - small, near.max(axis=0) + small))
    u, E, nu = f"u{number}", given["young"][number - 1], given["poisson"][number - 1]
    model.add_fem_variable(u, mf)
    model.add_initialized_data(f"lame{number}", [E * nu / ((1 + nu) * (1 - 2 * nu))])
    model.add_initialized_data(f"shear{number}", [E / (2 * (1 + nu))])
    model.add_isotropic_linearized_elasticity_brick(mim, u, f"lame{number}", f"shear{number}")
    model.add_initialized_data(f"held{number}", np.zeros(2))
    model.add_Dirichlet_condition_with_simplification(u, 1, f"held{number}")
    model.add_initialized_fem_data(f"before{number}", mf, np.zeros(mf.nbdof()))
    dofs = {tuple(p): 2 * k for k, p in enumerate(mf.basic_dof_nodes()[:, ::2].T.round(12))}
    nodes = np.unique(cells)
    return mesh, mim, nodes, np.array([dofs[tuple(p)] for p in x[nodes].round(12)])


def main(given_file, found_file):
    import getfem
    from by_getfem import failed  # beside this file, where the system's Python looks first

    given, start = np.load(given_file), process_time()
    model = getfem.Model("real")
    both = [body(getfem, model, number, given) for number in (1, 2)]
    mesh, mim, *_ = both[0]
    multipliers = getfem.MeshFem(mesh, 2)
    multipliers.set_fem(getfem.Fem("FEM_QK(2,1)"))
    model.add_filtered_fem_variable("traction", multipliers, 2)
    for name, value in dict(r=given["r"], mu=given["mu"], alpha=1.0).items():
        model.add_initialized_data(name, [float(value)])
    named = "u1", "u2", "traction", "r", "mu", 2, 2, 1, "alpha", "before1", "before2"
    model.add_integral_contact_between_nonmatching_meshes_brick(mim, *named)
    seconds, found, said = [process_time() - start], [], ""
    for way in given["programme"]:
        start = process_time()
        model.set_variable("held1", way)
        said = failed(model)
        seconds.append(process_time() - start)
        if said:
            break
        found.append(np.zeros_like(given["x"]))
        for number, (*_, nodes, first) in enumerate(both, start=1):
            u = np.array(model.variable(f"u{number}"))
            model.set_variable(f"before{number}", u)
            found[-1][nodes] = np.stack([u[first], u[first + 1]], axis=1)
    np.savez(found_file, u=np.array(found), seconds=seconds, said=said)


if __name__ == "__main__":
    main(*sys.argv[1:])
