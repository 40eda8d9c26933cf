# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Validation of the input of a problem: unknown, contacts, boundary conditions, options."""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Callable, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from ufl.classes import Indexed, Product, ScalarValue, SpatialCoordinate, Sum

from dolfinx_contact import compat
from dolfinx_contact.bodies.elastic import ElasticBody
from dolfinx_contact.bodies.input import check_meshes, derivative_of
from dolfinx_contact.contact.contact import Contact
from dolfinx_contact.contact.contact_step import components, exclude_fixed_directions, frames_of
from dolfinx_contact.petsc.linear_solver import CROWDED_SIZE, LARGE_SIZES
from dolfinx_contact.solvers.base import Solver
from dolfinx_contact.support.attributes import surfaces_of
from dolfinx_contact.support.checks import place, positive
from dolfinx_contact.support.collective import agree, raised_together

if TYPE_CHECKING:
    import ufl
    from dolfinx import fem
    from mpi4py import MPI

    from dolfinx_contact.contact.displacements import Displacements
    from dolfinx_contact.contact.geometry import Frames
    from dolfinx_contact.contact.interface import ContactPoints
    from dolfinx_contact.problem import ContactProblem


# Treatments of a body held by contact alone if a motion of it is undetermined.
UNDETERMINED_CHOICES = ("refused", "nearest")

OPTION_EXAMPLES = {
    "petsc_options": '{"pc_type": "lu"}',
    "form_compiler_options": '{"scalar_type": "double"}',
    "jit_options": '{"cffi_extra_compile_args": ["-O3"]}',
}

# Increasing numbers, for problems in the order of their creation, and for uses of driven surfaces.
PROBLEM_NUMBERS = count(1)


def checked_contacts(contacts: Any, u: fem.Function) -> tuple[Contact, ...]:
    """Return the contacts as a tuple.

    Raises:
        ValueError: a contact is not on the space of ``u``, or contacts differ in the sub-space of
            displacements, or are inconsistent.
    """
    if isinstance(contacts, Contact):
        contacts = [contacts]
    if not isinstance(contacts, (list, tuple)):
        raise ValueError(
            f"contacts must be a list of dc.Contact objects, got {contacts!r}: [] for none."
        )
    for contact in contacts:
        if not isinstance(contact, Contact):
            raise ValueError(
                f"contacts must hold dc.Contact objects, got {type(contact).__name__}."
            )
        if not compat.is_within(contact.V, u.function_space):
            raise ValueError(
                "a contact lives on another space or mesh than u: build it on u.function_space."
            )
        check_mesh(contact)
    if len({id(contact) for contact in contacts}) < len(contacts):
        raise ValueError("contacts names the same Contact twice: name it once.")
    displacements = [contact.displacements for contact in contacts]
    if (
        displacements
        and displacements[0].mixed
        and any((displacements[0].are != other.are).any() for other in displacements[1:])
    ):
        raise ValueError(
            "contacts mean different sub-spaces of a mixed space as displacements: build all on the same."
        )
    check_sides(contacts)
    return tuple(contacts)


def check_sides(contacts: Sequence[Contact]) -> None:
    """Raise a ``ValueError`` if a node of this rank is slave and master, or slave of two contacts.

    Only contacts with deformable surfaces are concerned.
    """
    for contact in contacts:
        for other in contacts:
            if np.isin(contact.opposite, other.nodes).any():
                raise ValueError(
                    "a node of a contact is on the deformable surface of another one, or of its own: every node is slave or master. "
                    "Swap the sides of one of them, or leave out facets."
                )
            apart = other is contact or contact.geometry.shares_nodes
            if not apart and np.isin(other.nodes, contact.nodes).any():
                raise ValueError(
                    "nodes of a contact with a deformable surface belong to another contact, too: take the facets out of one."
                )


def check_mesh(contact: Contact) -> None:
    """Raise a ``ValueError`` if the mesh was moved after the contact was created."""
    if contact.measure.mesh_has_moved:
        raise ValueError(
            "the mesh was moved or scaled after the contact was made, whose gaps and areas no longer fit: move it "
            "first, then make Contact and ContactProblem. A plane moves by surface.displacement."
        )


