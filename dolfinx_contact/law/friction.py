# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Coefficients of orthotropic dry friction.

[dSFMH07]: G. de Saxcé, Z.-Q. Feng, Z. Mróz, M. Hjiaj, "Comportement hystérétique du frottement
anisotrope", 18e Congrès Français de Mécanique, 2007.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dolfinx_contact import _kernel
from dolfinx_contact.support.attributes import Guarded, frozen, whole
from dolfinx_contact.support.checks import finite, number, valued

Field = Callable[..., Any]  # or a DOLFINx Function, which this module does not import

TEXTURE_OWNERS = ("body", "surface")  # owners of friction axes that are a field

_SMALLEST_COEFFICIENT = 1e-50
_LARGEST_COEFFICIENT = 1e50

ARRAY_REMEDY = (
    "a Friction is immutable: assign another one, contact.friction = dc.Friction(mu, p); with a pair for each contact node, mu "
    "has shape (n, 2)."
)

# Replaces infinite coefficients. A node then slides only if its normal reaction is below a
# thousandth of the tangential one. The error at nodes about to open is proportional to
# 1 / ROUGH_COEFFICIENT; with larger values, solvers do not converge reliably.
ROUGH_COEFFICIENT = 1e3


def rough(mu: Any):
    """Coefficients of friction with infinite values replaced by ``ROUGH_COEFFICIENT``."""
    try:
        infinite = np.isposinf(mu)
    except (TypeError, ValueError):  # not real numbers: the caller's checks raise
        return mu
    return (
        mu
        if np.ma.is_masked(mu) or not np.any(infinite)
        else np.where(infinite, ROUGH_COEFFICIENT, mu)
    )


def _cone(given: ArrayLike) -> np.ndarray:
    """Validated coefficients ``mu``, ``shape=(2,)`` or ``(n, 2)``.

    Raises:
        ValueError: A value is negative, out of range, or zero or infinite in one direction only.
    """
    mu = _coefficients("mu", rough(given))
    if mu.ndim and (one := np.isposinf(given)).any(axis=-1).sum() != one.all(axis=-1).sum():
        raise ValueError(f"mu must be infinite in both directions or in none, not {given!r}")
    if np.any(mu < 0):
        raise ValueError(f"mu must not be negative, but is {given!r}")
    if mu.ndim == 0:
        mu = np.full(2, mu)
    if np.any((mu == 0).any(axis=-1) != (mu == 0).all(axis=-1)):
        raise ValueError(
            f"mu must be positive in both directions or zero in both, not {given!r}; "
            "for almost no friction in one direction give a small coefficient"
        )
    if np.any((mu > 0) & ((mu < _SMALLEST_COEFFICIENT) | (mu > _LARGEST_COEFFICIENT))):
        raise ValueError(
            f"mu must be zero or between {_SMALLEST_COEFFICIENT} and {_LARGEST_COEFFICIENT}, not {given!r}"
        )
    return mu


def _coefficients(name: str, value: ArrayLike | Callable | Any) -> np.ndarray:
    """``value`` as a finite float64 array of shape (), (2,) or (n, 2).

    Raises:
        ValueError: ``value`` has another shape or type, or is not finite.
    """
    array = finite(name, value)
    if array.size < 4 and any(isinstance(i, bool) for i in np.ravel(np.array(value, object))):
        raise ValueError(f"{name} must be real numbers, not {value!r}")
    if array.shape != () and not (array.ndim in (1, 2) and array.shape[-1] == 2):
        raise ValueError(
            f"{name} must be one number, a pair, or an array of shape (n, 2) with a pair per node, "
            f"not of shape {array.shape}: {value!r}"
        )
    return array


