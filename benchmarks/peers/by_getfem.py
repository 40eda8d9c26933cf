# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch, case A, by GetFEM (Debian's python3-getfem); run by the system's Python, knows nothing of us.

    python3 benchmarks/peers/by_getfem.py mesh.npz found.npz

Its brick of nodal contact with friction by an augmented Lagrangian (Alart and Curnier), with which the discrete
problem is the same as ours: BN u <= gap and Coulomb's law of BT (u - u_before) at every contact node.
"""

import sys
from time import process_time

import numpy as np


def punch(getfem, given):
    """The model, what it refers to and must be kept, and the first degree of freedom of each of our nodes."""
    x, cells, top = (given[name] for name in ("x", "cells", "top"))
    young, poisson = float(given["young"]), float(given["poisson"])
    mesh = getfem.Mesh("empty", 3)
    mesh.add_convex(getfem.GeoTrans("GT_QK(3,1)"), np.transpose(x[cells], (2, 1, 0)))
    mfu = getfem.MeshFem(mesh, 3)
    mfu.set_fem(getfem.Fem("FEM_QK(3,1)"))
    line = "IM_GAUSS1D(3)"  # 2 x 2 x 2 points
    mim = getfem.MeshIm(mesh, getfem.Integ(f"IM_PRODUCT(IM_PRODUCT({line},{line}),{line})"))
    places = mfu.basic_dof_nodes()[:, ::3].T
    dof_of = {tuple(np.round(p, 9)): 3 * k for k, p in enumerate(places)}
    first = np.array([dof_of[tuple(np.round(p, 9))] for p in x])
    held = set(map(int, mesh.pid_from_coords(x[top].T).ravel()))
    mesh.set_region(1, mesh.faces_from_pid(sorted(held)))
    model = getfem.Model("real")
    model.add_fem_variable("u", mfu)
    model.add_initialized_data("lame", [young * poisson / ((1 + poisson) * (1 - 2 * poisson))])
    model.add_initialized_data("shear", [young / (2 * (1 + poisson))])
    model.add_isotropic_linearized_elasticity_brick(mim, "u", "lame", "shear")
    model.add_initialized_data("down", [0.0, 0.0, 0.0])
    model.add_Dirichlet_condition_with_multipliers(mim, "u", mfu, 1, "down")
    return model, (mesh, mfu, mim), first


def add_contact(getfem, model, given, size, first) -> None:
    """The contact brick on the rows of the contact nodes."""
    n = len(given["contact"])
    normal, tangent = getfem.Spmat("empty", n, size), getfem.Spmat("empty", 2 * n, size)
    for k, node in enumerate(given["contact"]):
        normal.add(k, first[node] + 2, -1.0)
        tangent.add(2 * k, first[node], 1.0)
        tangent.add(2 * k + 1, first[node] + 1, 1.0)
    model.add_variable("pressure", n)
    model.add_variable("friction", 2 * n)
    # As the manual advises: of the order of Young's modulus times a length, here of a cell.
    model.add_initialized_data("r", [float(given["young"]) * float(given["cell"])])
    model.add_initialized_data("mu", [float(given["mu"])])
    model.add_initialized_data("gap", np.zeros(n))
    model.add_initialized_data("alpha", np.ones(n))
    model.add_initialized_data("gamma", [1.0])
    model.add_initialized_data("before", np.zeros(size))
    model.add_basic_contact_brick("u", "pressure", "friction", "r", normal, tangent, "mu", "gap", "alpha", 1,
        "gamma", "before")  # fmt: skip


def main(mesh_file, found_file):
    import getfem

    given = np.load(mesh_file)
    start = process_time()
    model, kept, first = punch(getfem, given)
    size = kept[1].nbdof()
    add_contact(getfem, model, given, size, first)
    seconds, found, own, said = [process_time() - start], [], [], ""
    for displacement in given["programme"]:
        start = process_time()
        model.set_variable("down", [0.0, 0.0, -displacement])
        try:
            count, ok = model.solve("max_res", 1e-9, "max_iter", 100, "lsolver", "mumps")
        except RuntimeError as failure:
            count, ok, said = 0, 0, str(failure)[:200]
        seconds.append(process_time() - start)
        u = np.array(model.variable("u"))
        if not ok:
            said = said or f"no convergence in {count} iterations"
            break
        # Its own error: the residual of all its equations over the reactions.
        model.assembly("build_rhs")
        own.append(np.linalg.norm(model.rhs()) / np.linalg.norm(model.variable("pressure")))
        model.set_variable("before", -u)  # the brick adds it
        found.append(np.stack([u[first], u[first + 1], u[first + 2]], axis=1))
        if sum(seconds) > float(given["cap"]) and len(found) < len(given["programme"]):
            said = f"stopped after {sum(seconds):.0f} s"
            break
    np.savez(found_file, u=np.array(found), seconds=seconds, own=own, said=said)


if __name__ == "__main__":
    main(*sys.argv[1:])