def checked_conditions(bcs: Any, V: fem.FunctionSpace) -> list:
    """Return the boundary conditions as a list.

    Raises:
        ValueError: one of them is no boundary condition on ``V`` or a sub-space of ``V``.
    """
    if compat.is_condition(bcs):
        raise ValueError(f"bcs must be a list of boundary conditions: write bcs=[bc], not {bcs!r}.")
    if not isinstance(bcs, (list, tuple)):
        raise ValueError(f"bcs must be a list of boundary conditions, got {bcs!r}: [] for none.")
    for bc in bcs:
        if not compat.is_condition(bc):
            raise ValueError(f"bcs must hold what dirichletbc returns, got {bc!r}.")
        if not compat.condition_lives_on(bc, V):
            raise ValueError(
                "a boundary condition lives on another space than u: build it on u.function_space or a part of it, "
                "V.sub(i)."
            )
    return list(bcs)


def checked_solver(solver: Any):
    """Return the solver; None becomes ``Automatic()``.

    Raises:
        ValueError: it is no ``Solver``.
    """
    if isinstance(solver, type):
        raise ValueError(f"solver {solver.__name__} is a class: write solver={solver.__name__}().")
    if solver is not None and not isinstance(solver, Solver):
        raise ValueError(
            f"solver {solver!r} is unknown: use None, dc.CondensedNewton(...) or dc.FixedPoint(...); one of your own has the base "
            "class dolfinx_contact.extend.Solver."
        )
    if solver is not None:
        return solver
    from dolfinx_contact.solvers.automatic import Automatic

    return Automatic()


def body_of(
    F: Any,
    u: fem.Function,
    bcs: Sequence[Any],
    J: Any = None,
    options: dict[str, Any] | None = None,
    prefix: str | None = None,
    before_residual: Callable | None = None,
    displacements: Displacements | None = None,
    form_options: dict[str, Any] | None = None,
) -> ElasticBody:
    """Return the body of a residual form.  Collective.

    It is an ``ElasticBody`` if the form is linear in ``u``, else a ``NonlinearBody``.

    Args:
        F: Residual form.
        u: Displacement.
        bcs: Dirichlet conditions.
        J: Derivative of ``F``; if None, UFL computes it.
        options: PETSc options of the linear solver.
        prefix: Prefix of these options.
        before_residual: Function of ``u`` that sets coefficients of ``F`` and ``J`` before each
            assembly, or None.
        displacements: ``Displacements`` of ``u``, if already computed.
        form_options: Options for compiling the forms, see ``compat.compiled``.

    Raises:
        ValueError: on all ranks, if ``F`` is no residual form in ``u``.
    """
    with raised_together(u.function_space.mesh.comm):
        moving = before_residual is not None
        derivative, linear = derivative_of(F, u, J, moving)
        check_meshes(F, u, (form_options or {}).get("entity_maps"))
    if linear:
        return ElasticBody(F, u, bcs, derivative, options, prefix, displacements, form_options)
    from dolfinx_contact.bodies.nonlinear import NonlinearBody

    return NonlinearBody(
        F, u, bcs, derivative, options, prefix, before_residual, displacements, form_options
    )


def multigrid_is_faster(solver: Solver, body: ElasticBody, contacts: Sequence[Contact]) -> bool:
    """Return whether multigrid is faster because of many contact nodes.  Collective.

    This applies to three-dimensional linear bodies with default PETSc options that are small enough
    for a factorisation, and to ``Automatic`` and ``FixedPoint`` solvers.
    """
    unknowns = body.comm.allreduce(body.size)
    solid = body.V.mesh.geometry.dim == 3 and CROWDED_SIZE <= unknowns <= LARGE_SIZES[3]
    if not (contacts and solid and body.options is None) or body.nonlinear:
        return False
    from dolfinx_contact.solvers.automatic import Automatic, most_nodes
    from dolfinx_contact.solvers.fixed_point.fixed_point import FixedPoint

    nodes = body.comm.allreduce(sum(contact.points.count for contact in contacts))
    most = most_nodes(unknowns, friction=components(contacts) > 1)
    return isinstance(solver, (Automatic, FixedPoint)) and nodes > most


def validated_lagged(quantities: Any) -> tuple:
    """Return the user's lagged quantities as a tuple.

    Raises:
        ValueError: one of them has no method ``change`` or ``renewed``, see ``Lagged``.
    """
    quantities = (quantities,) if hasattr(quantities, "renewed") else tuple(quantities)
    for one in quantities:
        if not (hasattr(one, "change") and hasattr(one, "renewed")):
            raise ValueError(
                f"problem.lagged must be a list of objects of classes derived from dolfinx_contact.extend.Lagged, see docs/extending.md; got {one!r}."
            )
    return quantities