class Friction(Guarded):
    """Orthotropic dry friction with an associated or non-associated slip rule; immutable.

    The friction cone is ``|M^-1 r_t| <= r_n`` with ``M = diag(mu)`` [dSFMH07, Eq. (1)], the slip
    rule ``-du_t = dlambda P^-2 r_t / |P^-1 r_t|`` with ``P = diag(p)`` [dSFMH07, Section 1]. ``r``
    is the reaction on the body, ``du_t`` the slip increment; x and y are the principal friction
    directions. Only the ratio of the two ``p`` matters.

    Args:
        mu: Coefficients of friction: a number (isotropic), a pair ``(mu_x, mu_y)``, an array
            ``shape=(n, 2)`` with a pair for each of this rank's contact nodes, or a field, see
            below. Zero is frictionless; infinity is perfectly rough, so touching nodes stick. A
            contact replaces values above 1e3 by 1e3.
        p: Coefficients of the slip rule, positive, in the same forms. By default ``p = mu``, the
            associated rule.
        k: Instead of ``p``: ``p_y / p_x = (mu_y / mu_x)**k`` [dSFMH07, Section 1]; 1 is associated.
        axes: Principal friction direction x at each node, for example along grooves: unit vectors
            ``(cos, sin)`` in the tangential axes of the local frame, ``shape=(n, 2)``, which rotate
            with it. By default, the first axis of the frame. A field may also return directions in
            space, ``shape=(3, n)``, of any length, which are projected on the surface.
        of: Owner of ``axes`` given as a field. "body": evaluated at reference positions; surfaces
            that rotate do not turn the directions. "surface": a callable of positions on the
            surface; directions move and rotate with the surface. ``mu``, ``p`` and wear always
            belong to the body. On a deformable surface, directions are lines of the owner's
            material. On a rigid one, those of a body that turns stay as they are in space, with a
            warning.

    ``mu``, ``p`` and ``axes`` may be fields: callables of ``x``, ``shape=(3, n)``, as for DOLFINx's
    ``interpolate``, that return values of shape ``(n,)`` or ``(2, n)``, or DOLFINx Functions in
    continuous Lagrange spaces. A ``Contact`` evaluates them at its nodes when the friction is
    assigned and at the start of each step; ``contact.friction`` has the values. A callable for
    ``mu`` or ``p`` may have further arguments named ``pressure``, ``slip_path``, ``dissipation`` or
    ``wear_depth``. It then gets that array of the contact, ``shape=(n,)``: the pressure at the end
    of the step, the others at its start, see docs/howto/fields.md.

    Raises:
        ValueError: A coefficient is negative, NaN, not real, an expression of UFL or of the wrong
            shape; exactly one of a pair ``mu`` is zero or infinite; ``p`` is not positive and
            finite; ``p`` and ``k`` are both given; ``of`` does not fit ``axes``.

    Attributes:
        mu: Coefficients of friction, ``shape=(2,)`` or ``(n, 2)``.
        p: Coefficients of the slip rule, normalised to ``max(p / mu) = 1``, same shape as ``mu``;
            zero where ``mu`` is zero.
        axes: First principal friction directions, unit vectors, ``shape=(n, 2)``, or None.
        frictionless: Whether all ``mu`` are zero.
        isotropic: Whether both directions have the same ``mu`` and ``p`` everywhere.
        associated: Whether ``p`` is proportional to ``mu`` everywhere.
        field: Whether ``mu``, ``p`` or ``axes`` is a field; the attributes above are then available
            only in ``contact.friction``.
        exponent: ``k``, if it was given; otherwise None.

    Example:
        >>> friction = dc.Friction(mu=(0.30, 0.15), p=(0.05, 0.20))  # along and across the axis
        >>> lubricated = dc.Friction(mu=lambda x: np.where(x[0] < 0.5, 0.3, 0.05))  # a field
        >>> polymer = dc.Friction(mu=lambda x, pressure: 0.3 / (1 + pressure / 50.0))  # follows the pressure
    """

    mu: np.ndarray
    p: np.ndarray
    axes: np.ndarray | None
    of: str
    frictionless: bool
    isotropic: bool
    associated: bool
    field: bool
    exponent: float | None
    _remedy = "it is immutable, make a new Friction."

    def __init__(
        self,
        mu: ArrayLike | Field,
        p: ArrayLike | Field | None = None,
        *,
        k: float | None = None,
        axes: ArrayLike | Field | None = None,
        of: str = "body",
    ) -> None:
        if p is not None and k is not None:
            raise ValueError(f"give p or k, not both (mu={mu!r}, p={p!r}, k={k!r})")
        if of not in TEXTURE_OWNERS or (
            of == "surface" and (not callable(axes) or hasattr(axes, "function_space"))
        ):
            raise ValueError(
                f'of must be "body" or "surface", the owner of axes given as a field, and "surface" needs a callable of its own '
                f"positions: got of={of!r} with axes={axes!r}"
            )
        self.of = of
        given = {"mu": mu, "p": p, "axes": axes}
        self._given, self.exponent = {key: valued(key, value) for key, value in given.items()}, k
        self._laws: dict[int, Any] = {}
        self._soft: dict[int, np.ndarray] = {}
        self.field = any(map(is_field, self._given.values()))
        if not self.field:
            self._set_coefficients(mu, p, k, axes)
        self._made = True

    @staticmethod
    def of_pair(first: Friction | float, second: Friction | float, angle: float = 0.0) -> Friction:
        """Friction of a pair of textured sides; its work is the mean of both sides' work.

        If both sides have the same principal directions, ``mu`` is the mean of both and the
        frictional work is exact.  Otherwise no orthotropic law is exact, and the work is at most
        the mean: in the worst direction, 5 % less for ``mu`` 2 : 1 across 1 : 2, and 11 % less for
        3 : 1 across 1 : 3; see ``law/pair.py``.  For another rule, write a function of two
        ``Friction`` objects that returns one.

        Args:
            first, second: Friction of each side, given by numbers or by arrays per node, not by
                fields; a number is isotropic friction.  Instead of a field, pass the
                ``contact.friction`` of a contact with this field.
            angle: Angle about the normal, radians, from the first principal direction of the first
                side to the first principal direction of the second.  If the bodies turn relative to
                each other, assign a new pair between steps.

        Returns:
            A ``Friction`` in the local frame of the first side.

        Raises:
            ValueError: One of the two is a field, or the angle is not one finite number.

        Example:
            >>> crossed = dc.Friction.of_pair(dc.Friction((0.3, 0.1)), dc.Friction((0.3, 0.1)), angle=np.pi / 2)
        """
        from dolfinx_contact.law.pair import mean

        first, second = as_friction(first), as_friction(second)
        for law in (first, second):
            if not isinstance(law, Friction) or law.field:
                raise ValueError(
                    f"of_pair takes laws of numbers or arrays per node, not {law!r}: give a field to the contact first, whose contact.friction "
                    "has the values at its nodes, and pair that."
                )
        turned = float(number("angle", angle))
        sides = [
            (law.mu, law.Q, by + _angle(law.axes)) for law, by in ((first, 0.0), (second, turned))
        ]
        mu, p, axes = mean(*sides)
        straight = bool((axes[..., 0] == 1.0).all())
        if axes.ndim == 2:
            return Friction(
                np.broadcast_to(mu, axes.shape),
                np.broadcast_to(p, axes.shape),
                axes=None if straight else axes,
            )
        return Friction(mu, p, axes=None if straight else _Direction(axes))

    def _set_coefficients(self, mu: Any, p: Any, k: Any, axes: Any) -> None:
        given, mu = (mu, p, k), _cone(mu)
        if k is not None:
            q = _q_from_exponent(mu, k)
        elif p is not None:
            p_given, p = p, _coefficients("p", p)
            if np.any(p <= 0):
                raise ValueError(f"p must be positive, but is {p_given!r}; omit it for p = mu")
            if p.ndim == 2 and mu.ndim == 2 and p.shape != mu.shape:
                raise ValueError(f"p has shape {p.shape}, mu {mu.shape}: give both for each node")
            if p.ndim > mu.ndim:
                mu = np.tile(mu, (len(p), 1))
            p = p / p.max(axis=-1, keepdims=p.ndim > 0)
            q = np.divide(p, mu, out=np.ones_like(mu), where=mu > 0)
        else:
            q = np.ones_like(mu)
        q = q / q.max(axis=-1, keepdims=True)
        # p proportional to mu up to rounding is the associated rule
        q[1.0 - q.min(axis=-1) <= 4 * np.finfo(float).eps] = 1.0
        if q.min(initial=1.0) < _SMALLEST_COEFFICIENT:
            raise ValueError(
                f"p/mu must not differ by more than {_LARGEST_COEFFICIENT} between the two directions, "
                f"but does with mu={given[0]!r}, p={given[1]!r}, k={given[2]!r}"
            )
        axes = None if axes is None else _unit_vectors(axes, mu)
        self.mu, self.p, self.axes = (
            whole(f"friction.{name}", array, ARRAY_REMEDY)
            for name, array in (("mu", frozen(mu)), ("p", frozen(q * mu)), ("axes", axes))
        )
        self.frictionless = not (mu > 0).any()
        self.associated = bool(np.all(q == 1.0))
        self.isotropic = self.associated and bool(np.all(mu[..., 0] == mu[..., 1]))

    def __getattr__(self, name: str) -> Any:
        if name in Friction.__annotations__:
            raise AttributeError(
                f"{self!r} has no {name} yet: contact.friction has the values at the contact's nodes."
            )
        raise AttributeError(f"Friction has no attribute {name!r}")

    def given(self) -> dict[str, Any]:
        """``mu``, ``p`` and ``axes`` as the user gave them."""
        return self._given

    def __reduce__(self) -> tuple:
        if self.field:
            mu, p, axes = self._given.values()
            return partial(Friction, k=self.exponent, axes=axes, of=self.of), (mu, p)
        return partial(Friction, axes=self.axes), (self.mu, np.where(self.mu > 0, self.p, 1.0))

    def __repr__(self) -> str:
        if self.field:
            names = ", ".join(name for name, value in self._given.items() if is_field(value))
            return f"<Friction with {names} as a field>"
        if self.mu.ndim == 2:
            return f"<Friction with coefficients for {len(self.mu)} nodes>"
        mu, p = (tuple(map(float, array)) for array in (self.mu, self.p))
        return f"Friction(mu={mu})" if self.associated else f"Friction(mu={mu}, p={p})"

    @property
    def Q(self) -> np.ndarray:
        """Diagonal of ``Q = P M^-1`` [dSFMH07, Section 1], with 1 as its largest entry.

        It has the same shape as ``mu`` and is zero where ``mu`` is zero.
        """
        return np.divide(self.p, self.mu, out=np.zeros_like(self.mu), where=self.mu > 0)

    def at(self, nodes: np.ndarray) -> Friction:
        """Friction of a subset of the nodes; coefficients common to all nodes are unchanged.

        Args:
            nodes: Indices of the nodes, ``shape=(k,)``.
        """
        if self.mu.ndim == 1 and self.axes is None:
            return self
        mu, p = (rows if rows.ndim == 1 else rows[nodes] for rows in (self.mu, self.p))
        axes = None if self.axes is None else self.axes[nodes]
        return Friction(mu, np.where(mu > 0, p, 1.0), axes=axes)

    def along_axes(self, t: np.ndarray) -> np.ndarray:
        """Components along the principal friction directions of tangential vectors.

        Args:
            t: Vectors in the local frame, ``shape=(n, 2)``, or ``(n, 1)`` in two dimensions.

        Returns:
            The same shape.
        """
        if self.axes is None:
            return t
        (x, y), (cos, sin) = t.T, self.axes.T
        return np.column_stack((cos * x + sin * y, cos * y - sin * x))

    def against_slip(self, r_t: np.ndarray) -> np.ndarray:
        """Unit vectors along ``P^-2 r_t``, opposite to the slip [dSFMH07, Section 1].

        Args:
            r_t: Tangential reactions, ``shape=(n, 2)``, or ``(n, 1)`` in two dimensions, local
                frame.

        Returns:
            The same shape, dimensionless; zero where ``r_t`` or ``mu`` is zero.
        """
        p = self.p[..., : r_t.shape[1]]
        smallest = p.min(axis=-1, keepdims=True)
        softness = np.divide(smallest, p, out=np.zeros_like(p), where=p > 0) ** 2
        _, unit = split(r_t)
        _, against = split(softness * self.along_axes(unit))
        return self._from_axes(against)

    def drag(self, slip: np.ndarray) -> np.ndarray:
        """Friction per normal reaction that opposes a slip, ``d(s) = P^2 s / |M^-1 P^2 s|``.

        The friction force is ``r_t = -r_n d(s)`` [dSFMH07, Section 1].

        Args:
            slip: Slip ``s``, ``shape=(n, T)``, local frame, ``T = gdim - 1``; only its direction
                matters.

        Returns:
            The same shape, local frame, dimensionless; zero where ``slip`` or ``mu`` is zero.
        """
        unit, _ = self._resisted(slip)
        return self._from_axes(self.mu[..., : slip.shape[1]] * unit)

    def drag_with_slope(self, slip: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """``drag(slip)`` and its derivative along ``along``, ``shape=(n, T)`` each, local frame.

        The derivative of ``drag(slip + w along)`` with respect to w at 0 has the inverse unit of
        ``slip``.
        """
        (unit, length), along = self._resisted(slip), self.along_axes(along)
        mu, T = self.mu[..., : slip.shape[1]], slip.shape[1]
        rate = np.divide(
            self._softness(T) * along, length, out=np.zeros_like(along), where=length > 0
        )
        turning = rate - (rate * unit).sum(axis=1, keepdims=True) * unit
        return self._from_axes(mu * unit), self._from_axes(mu * turning)

    def over_radii(self, t: np.ndarray) -> np.ndarray:
        """``M^-1 t`` along the principal directions, ``shape=(n, T)``; zero without friction.

        Args:
            t: Tangential vectors, ``shape=(n, T)``, local frame.
        """
        mu = np.broadcast_to(self.mu[..., : t.shape[1]], t.shape)
        return np.divide(self.along_axes(t), mu, out=np.zeros_like(t), where=mu > 0)

    def times_radii(self, t: np.ndarray) -> np.ndarray:
        """``M t`` for tangential vectors ``t`` in the local frame, ``shape=(n, T)``, same frame."""
        return self._from_axes(self.mu[..., : t.shape[1]] * self.along_axes(t))

    def _resisted(self, slip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unit vectors along ``M^-1 P^2 slip``, and lengths up to a constant factor.

        Components are along the principal directions, ``shape=(n, T)``; lengths have
        ``shape=(n, 1)``.
        """
        length, unit = split(slip)
        factor, resisted = split(self._softness(slip.shape[1]) * self.along_axes(unit))
        return resisted, length * factor

    def _softness(self, T: int) -> np.ndarray:
        """Diagonal of ``M^-1 P^2``, scaled to a largest entry of 1, ``shape=(T,)`` or ``(n, T)``.

        It is zero without friction.
        """
        if T not in self._soft:
            weight = self.Q[..., :T] ** 2 * self.mu[..., :T]
            largest = weight.max(axis=-1, keepdims=True)
            self._soft[T] = np.divide(weight, largest, out=np.zeros_like(weight), where=largest > 0)
        return self._soft[T]

    def _from_axes(self, t: np.ndarray) -> np.ndarray:
        """Vectors in the local frame with given components along the principal directions."""
        if self.axes is None:
            return t
        (x, y), (cos, sin) = t.T, self.axes.T
        return np.column_stack((cos * x - sin * y, sin * x + cos * y))

    def law(self, dim: int):
        """Compiled friction law in 2 or 3 dimensions, a ``ContactLaw`` of ``law/maps.py``.

        Args:
            dim: Number of dimensions, 2 or 3.

        Raises:
            ValueError: In two dimensions, friction is not isotropic or has axes, but there is only
                one tangential direction.
        """
        if dim == 2 and not self.isotropic:
            raise ValueError(
                "in two dimensions there is one tangential direction: give mu as one number and no "
                f"p, not {self!r}"
            )
        if dim == 2 and self.axes is not None:
            raise ValueError("in two dimensions there is one tangential direction: give no axes")
        if dim not in self._laws:
            mu = np.ascontiguousarray(self.mu[..., : dim - 1])
            p = None if self.associated else np.where(self.mu > 0, self.p, 1.0)
            self._laws[dim] = _kernel.make_law(mu, p, dim, self.axes)
        return self._laws[dim]


class _Direction:
    """Field of a constant direction in the local frames of all nodes.

    Args:
        axis: Unit vector, ``shape=(2,)``.
    """

    def __init__(self, axis: np.ndarray):
        self._axis = axis

    def __call__(self, x: np.ndarray) -> np.ndarray:
        return np.repeat(self._axis[:, None], x.shape[1], axis=1)


def _angle(axes: np.ndarray | None) -> Any:
    return 0.0 if axes is None else np.arctan2(axes[:, 1], axes[:, 0])


def at_most_rough(friction: Friction) -> Friction:
    """Friction with coefficients of at most ``ROUGH_COEFFICIENT``.

    Larger coefficients have almost the same effect, but amplify rounding errors of slip.
    """
    if not (friction.mu > ROUGH_COEFFICIENT).any():
        return friction
    mu = np.minimum(friction.mu, ROUGH_COEFFICIENT)
    p = None if friction.associated else np.where(mu > 0, friction.p, 1.0)
    return Friction(mu, p, axes=friction.axes)


def _q_from_exponent(mu: np.ndarray, k: float | str) -> np.ndarray:
    """Diagonal of ``Q = P M^-1``, up to a factor, for ``p_y / p_x = (mu_y / mu_x)**k``.

    Logarithms avoid overflow.
    """
    exponent = finite("k", k)
    if exponent.shape != ():
        raise ValueError(f"k must be one real number, not {k!r}")
    positive = np.where(mu > 0, mu, 1.0)
    log_q = (float(exponent) - 1.0) * np.log(positive)
    return np.exp(log_q - log_q.max(axis=-1, keepdims=True))


def _unit_vectors(axes: ArrayLike, mu: np.ndarray) -> np.ndarray:
    given = np.asarray(axes)
    if given.dtype.kind != "f" or given.ndim != 2 or given.shape[1] != 2:
        raise ValueError(
            f"axes must be real numbers of shape (n, 2), not {given.dtype} of {given.shape}"
        )
    if mu.ndim == 2 and len(given) != len(mu):
        raise ValueError(f"axes are for {len(given)} nodes, mu for {len(mu)}")
    length = np.linalg.norm(given, axis=1)
    wrong = ~(np.abs(length - 1.0) < 1e-6)
    if wrong.any():
        raise ValueError(
            f"axes must be unit vectors (cos, sin), not {given[wrong][0]} of length "
            f"{length[wrong][0]}"
        )
    return frozen(given.astype(np.float64) / length[:, None])


def as_friction(friction: Any) -> Any:
    """A ``Friction`` for a number (isotropic coefficient); any other value unchanged."""
    number = isinstance(friction, Real) or (isinstance(friction, np.ndarray) and friction.ndim == 0)
    return Friction(friction) if number and not isinstance(friction, (bool, np.bool_)) else friction


def is_field(value: object) -> bool:
    """Whether a value is a callable of positions or a DOLFINx Function."""
    return callable(value) or hasattr(value, "function_space")


def split(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lengths, ``shape=(n, 1)``, and unit vectors, ``shape=(n, T)``; zero vectors stay zero."""
    length = np.hypot.reduce(np.abs(t), axis=1, keepdims=True)  # abs: one column is only copied
    return length, np.divide(t, length, out=np.zeros_like(t), where=length > 0)


def principal_axes(friction: Friction, nodes: int, dim: int) -> np.ndarray:
    """Rotations from local frames to principal axes, ``shape=(nodes, dim, dim)``."""
    turns = np.tile(np.eye(dim), (nodes, 1, 1))
    if friction.axes is not None:
        cos, sin = friction.axes.T
        turns[:, 0, 0], turns[:, 0, 1] = cos, sin
        turns[:, 1, 0], turns[:, 1, 1] = -sin, cos
    return turns
