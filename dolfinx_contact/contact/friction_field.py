# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction and wear coefficients given by callables and Functions, evaluated at contact nodes."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from dolfinx_contact import compat
from dolfinx_contact.law.friction import Friction, is_field, rough
from dolfinx_contact.law.wear import Wear
from dolfinx_contact.support.checks import finite, place

if TYPE_CHECKING:
    from dolfinx_contact.contact.contact import Contact
    from dolfinx_contact.contact.geometry import Frames

# Smallest tangential part of a given direction, relative to its length.
TANGENTIAL_PART = 1e-8

# Component of a unit vector below which the vector counts as parallel to a principal direction.
PRINCIPAL_ROUNDING = 1e-12

# Arrays of a contact on which coefficients may depend: names of arguments of callables.
STATE_NAMES = ("pressure", "slip_path", "dissipation", "wear_depth")


def followed(friction: Friction) -> list[str]:
    """Names of the contact arrays (``STATE_NAMES``) on which ``mu`` or ``p`` depends."""
    asked = {name for key in ("mu", "p") for name in _arguments(friction.given()[key])}
    return [name for name in STATE_NAMES if name in asked]


def on_nodes(
    contact: Contact,
    friction: Friction,
    state: dict[str, np.ndarray],
    frames: Frames,
    axes: Any = None,
) -> Friction:
    """Friction with coefficients and axes evaluated at each owned node of a contact.

    Args:
        contact: The contact.
        friction: Friction with at least one field.
        state: Arrays of the contact on which the fields depend, by name.
        frames: Local frames of the nodes.
        axes: Axes at the nodes, ``shape=(n, 2)``, if they are already available.

    Raises:
        ValueError: Values have a wrong shape or are invalid for ``Friction``; a Function is on
            another mesh or in a discontinuous space.  Raised on this rank only.
    """
    given, k = friction.given(), friction.exponent
    mu, p = (_coefficients(contact, name, given[name], state) for name in ("mu", "p"))
    axes = _axes(contact, friction, frames) if axes is None else axes
    return Friction(mu, p, k=k, axes=axes)


def guided(friction: Friction, count: int, nodes: np.ndarray, along: np.ndarray) -> Friction:
    """Friction with coefficients along the free direction ``f`` at nodes that slide along it only.

    If slip is along ``f``, the slip rule limits the friction to
    ``|r_f| <= r_n f.P^2 f / |M^-1 P^2 f|``.  Nodes whose ``f`` is a principal direction are
    unchanged.

    Args:
        friction: Friction with coefficients, or with arrays of them.
        count: Number of this rank's nodes.
        nodes: Indices of nodes with a constrained tangential direction, ``shape=(k,)``.
        along: Free direction ``f`` of these nodes, ``shape=(k, 2)``, unit vectors, local frame;
            zero where none is free.
    """
    turned = friction.at(nodes).along_axes(along)
    oblique = (np.abs(turned) > PRINCIPAL_ROUNDING).all(axis=1)
    if not oblique.any():
        return friction
    nodes, along = nodes[oblique], along[oblique]
    mu, p = (np.broadcast_to(part, (count, 2)).copy() for part in (friction.mu, friction.p))
    axes = np.tile([1.0, 0.0], (count, 1)) if friction.axes is None else friction.axes.copy()
    mu[nodes] = p[nodes] = (friction.at(nodes).drag(along) * along).sum(axis=1, keepdims=True)
    axes[nodes] = along
    return Friction(mu, np.where(mu > 0, p, 1.0), axes=axes)


def has_spatial_axes(friction: Friction, gdim: int) -> bool:
    """Whether ``axes`` is a field in 3-D, so that the surface needs no axis of its own."""
    return friction.field and gdim == 3 and is_field(friction.given()["axes"])


def _arguments(given: Callable) -> list[str]:
    """Names of contact arrays among a callable's arguments; empty if unknown to Python."""
    if not callable(given) or hasattr(given, "function_space"):
        return []
    try:
        return [name for name in STATE_NAMES if name in signature(given).parameters]
    except (TypeError, ValueError):
        return []


def _coefficients(contact: Contact, name: str, given: Any, state: dict[str, np.ndarray]):
    if not is_field(given):
        return given
    state = {key: state[key].copy() for key in _arguments(given) if key in state}
    values, n = _values(contact, name, given, state), contact.nodes.size
    if values.shape not in ((), (n,), (1, n), (2, n)):
        raise ValueError(
            f"{name} must give one value per point, shape {(n,)}, or two, {(2, n)}, for x of shape {(3, n)}, not "
            f"{values.shape}."
        )
    return np.broadcast_to(values, (2, n)).T.copy()


def nodal_wear_coefficients(contact: Contact, wear: Wear | None) -> np.ndarray | None:
    """Wear coefficients at each owned node, ``shape=(n, 2)``; None without a wear field.

    Raises:
        ValueError: As in ``on_nodes``, or a value is negative.  Raised on this rank only.
    """
    if wear is None or not wear.field:
        return None
    values = _coefficients(contact, "wear coefficient", wear.coefficient, {})
    if (values < 0.0).any():
        raise ValueError(f"wear coefficient must be >= 0, but the field has {values.min():g}.")
    return values