def checked_tolerance(tol: Any) -> float:
    """Return a tolerance.  Raise a ``ValueError`` if it is not finite or below 1e-13."""
    try:
        value = positive("tol", tol, finite=True)
    except ValueError:
        value = np.nan
    if not value >= 1e-13:
        raise ValueError(
            f"tol must be a finite number of at least 1e-13 (rounding forbids less), got {tol!r}."
        )
    return value


def checked_undetermined(choice: Any) -> str:
    """Return the choice.  Raise a ``ValueError`` if it is not in ``UNDETERMINED_CHOICES``."""
    if choice not in UNDETERMINED_CHOICES:
        raise ValueError(
            f"undetermined must be one of {', '.join(UNDETERMINED_CHOICES)}, got {choice!r}."
        )
    return choice


def checked_internal(internal: Any):
    """Return ``InternalVariables`` or None.  Raise a ``ValueError`` for other objects."""
    if internal is None:
        return None
    from dolfinx_contact.bodies.internal_variables import InternalVariables

    if not isinstance(internal, InternalVariables):
        raise ValueError(
            f"internal must be dc.InternalVariables(state, ...) or None, got {internal!r}."
        )
    return internal


def checked_options(name: str, options: Any) -> dict | None:
    """Return a dictionary of options, or None.  Raise a ``ValueError`` for other objects."""
    if options is not None and not isinstance(options, dict):
        example = OPTION_EXAMPLES[name]
        raise ValueError(f"{name} must be a dictionary such as {example}, got {options!r}.")
    return options


def checked_form_options(form_compiler_options: Any, jit_options: Any, entity_maps: Any) -> dict:
    """Return the options for compiling forms, see ``compat.compiled``."""
    compiler = checked_options("form_compiler_options", form_compiler_options)
    jit = checked_options("jit_options", jit_options)
    return dict(form_compiler_options=compiler, jit_options=jit, entity_maps=entity_maps)


def hold(contacts: Sequence[Contact], body: ElasticBody, level: int = 3, told: float = 0) -> None:
    """Store in the contacts which directions of their nodes supports hold.  Collective.

    Nodes with prescribed normal displacement are excluded from contact, with a warning.

    Args:
        contacts: The contacts.
        body: The body.
        level: ``stacklevel`` of the warning.
        told: Number of excluded nodes in earlier warnings; a warning is issued only for more nodes.

    Raises:
        ValueError: on all ranks, if all nodes are excluded, or a node is held in a direction
            oblique to its surface.
    """
    for contact in contacts:
        exclude_fixed_directions(contact, body.fixed)
    hold_points(contacts, [contact.points for contact in contacts], body, level + 1, told)


def hold_points(
    contacts: Sequence[Contact],
    points: Sequence[ContactPoints],
    body: ElasticBody,
    level: int = 3,
    told: float = 0,
) -> None:
    """Store in the contact points which of their directions supports hold.  Collective.

    See ``hold``; ``points`` are the contact points of each contact.
    """
    left_out = [np.zeros((0, 3))]
    with raised_together(body.comm):
        for contact, point_set in zip(contacts, points):
            held = _held_directions(contact, point_set, body.fixed)
            point_set.hold(*held)
            left_out.append(contact.x[held[1]])
    where = np.concatenate(body.comm.allgather(np.concatenate(left_out)))
    nodes = body.comm.allreduce(sum(contact.points.count for contact in contacts))
    if len(where) == 0:
        return
    ends = np.array([where.min(axis=0), where.max(axis=0)])
    low, high = place(ends, 0), place(ends, 1)
    if len(where) == nodes:
        raise ValueError(
            f"the normal displacement of all {nodes} contact nodes, from {low} to {high}, is fixed by boundary "
            "conditions: contact and conditions contradict each other, take the facets out of one."
        )
    if len(where) <= told:
        return
    warnings.warn(
        f"{len(where)} of {nodes} contact nodes, {f'at {low}' if low == high else f'between {low} and {high}'}, are left out: boundary conditions give "
        "their displacement along the normal, so that they cannot touch. Take their facets out of the contact, or "
        "them out of the conditions, if that is not meant.",
        stacklevel=level,
    )


def support(body: ElasticBody, contacts: Sequence[Contact], bcs: Any) -> None:
    """Replace the Dirichlet conditions of a body and of its contacts.  Collective.

    Raises:
        ValueError: on all ranks, for invalid conditions; the previous conditions are kept.
    """
    with raised_together(body.comm):
        bcs = checked_conditions(bcs, body.V)
    agree(body.comm, bcs=len(bcs))
    before = body.bcs
    body.support(bcs)
    try:
        hold(contacts, body, level=5)  # warn at the assignment to ``problem.bcs``
    except Exception:
        body.support(before)
        hold(contacts, body, told=np.inf)
        raise


