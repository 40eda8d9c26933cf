# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The punch, case A, by GetFEM (Debian's python3-getfem); run by the system's Python, knows nothing of us.

    python3 benchmarks/peers/by_getfem.py mesh.npz found.npz

Its brick of nodal contact with friction by an augmented Lagrangian (Alart and Curnier), with which the discrete
problem is the same as ours: BN u <= gap and Coulomb's law of BT (u - u_before) at every contact node. Bricks have 8 or 27 nodes.
"""

import sys
from time import process_time

import numpy as np


def punch(getfem, given):
    """The model, what it refers to and must be kept, the first degree of freedom of each of our nodes, and the brick that holds."""
    x, cells, young, poisson = (given[k] for k in ("x", "cells", "young", "poisson"))
    order = 1 if cells.shape[1] == 8 else 2
    mesh = getfem.Mesh("empty", 3)
    mesh.add_convex(getfem.GeoTrans(f"GT_QK(3,{order})"), np.transpose(x[cells], (2, 1, 0)))
    mfu = getfem.MeshFem(mesh, 3)
    mfu.set_fem(getfem.Fem(f"FEM_QK(3,{order})"))
    line = f"IM_GAUSS1D({2 * order + 1})"  # 2 x 2 x 2 points, or 3 x 3 x 3
    mim = getfem.MeshIm(mesh, getfem.Integ(f"IM_PRODUCT(IM_PRODUCT({line},{line}),{line})"))
    dofs = {tuple(p): 3 * k for k, p in enumerate(mfu.basic_dof_nodes()[:, ::3].T.round(9))}
    first = np.array([dofs[tuple(p)] for p in x.round(9)])
    model = getfem.Model("real")
    model.add_fem_variable("u", mfu)
    given_data = dict(
        lame=young * poisson / ((1 + poisson) * (1 - 2 * poisson)), shear=young / (2 * (1 + poisson)),
        # As the manual advises: of the order of Young's modulus times a length, here of a cell.
        r=young * given["cell"], mu=given["mu"], gamma=1.0,
    )  # fmt: skip
    for name, value in given_data.items():
        model.add_initialized_data(name, [float(value)])
    model.add_isotropic_linearized_elasticity_brick(mim, "u", "lame", "shear")
    support = add_supports(getfem, model, first, given, mfu.nbdof())
    add_contact(getfem, model, first[given["contact"]], mfu.nbdof(), given)
    return model, (mesh, mfu, mim), first, support


def add_supports(getfem, model, first, given, size) -> int:
    """Multipliers hold the body; penalties the nodes of the contact, whose stick would be a second equation of the same."""
    held = given["held"]
    twice = np.isin(held[:, 0], given["contact"])

    def rows(of):
        matrix = getfem.Spmat("empty", len(of), size)
        for k, (node, component) in enumerate(of):
            matrix.add(k, int(first[node] + component), 1.0)
        return matrix

    if twice.any():
        stiff = 1e6 * float(given["young"] * given["cell"])
        model.add_constraint_with_penalization("u", stiff, rows(held[twice]), np.zeros(twice.sum()))
    model.add_variable("support", (~twice).sum())
    zero = np.zeros((~twice).sum())
    return model.add_constraint_with_multipliers("u", "support", rows(held[~twice]), zero)


def add_contact(getfem, model, first, size, given) -> None:
    """The contact brick on the rows of the contact nodes, by their first degrees of freedom."""
    n = len(first)
    normal, tangent = getfem.Spmat("empty", n, size), getfem.Spmat("empty", 2 * n, size)
    for k, dof in enumerate(map(int, first)):
        normal.add(k, dof + 2, -1.0)
        tangent.add(2 * k, dof, 1.0)
        tangent.add(2 * k + 1, dof + 1, 1.0)
    model.add_variable("pressure", n)
    model.add_variable("friction", 2 * n)
    model.add_initialized_data("gap", np.zeros(n))
    model.add_initialized_data("alpha", given.get("alpha", np.ones(n)))
    model.add_initialized_data("before", np.zeros(size))
    model.add_basic_contact_brick("u", "pressure", "friction", "r", normal, tangent, "mu", "gap", "alpha", 1,
        "gamma", "before")  # fmt: skip


def failed(model) -> str:
    """Solve a model; why that does not converge, nothing where it does."""
    try:
        # Its default line search goes around in circles on graded meshes.
        options = ["max_res", 1e-9, "max_iter", 100, "lsolver", "mumps", "lsearch", "simplest"]
        count, ok = model.solve(*options)
    except RuntimeError as failure:
        return str(failure)[:200] or "no convergence in 0 iterations"
    return "" if ok else f"no convergence in {count} iterations"


def main(mesh_file, found_file):
    import getfem

    given = np.load(mesh_file)
    start = process_time()
    model, _kept, first, support = punch(getfem, given)
    seconds, found, own, said = [process_time() - start], [], [], ""
    along = given["held"][~np.isin(given["held"][:, 0], given["contact"]), 1]
    for displacement in given["programme"]:
        start = process_time()
        model.set_private_rhs(support, np.where(along == 2, -displacement, 0.0))
        said = failed(model)
        seconds.append(process_time() - start)
        u = np.array(model.variable("u"))
        if said:
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