def directions(contact: Contact, friction: Friction) -> np.ndarray:
    """Unit vectors of a field of axes at the reference positions of the nodes.

    They do not depend on the state.

    Returns:
        ``shape=(n, 3)``, global frame, or ``(n, 2)``, local frame, as the field returns them.
    """
    values = _values(contact, "axes", friction.given()["axes"], {})
    return (values / np.linalg.norm(values, axis=0)).T.copy()


def _axes(contact: Contact, friction: Friction, frames: Frames):
    if not is_field(friction.given()["axes"]):
        return friction.given()["axes"]
    frame = frames.own if friction.of == "surface" else frames.frame
    return axes_at(contact, friction, frames.home, frame, frames.points)


def axes_at(
    contact: Contact,
    friction: Friction,
    at: np.ndarray,
    frame: np.ndarray,
    points: Any,
) -> np.ndarray:
    """Unit vectors of a field of friction axes in local frames, ``shape=(n, 2)``.

    Axes of the body are evaluated at the reference positions of the nodes, axes of the surface at
    positions on it.  On a deformable surface, they deform with the body that owns them.

    Args:
        contact: The contact.
        friction: Friction whose axes are a field.
        at: Positions on the surface, ``shape=(n, gdim)``.
        frame: Local frames, ``shape=(gdim, gdim)`` or ``(n, gdim, gdim)``.
        points: Contact points in the state of the frames.

    Raises:
        ValueError: Values have a wrong shape, or are normal to the surface.  Raised on this rank
            only.
    """
    n, gdim = contact.nodes.size, contact.displacements.dim
    given, owner = friction.given()["axes"], friction.of
    values = _values(contact, "axes", given, {}, at if owner == "surface" else None)
    if gdim != 3 or values.shape not in ((2, n), (3, n)):
        raise ValueError(
            f"axes must give directions in space, shape {(3, n)}, or in the frame of the plane, {(2, n)}, for x of shape "
            f"{(3, n)}, in three dimensions; not {values.shape} in {gdim}."
        )
    values = contact.geometry.directions(values, owner, points)
    if len(values) == 2:
        along = values
    elif contact.surface.curved:
        along = np.einsum("nij,jn->in", frame[:, :2], values)
    else:
        along = frame[:2] @ values
    length, full = np.linalg.norm(along, axis=0), np.linalg.norm(values, axis=0)
    if not (length > TANGENTIAL_PART * full).all():
        node = int(np.argmin(length - TANGENTIAL_PART * full))
        raise ValueError(
            f"axes has no direction along the plane at {place(contact.x, node)}: {values[:, node].tolist()}."
        )
    return (along / length).T.copy()


def _values(
    contact: Contact,
    name: str,
    given: Any,
    state: dict[str, np.ndarray],
    at: np.ndarray | None = None,
) -> np.ndarray:
    """Values of a field at the contact nodes, ``shape=(n,)`` or ``(components, n)``.

    Args:
        contact: The contact.
        name: Name of the coefficient in error messages.
        given: A callable or a Function.
        state: Arrays of the contact passed to a callable, by name.
        at: Positions at which a callable is evaluated, ``shape=(n, gdim)``; by default the nodes.
    """
    if hasattr(given, "function_space"):
        return _of_function(contact, name, given)
    n = contact.nodes.size
    at = contact.x if at is None else at
    _check_call(name, given, state)
    values = given(at.T.copy(), **state)
    finite(f"what {name} gives", rough(values) if name == "mu" else values)
    values = np.asarray(values, dtype=np.float64)  # ``Friction`` handles infinite values
    return np.zeros((2, 0)) if n == 0 else values


def _check_call(name: str, given: Callable, state: dict[str, np.ndarray]) -> None:
    """Raise a ``ValueError`` if ``given`` does not accept ``x`` and the arrays in ``state``."""
    try:
        signature(given, follow_wrapped=False).bind(None, **state)
    except TypeError as wrong:
        also = (
            f", and {', '.join(STATE_NAMES)} if it has arguments of these names"
            if name in ("mu", "p")
            else " alone"
        )
        raise ValueError(f"{name} is called with x{also}: {wrong} in {given!r}.") from None
    except ValueError:  # the signature cannot be inspected
        pass


def _of_function(contact: Contact, name: str, function: fem.Function) -> np.ndarray:
    V = function.function_space
    if V.mesh is not contact.V.mesh or compat.lagrange_degree(V) is None:
        raise ValueError(
            f"{name} is a Function on another mesh, or not in a continuous Lagrange space: its values at nodes are not "
            "determined; interpolate it into such a space, or give a callable of x."
        )
    size = V.dofmap.index_map_bs
    parts = [function] if size == 1 else [function.sub(k).collapse() for k in range(size)]
    displacements = contact.displacements
    scalars, parent = displacements.V.sub(0).collapse()
    at = np.argsort(np.ravel(parent) // displacements.dim)[contact.nodes]
    values = fem.Function(scalars)
    found = []
    for part in parts:
        values.interpolate(part)
        found.append(values.x.array[at])
    return found[0] if size == 1 else np.array(found)