def _held_directions(contact: Contact, points: ContactPoints, fixed: np.ndarray) -> tuple:
    """Return the held directions of contact points, as arguments of ``ContactPoints.hold``."""
    left = points.free_of(fixed)
    closed = left[:, -1] < 1e-12
    # Fraction of each local direction without fixed components: one if free, zero if held, else
    # partly.
    partly = (left > 1e-12) & (left < 1 - 1e-12) & ~closed[:, None]
    held, guided = (left[:, :-1] < 0.5) | closed[:, None], None
    if partly[:, -1].any():
        node = np.argmax(partly[:, -1])
        raise ValueError(
            f"the contact node at {place(contact.x, node)} is held by a boundary condition along a direction that is "
            "oblique to the plane: what the node still can do is neither sliding nor lifting off. Hold it along the plane, or "
            "take it out of the condition."
        )
    if partly.any():
        nodes = np.flatnonzero(partly.any(axis=1))
        free = points.tangents_free_of(fixed)[nodes]
        longest = free[np.arange(len(nodes)), np.diagonal(free, axis1=1, axis2=2).argmax(axis=1)]
        held[nodes], guided = False, (nodes, longest / np.linalg.norm(longest, axis=1)[:, None])
    return held, closed, guided, np.isin(points.dofs, fixed)


def frames_of_step(
    contacts: Sequence[Contact],
    body: ElasticBody,
    start: np.ndarray,
    at: np.ndarray | None,
    before: Sequence[Frames | None],
    known: list,
) -> tuple[list[Frames], bool]:
    """Return the frames of each contact for a step, and whether rows have changed.  Collective.

    Args:
        contacts: The contacts.
        body: The body.
        start: The last converged displacement, owned degrees of freedom.
        at: Displacement at which the frames are evaluated; None is ``start``.
        before: Frames of each contact in the previous solution of the same step, or None.
        known: ``ContactPoints`` of each contact whose held directions are set; updated here.
    """
    frames = [frames_of(c, start, at, placed) for c, placed in zip(contacts, before)]
    changed = [k for k, (placed, old) in enumerate(zip(frames, known)) if placed.points is not old]
    if changed:
        told = body.comm.allreduce(sum(int(known[k].closed.sum()) for k in changed))
        given = [contacts[k] for k in changed], [frames[k].points for k in changed]
        hold_points(*given, body, told=told)
    known[:] = [placed.points for placed in frames]
    return frames, bool(changed)


def check_surfaces(contacts: Sequence[Contact], body: ElasticBody) -> None:
    """Warn about surfaces whose position does not fit the undeformed body.  Collective."""
    for contact in contacts:
        message = contact.geometry.check_start(contact, body)
        if message:
            warnings.warn(f"{message}, if that is not meant.", stacklevel=3)


def check_weights(F: ufl.Form, contacts: Sequence[Contact]) -> None:
    """Warn if an axisymmetric form does not match the weights of the contacts.  Collective.

    This is the case if F is multiplied by the radius and a contact has no weight, or if only one of
    both contains the factor 2 pi.
    """
    if not contacts or contacts[0].points.dim == 3:
        return
    cells = [part.integrand() for part in F.integrals() if part.integral_type() == "cell"]
    found = [_coordinate_factor(term) for integrand in cells for term in _summands(integrand)]
    which = sorted((k, factor) for k, factor in found if k is not None)
    if not which:
        return
    if not all(
        contact.measure.weight is not None and not _weight_is_two_pi(contact)
        for contact in contacts
    ):
        name = ("first", "second", "third")[which[0][0]]
        warnings.warn(
            f"F is multiplied by the {name} coordinate, as with axial symmetry, and a contact has no weight, or 2 pi alone: its pressures, worn depths "
            "and friction that follows the pressure are those of a body of unit thickness. Give dc.Contact(..., weight=2 * ufl.pi * r), "
            "or whatever F has; the radius must be the first coordinate.",
            stacklevel=3,
        )
    for contact in contacts:
        if not contact.measure.axial:
            continue
        x, weight = contact.displacements.x[:, 0], contact.measure.density
        far = int(np.argmax(x))  # other factors of F are unlikely to be exactly 2 pi
        turns = [factor * x[far] / weight[far] for _, factor in which]
        if (
            np.isclose(turns, 2 * np.pi, rtol=1e-9).any()
            or np.isclose(turns, 0.5 / np.pi, rtol=1e-9).any()
        ):
            warnings.warn(
                "F and the weight of a contact are multiplied by the radius, but only one of them by 2 pi: pressures and worn depths are "
                "wrong by this factor. Give dc.Contact(..., weight=...) the factor that F has.",
                stacklevel=3,
            )


