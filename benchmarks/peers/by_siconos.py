# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Condensed problems by Siconos (Debian's python3-siconos); run by the system's Python, knows nothing of us.

    python3 benchmarks/peers/by_siconos.py problems.npz found.npz

Siconos solves the isotropic law alone: it gets the scaled problem, in which every law is the isotropic one with unit
friction, and starts from the solution of the step before.
"""

import sys
from time import process_time

import numpy as np


def main(problems_file, found_file):
    import siconos.numerics as sn

    problems, answers = np.load(problems_file), {}
    W = problems["W"]
    n = len(W) // 3
    order = np.arange(3 * n).reshape(n, 3)[:, [2, 0, 1]].ravel()
    for case in "ABC":
        mu, p = problems[f"{case}law"]
        p = p / np.max(p / mu)
        S, T = np.tile([*mu, 1.0], n), np.tile([*(p**2 / mu), 1.0], n)
        q, r = (problems[case + part].reshape(-1, 3 * n) for part in "qr")
        length = np.abs(q).max()
        S *= length / np.diag(W)[2::3].mean()
        T /= length
        M = np.asfortranarray((T[:, None] * W * S)[np.ix_(order, order)])
        problem = sn.FrictionContactProblem(3, M, np.zeros(3 * n), np.ones(n))
        found = []
        for k in range(len(q)):
            problem.q = (T * q[k])[order].copy()
            reaction = (r[k - 1] / S)[order].copy() if k else np.zeros(3 * n)
            options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSN_AC)
            options.dparam[0], options.iparam[0] = problems["tol"], 20_000
            start = process_time()
            converged = sn.fc3d_driver(problem, reaction, np.zeros(3 * n), options) == 0
            seconds = process_time() - start
            back = np.empty(3 * n)
            back[order] = reaction
            own = options.dparam[sn.SICONOS_DPARAM_RESIDU]
            found.append(((back * S).reshape(n, 3), seconds, own, converged))
        for name, column in zip(("reaction", "seconds", "own", "converged"), zip(*found)):
            answers[case + name] = np.array(column)
    np.savez(found_file, **answers)


if __name__ == "__main__":
    main(*sys.argv[1:])
