# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Materials in NumPy as operators of dolfinx-external-operator: what the same materials in UFL give."""

import numpy as np
import pytest
import ufl
from nonlinear_scenes import HEIGHT, LAME, MEASURE, G, block, move
from test_internal_variables import HARDENING, SHEAR, YIELD, uniaxial, voigt
from test_internal_variables import LAME as ELASTIC

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
from dolfinx import fem, mesh

external = pytest.importorskip("dolfinx_external_operator")


def quadrature(domain, degree, shape):
    """The space of values at quadrature points."""
    import basix.ufl

    kind = domain.topology.cell_name()
    return fem.functionspace(domain, basix.ufl.quadrature_element(kind, shape, degree=degree))


class Material:
    """A stress by NumPy: makes ``F`` and ``J``, and evaluates what stands in them before they are assembled."""

    def residual(self, stress, tested, dx, u):
        F = ufl.inner(stress, tested) * dx
        J = ufl.derivative(F, u, ufl.TrialFunction(u.function_space))
        F, self._stress = external.replace_external_operators(F)
        self.J, self._tangent = external.replace_external_operators(ufl.algorithms.expand_derivatives(J))  # fmt: skip
        return F

    def derivative(self, order):
        # of the operator by its operand: order (0,) is the stress
        return {(0,): self.stress, (1,): self.tangent}[order]

    def before_residual(self, u):
        operands = external.evaluate_operands(self._stress)
        external.evaluate_external_operators(self._stress, operands)
        external.evaluate_external_operators(self._tangent, operands)


class Rubber(Material):
    """Neo-Hooke: stress of the gradient of the displacement."""

    def form(self, u, v, modulus):
        d = len(u)
        space = quadrature(u.function_space.mesh, MEASURE["quadrature_degree"], (d, d))
        stress = external.FEMExternalOperator(ufl.grad(u), function_space=space, external_function=self.derivative)  # fmt: skip
        dx = ufl.dx(domain=u.function_space.mesh, metadata={**MEASURE, "quadrature_scheme": "default"})  # fmt: skip
        return self.residual(stress, ufl.grad(v), dx, u)

    def _parts(self, gradient):
        """Deformation gradient at each point, its inverse transposed, and the logarithm of its determinant."""
        values = gradient.reshape(-1, 3, 3) + np.eye(3)
        return values, np.linalg.inv(values).transpose(0, 2, 1), np.log(np.linalg.det(values))

    def stress(self, gradient):
        values, turned, grown = self._parts(gradient)
        return (G * (values - turned) + LAME * grown[:, None, None] * turned).ravel()

    def tangent(self, gradient):
        _, turned, grown = self._parts(gradient)
        one = np.eye(3)
        found = G * np.einsum("ik,jl->ijkl", one, one) + LAME * np.einsum("nij,nkl->nijkl", turned, turned)  # fmt: skip
        left = G - LAME * grown
        return (found + np.einsum("n,nil,nkj->nijkl", left, turned, turned)).ravel()


def operated(material, **options):
    """A block of the material."""
    late = {}

    def form(u, v, modulus):
        F = material.form(u, v, modulus)
        late.update(J=material.J, before_residual=material.before_residual)
        late.update(getattr(material, "more", {}))
        return F

    return block(form, late=late, **options)


@pytest.mark.parametrize("solver", [None, pytest.param(dc.SNES(), marks=pytest.mark.slow)])
def test_rubber(solver):
    """Pressed, dragged and unloaded with friction: forces are those of the form in UFL, in as many iterations."""
    results = []
    for make in (block, lambda **options: operated(Rubber(), **options)):
        scene, found = make(mu=0.3, held=True, solver=solver, tol=1e-10), []
        for where in ((0.0, 0.0, -0.1), (0.1, 0.05, -0.2), (0.1, 0.05, -0.1)):
            move(scene, *where)
            step = scene.problem.solve()
            found.append((step.iterations, *scene.contact.force()))
        results.append(found)
    np.testing.assert_allclose(*results, rtol=0, atol=1e-9)


class Plasticity(Material):
    """Von Mises with linear hardening, by radial return; the state is in two Functions at quadrature points."""

    def form(self, u, v, modulus):
        domain = u.function_space.mesh
        space = quadrature(domain, 1, (6,))
        self.plastic, self.hardening = fem.Function(space), fem.Function(quadrature(domain, 1, ()))
        self.more = dict(state=[self.plastic, self.hardening], after_step=self.after_step)
        strain = voigt(ufl.sym(ufl.grad(u)), 2.0)
        stress = external.FEMExternalOperator(strain, function_space=space, external_function=self.derivative)  # fmt: skip
        dx = ufl.dx(domain=domain, metadata={"quadrature_degree": 1, "quadrature_scheme": "default"})  # fmt: skip
        return self.residual(stress, voigt(ufl.sym(ufl.grad(v)), 2.0), dx, u)

    def stress(self, strain):
        """[Simo, Hughes 1998, box 3.2]"""
        one = np.array([1.0, 1, 1, 0, 0, 0])
        deviator = 2 * SHEAR * (np.diag([1, 1, 1, 0.5, 0.5, 0.5]) - np.outer(one, one) / 3)
        volume = (ELASTIC + 2 * SHEAR / 3) * np.outer(one, one)
        strain = strain.reshape(-1, 6) - self.plastic.x.array.reshape(-1, 6)
        trial = strain @ deviator
        size = np.sqrt((trial**2 * [1, 1, 1, 2, 2, 2]).sum(axis=1))
        above = size - np.sqrt(2 / 3) * (YIELD + HARDENING * self.hardening.x.array)
        self.gamma = np.maximum(above, 0.0) / (2 * SHEAR + 2 / 3 * HARDENING)
        self.normal = trial / np.maximum(size, 1e-300)[:, None]
        kept = 1 - 2 * SHEAR * self.gamma / np.maximum(size, 1e-300)
        slope = 2 * SHEAR / (1 + HARDENING / (3 * SHEAR)) - 2 * SHEAR * (1 - kept)
        slope = np.where(above > 1e-9 * YIELD, slope, 0.0)  # on the surface the elastic tangent
        tangent = volume + kept[:, None, None] * deviator
        self.slopes = tangent - np.einsum("n,ni,nj->nij", slope, self.normal, self.normal)
        return (strain @ volume + trial - 2 * SHEAR * self.gamma[:, None] * self.normal).ravel()

    def tangent(self, strain):
        return self.slopes.ravel()

    def after_step(self, u):
        self.plastic.x.array[:] += (self.gamma[:, None] * self.normal * [1, 1, 1, 2, 2, 2]).ravel()
        self.hardening.x.array[:] += np.sqrt(2 / 3) * self.gamma


def test_plasticity():
    """Loaded, unloaded and loaded again between frictionless planes, a block has the uniaxial curve."""
    cells = dict(cells=(2, 2, 2), cell=mesh.CellType.tetrahedron)
    scene = operated(Plasticity(), tol=1e-10, **cells)
    path = [0.002, 0.006, 0.01, 0.0085, 0.012]
    for strain, stress in zip(path, uniaxial(path)):
        move(scene, -strain * HEIGHT)
        scene.problem.solve()
        assert scene.contact.force()[2] == pytest.approx(stress, rel=1e-8)