def _weight_is_two_pi(contact: Contact) -> bool:
    """Return whether the weight of a contact is 2 pi, without the radius.  Collective."""
    measure = contact.measure
    alone = not measure.axial and np.allclose(measure.density, 2 * np.pi, rtol=1e-9)
    return all(contact.comm.allgather(bool(alone)))


def _summands(integrand: Any) -> list[Any]:
    """Return the terms of a UFL sum."""
    terms = [integrand]
    for term in terms:
        if isinstance(term, Sum):
            terms.extend(term.ufl_operands)
    return terms


def _coordinate_factor(term: Any) -> tuple[int | None, float]:
    """Return the coordinate and the constant among the factors of a UFL term.

    Returns:
        Index of the coordinate, or None if no coordinate is a factor; magnitude of the product of
        all numbers.
    """
    factors = [term]
    for factor in factors:
        if isinstance(factor, Product):
            factors.extend(factor.ufl_operands)
    indexed = [f.ufl_operands for f in factors if isinstance(f, Indexed)]
    which = [int(i[0]) for a, i in indexed if isinstance(a, SpatialCoordinate)]
    size = np.prod([abs(float(f)) for f in factors if isinstance(f, ScalarValue)])
    return min(which, default=None), float(size)


def check_axial(contacts: Sequence[Contact]) -> None:
    """Raise a ``ValueError`` on all ranks if a surface violates axial symmetry.  Collective.

    In axially symmetric problems, surfaces must not rotate or be driven by force along the radius.
    """
    for contact in contacts:
        if not contact.measure.axial:
            continue
        surface = contact.surface
        turns = surface.spins or surface.rotation.any()
        radial = surface.driver is not None and surface.driver.radial
        if turns or radial:
            what = "turn" if turns else "be driven by force along the radius"
            raise ValueError(
                f"the contact has a weight in proportion to the first coordinate, so bodies are those of revolution, and {surface} cannot "
                f"{what}: rotations in the plane and resultants along the radius have no meaning there. Prescribe the motion, or "
                "drive the axial one."
            )


def take_contacts(problem: ContactProblem, contacts: Sequence[Contact]) -> None:
    """Make a problem the owner of contacts; warn if they have a history of another problem."""
    begun = [contact for contact in contacts if not contact.history.empty]
    if begun:
        warnings.warn(
            f"{len(begun)} of {len(contacts)} contacts have a history of steps in another ContactProblem, which ends here: "
            "without reactions, slip, work and wear it begins anew. Make a Contact for each problem, if that is not meant.",
            stacklevel=3,
        )
    for contact in contacts:
        contact.owner = weakref.ref(problem)


def check_alive(problem: ContactProblem, body: ElasticBody, contacts: Sequence[Contact]) -> None:
    """Raise a ``ValueError`` if a problem was closed or another problem owns its contacts."""
    if body.closed:
        raise ValueError("this ContactProblem has been closed: make a new one.")
    if not all(contact.owner is not None and contact.owner() is problem for contact in contacts):
        raise ValueError(
            "a contact of this problem now belongs to a ContactProblem made later, which began its history anew: "
            "go on with that one, or make a Contact for each."
        )
    for surface in surfaces_of(contacts):
        if surface.driver is not None:
            surface.driver.take(problem.number, next(PROBLEM_NUMBERS))


def check_step(u: fem.Function, comm: MPI.Comm, contacts: Sequence[Contact]) -> None:
    """Raise a ``ValueError`` on all ranks if a step cannot be solved.  Collective.

    Initial guess, surfaces, laws and mesh are checked.
    """
    check_axial(contacts)
    for contact in contacts:
        contact.laws.check(contact)
    with raised_together(comm):
        for contact in contacts[:1]:  # all contacts are on the same mesh
            check_mesh(contact)
        if not np.isfinite(u.x.array).all():
            raise ValueError(
                "u contains NaN or infinity: it is the guess of this step, set it anew."
            )
        for driver in filter(None, (contact.surface.driver for contact in contacts)):
            driver.hold()
            driver.check()
