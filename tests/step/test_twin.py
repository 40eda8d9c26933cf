"""The package against its slow twin and the judge, which share neither law nor error nor solver with it."""

import dolfinx.fem.petsc
import numpy as np
import pytest
import scenes
import twin_solver
import ufl
from dolfinx import fem
from mpi4py import MPI

from dolfinx_contact.compat import bc_dofs
from mechanics.judge_scene import SceneJudge

EPSILON = np.finfo(float).eps
CASES = {
    "A": ((4, 4, 2), 0.2, None),
    "B": ((4, 4, 2), (0.3, 0.15), None),
    "C": ((2, 2, 2), (0.3, 0.15), (0.05, 0.20)),
    "crossed": ((2, 2, 2), (0.4, 0.1), (0.1, 0.3)),
    "plane strain": ((6, 3), 0.2, None),
}
PROGRAMMES = {
    3: [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.01, 0, -0.002)],
    2: [(0, -0.005), (0.001, -0.01), (0.002, -0.006), (0.01, -0.002)],
}


def dense_stiffness(scene):
    """Stiffness without boundary conditions, as a dense matrix, assembled apart from the package."""
    du = ufl.TrialFunction(scene.V)
    form = fem.form(ufl.derivative(scene.F, scene.u, du))
    A = dolfinx.fem.petsc.assemble_matrix(form)
    A.assemble()
    return A[:, :]


@pytest.mark.skipif(scenes.COMM.size > 1, reason="dense and slow: one rank is enough")
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(case, marks=[pytest.mark.slow] * (case in ("B", "C", "crossed")))
        for case in CASES
    ],
)
def test_programme_agrees_with_the_twin(case):
    """Every step's reactions agree with the twin's to 1e-8 and the judge accepts it; history goes along."""
    cells, mu, p = CASES[case]
    scene = scenes.block(comm=MPI.COMM_SELF, cells=cells, mu=mu, p=p)
    contact, d = scene.contact, len(cells)
    mu = np.broadcast_to(mu, d - 1)
    p = mu if p is None else p
    K = dense_stiffness(scene)
    size = K.shape[0]
    fixed = np.unique(np.concatenate([bc_dofs(bc, size) for bc in scene.bcs]))
    free = np.setdiff1d(np.arange(size), fixed)
    x = scene.V.tabulate_dof_coordinates()
    nodes = np.flatnonzero(np.isclose(x[:, d - 1], 0.0))
    assert np.array_equal(nodes, contact.nodes)
    # The scene is not turned: local t1 (t2) and n are the coordinate axes, up to t2's sign.
    frame = contact.frame
    inverse = np.linalg.inv(K[np.ix_(free, free)])
    rows = np.searchsorted(free, (d * nodes[:, None] + np.arange(d)).ravel())
    block = inverse[np.ix_(rows, rows)].reshape(nodes.size, d, nodes.size, d)
    W = np.einsum("aj,ijkl,bl->iakb", frame, block, frame)
    before = np.zeros((nodes.size, d))
    kappa = np.array([K[d * i + d - 1, d * i + d - 1] for i in nodes])
    of = SceneJudge(scene, mu, p)
    for top in PROGRAMMES[d][: 2 if p[0] != mu[0] else None]:  # the twin is slow where p is small
        scene.move_top(*top)
        step = scene.problem.solve()
        lift = np.zeros(size)
        lift[fixed] = scene.held.x.array[fixed]
        trial = np.zeros(size)
        trial[free] = -inverse @ (K @ lift)[free]
        w = (trial + lift).reshape(-1, d)[nodes] @ frame.T
        q = w - np.column_stack([before[:, :-1], np.zeros(nodes.size)])
        expected = twin_solver.solve(W, q, mu, p)
        assert np.abs(contact.reaction - expected).max() <= 1e-8 * np.abs(expected).max()
        verdict = of.verdict(scene.problem.tol)
        assert verdict.accepts(scene.problem.tol), verdict
        # The error, from the package's own displacement and reactions.
        u = scene.u.x.array
        local = u.reshape(-1, d)[nodes] @ frame.T
        forces = np.zeros((size // d, d))
        forces[nodes] = contact.reaction @ frame
        acting = max(np.linalg.norm(contact.reaction), np.linalg.norm((K @ u)[fixed]))
        found = twin_solver.error(
            kappa, mu, p, contact.reaction, local[:, -1], (local - before)[:, :-1],
            (forces.ravel() - K @ u)[free], acting,
        )  # fmt: skip
        found = max(found, np.linalg.norm(kappa * np.maximum(-local[:, -1], 0)) / acting)
        assert found <= 1e-10
        # Both are rounded, as sums of so many terms of random sign as a row of K has.
        terms = np.sqrt(np.count_nonzero(K, axis=1).max()) * np.abs(K) @ np.abs(u)
        rounding = EPSILON * np.linalg.norm(terms[free]) / acting
        assert rounding < 1e-12
        assert found == pytest.approx(step.error, rel=0.05, abs=rounding)
        before = local
