# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Statics of a body held by contact alone, called a loose body.

Checks whether reactions can balance its loads, and whether it can move without resistance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.bodies.loose import times_volume
from dolfinx_contact.contact.geometry import times
from dolfinx_contact.law.friction import principal_axes
from dolfinx_contact.results.record import NO_SOLUTION, NOT_HELD
from dolfinx_contact.step.errors import BLIND_ROUNDING, contact_rounding
from dolfinx_contact.support.checks import UNIT_ROUNDOFF
from dolfinx_contact.support.line_search import halves
from dolfinx_contact.surfaces.sliding import nothing_holds

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState
    from dolfinx_contact.surfaces.driven import DrivenSurfaces

# Sums of loads or reactions below this fraction of their magnitudes are rounding.
LOAD_ROUNDING = 1e-12

# Loads count as balanced if the residual is below this fraction of them.
BALANCED_PART = 1e-7

# Largest number of rays of friction cones in the search for balancing reactions.
CONE_RAYS = 400

# Residual of the balance, relative to loads and reactions, that rounding may leave in a solution.
ROUGH_BALANCE = 1e-3

# Components of a motion below this fraction of it are zero.
NEGLIGIBLE_MOTION = 1e-6

# If balance needs reactions above this multiple of the loads, as for a body jammed between planes,
# it is treated as impossible.
JAMMED_RATIO = 1e9

# A motion is undetermined if the reactions change by less than this fraction of the change which
# springs at all contact nodes would cause.
UNFELT_PART = 1e-9

# A body with unbalanced loads slides away along a motion if the reactions change by less than this
# fraction of the same change.
SLIDING_PART = 1e-3

# Distance by which a body is moved along its loads before it is moved back out of the surfaces,
# over the largest gap.
FAR_RATIO = 30.0

# Smallest fraction of the step towards the last state that the line search tries.
SHORTEST_STEP = 2.0**-11


class Statics:
    """Loads and reactions of a body held by contact alone, along its free rigid motions ``Z``.

    Args:
        step: The ``LoadStep`` of a body with free rigid motions, ``body.loose``.
        last: The last converged displacement, owned degrees of freedom.  Collective.

    Attributes:
        loads: Resultants of the loads along the ``m`` motions, ``shape=(m,)``; zero where they are
            rounding.
        last: The last converged displacement.
        start: Initial guess of the displacement.
        placed: Whether ``start`` was moved to first contact, see ``place``.
        message: Why there is no static state, in words; empty if there may be one.
        reason: Short form of ``message`` for the record of the step.

    Raises:
        ValueError: on all ranks, if no contact node can resist a rigid motion of the body.
    """

    def __init__(self, step: LoadStep, last: np.ndarray):
        body, contacts = step.body, step.contacts
        self._body, self._contacts, self._modes = body, contacts, body.loose.modes
        m, self._dim = self._modes.shape[1], body.V.mesh.geometry.dim
        parts, coefficients = [np.zeros((0, self._dim, m))], [np.zeros((0, self._dim - 1))]
        for contact in contacts:
            points = contact.points
            motion = points.motion(self._modes)
            points.remove_constrained(motion[:, :-1])
            motion[points.closed] = 0.0
            turns = principal_axes(contact.free_friction, points.count, self._dim)
            parts.append(turns @ motion)
            mu = contact.free_friction.mu[..., : self._dim - 1]
            coefficients.append(np.broadcast_to(mu, (points.count, self._dim - 1)))
        self._motion, self._mu = np.concatenate(parts), np.concatenate(coefficients)
        self._motion_squares = body.total((self._motion**2).sum(axis=(0, 1)))
        self.start, self.last, self.placed, self.message = last, last, False, ""
        self.reason = NO_SOLUTION
        if not self._motion_squares.all():
            free = body.loose.refusal(np.eye(m)[:, self._motion_squares == 0.0])
            if not any(not contact.given.history.empty for contact in contacts):
                raise ValueError(
                    f"{free} No contact node can hold it: fix it by Dirichlet "
                    "conditions, add a soft spring to F, or name the facets that may touch."
                )
            self.message = f"where the search has moved it, {free} A smaller step stays nearer to what held it in the last one"
            self.reason = NOT_HELD
        b = step.free(step.b)
        sums, sizes = body.total([self._modes.T @ b, np.abs(self._modes).T @ np.abs(b)])
        self.loads = np.where(np.abs(sums) <= LOAD_ROUNDING * sizes, 0.0, sums)
        escape, self._balancing = self._unresisted_motion(self._motion, self.loads)
        if escape is None and step.surfaces is not None:
            escape, _ = self._unresisted_motion(*self._with_surfaces(step.surfaces))
            self.message = "" if escape is None else nothing_holds(contacts)
        # ``DrivenSurfaces.beyond`` treats motions of surfaces without the body.
        if escape is not None and np.linalg.norm(escape[:m]) > NEGLIGIBLE_MOTION * np.linalg.norm(
            escape
        ):
            self.message = self.message or (
                f"The loads drive {body.loose.words(escape[:m])}, which no reactions of the contact nodes within their friction can "
                "hold: no static state exists"
            )

    def _with_surfaces(self, surfaces: DrivenSurfaces) -> tuple[np.ndarray, np.ndarray]:
        """Return the motions of body and surfaces under dead loads, and the loads along them.

        The reactions on these surfaces balance their given forces, ``D^T r = F``.

        Returns:
            Motions of the contact nodes, ``shape=(n, gdim, m)``, the motions of the body first;
            loads along all motions, ``shape=(m,)``.
        """
        dead, felt = surfaces.springs == 0.0, self._motion_squares.max()
        driving = surfaces.driving(np.zeros(surfaces.count))[dead]
        parts = [np.zeros((0, self._dim, dead.sum()))]
        for contact, axes in zip(self._contacts, surfaces.axes):
            turns = principal_axes(contact.free_friction, contact.points.count, self._dim)
            parts.append(-turns @ axes[:, :, dead])
        moved = np.concatenate(parts)
        sizes = np.sqrt(self._body.total((moved**2).sum(axis=(0, 1))) / felt)
        sizes[sizes == 0.0] = np.inf  # the motion moves no contact node
        return np.concatenate((self._motion, moved / sizes), axis=2), np.append(
            self.loads, driving / sizes
        )

    def _unresisted_motion(
        self, motion: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """Return a motion that the loads drive and reactions cannot resist, or balancing reactions.

        Args:
            motion: Motions of the contact nodes, ``shape=(n, gdim, m)``, local frame.
            loads: Loads along the motions, ``shape=(m,)``.

        Returns:
            The motion, ``shape=(m,)``, or None if the loads can be balanced; reactions that balance
            the loads, ``shape=(n, gdim)``, zero if there are none.

        The resultants of all reactions within their friction cones form a convex cone.  The point
        of this cone nearest to minus the loads leaves a residual.  Minus the residual is a motion
        along which the loads do positive work and reactions no negative work.  The point is found
        by adding extreme rays of the cone in the direction of the residual, one at a time, and by
        non-negative least squares for their weights.
        """
        unit = float(np.linalg.norm(loads)) or 1.0
        target, rays, weights = -loads / unit, np.zeros((loads.size, 0)), np.zeros(0)
        residual, kept, balancing = target, [], np.zeros(motion.shape[:2])
        for _ in range(CONE_RAYS):
            if np.linalg.norm(residual) <= BALANCED_PART:
                break
            reach, ray, *reaction = self._farthest(motion, residual)
            length = float(np.linalg.norm(ray))
            if reach <= length * max(1e-14, np.linalg.norm(residual) / JAMMED_RATIO):
                return self._along_surfaces(-residual, loads, kept, weights), balancing
            rays = np.column_stack((rays[:, weights > 0], ray))
            kept = [one for one, weight in zip(kept, weights) if weight > 0] + [reaction]
            weights, _ = self._body.comm.bcast(
                _cone_weights(rays, target, float(np.linalg.norm(residual)))
            )
            residual = target - rays @ weights
        for weight, (_, reaction) in zip(weights, kept):
            balancing += unit * weight * reaction
        return None, balancing  # balanced, or undecided: then the solver decides

    def _along_surfaces(
        self, motion: np.ndarray, loads: np.ndarray, kept: list, weights: np.ndarray
    ) -> np.ndarray:
        """Return the part of a motion tangential to the surfaces, if the loads drive this part.

        Args:
            motion: The motion, ``shape=(m,)``.
            loads: Loads along the motions, ``shape=(m,)``.
            kept: Resultants of a unit normal reaction, and reactions, of each ray.
            weights: Weights of the rays; only rays with positive weight count.

        Returns:
            The tangential part of the motion if the loads drive it, else the motion.
        """
        normals = [normal for (normal, _), weight in zip(kept, weights) if weight > 0]
        if normals:
            along = (
                motion
                - np.linalg.lstsq(np.array(normals), np.array(normals) @ motion, rcond=1e-9)[0]
            )
            if along @ loads > NEGLIGIBLE_MOTION * np.linalg.norm(loads) * np.linalg.norm(motion):
                return along
        return motion

    def _farthest(
        self, motion: np.ndarray, along: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Return the reaction with ``r_n = 1`` at one node that does most work along a motion.

        Returns:
            Its work; its resultants, ``shape=(m,)``; the resultants of ``r_n`` alone; the reactions
            of this rank's nodes, ``shape=(n, gdim)``.
        """
        velocity, reaction = motion @ along, np.zeros(motion.shape[:2])
        tangential = self._mu * velocity[:, :-1]
        length = np.linalg.norm(tangential, axis=1)
        reach = velocity[:, -1] + length
        largest = (float(reach.max(initial=-np.inf)), self._body.comm.rank)
        reached, owner = self._body.comm.allreduce(largest, op=MPI.MAXLOC)
        ray = None
        if self._body.comm.rank == owner:
            k = int(reach.argmax())
            way = np.divide(tangential[k], length[k], np.zeros(self._dim - 1), where=length[k] > 0)
            reaction[k] = np.append(self._mu[k] * way, 1.0)
            ray = reaction[k] @ motion[k], motion[k, -1]
        return reached, *self._body.comm.bcast(ray, root=owner), reaction

    def place(self) -> None:
        """Move ``start`` by a rigid motion to first contact, if possible.  Collective.

        No node penetrates, and the nodes whose reactions balance the loads are as close to their
        surfaces as possible.
        """
        gaps = [contact.at(self.start).gap for contact in self._contacts]
        gaps = np.concatenate([np.zeros(0), *gaps])
        mine = self._motion[:, -1], gaps, self._balancing[:, -1]
        parts = [np.concatenate(each) for each in zip(*self._body.comm.allgather(mine))]
        motion = self._body.comm.bcast(_touching(*parts) if self._body.comm.rank == 0 else None)
        if motion is not None:
            self.start, self.placed = self.start + self._modes @ motion, True

    def follow(self) -> None:
        """Move ``start`` by the rigid motion that best follows the moved surfaces.  Collective.

        It is a least-squares fit over the nodes pressed at the end of the last step, weighted by
        normal
        reactions: gaps are kept, and nodes with friction do not slip.
        """
        m, dim = self._motion.shape[2], self._dim
        left, weights = [np.zeros((0, dim))], [np.zeros((0, dim))]
        for contact in self._contacts:
            state = contact.at(self.last)
            off = np.column_stack((state.slip_increment, state.gap - contact.last.gap))
            left.append(times(principal_axes(contact.free_friction, len(off), dim), off))
            weights.append(np.repeat(contact.last.reaction[:, -1:], dim, axis=1))
        off, weight = np.concatenate(left), np.concatenate(weights)
        weight[:, :-1] *= self._mu > 0.0
        square = np.einsum("ni,nij,nik->jk", weight, self._motion, self._motion)
        sums = np.einsum("ni,nij,ni->j", weight, self._motion, off)
        both = self._body.total(np.concatenate((square.ravel(), sums)))
        way = -np.linalg.lstsq(
            both[: m * m].reshape(m, m), both[m * m :], rcond=NEGLIGIBLE_MOTION**2
        )[0]
        self.start = self.last + self._modes @ way

    def share(self) -> float:
        """Return the ratio of the loads to the loads balanced by the last reactions.  Collective.

        If the loads are only scaled, the last reactions times this ratio balance them.
        """
        forces = np.zeros(self._body.size)
        for contact in self._contacts:
            contact.points.add_forces(contact.last.reaction, forces)
        sums = self._body.total(self._modes.T @ forces)
        return max(float(-(self.loads @ sums) / ((sums @ sums) or 1.0)), 0.0)

    def _free_motions(self, state: StepState, x: np.ndarray, unfelt: float) -> np.ndarray:
        """Return motions that change no reaction to first order, ``shape=(m, k)``.  Collective.

        Args:
            state: The state.
            x: Displacement of a size comparable to the state's; nodes whose pressing force is
                within the rounding due to ``x`` count as open.
            unfelt: Largest change of the reactions, relative to the change which springs at all
                nodes would cause.
        """
        changed = [np.zeros((0, self._motion_squares.size))]
        least = LOAD_ROUNDING * self._body.largest(_pressures(state))
        for contact, nodes in zip(state.step.contacts, state.nodes):
            kappa, given = (
                contact.stiffness.normal,
                (nodes.reaction, nodes.gap, nodes.slip_increment),
            )
            by_motion = contact.measuring_map().linearised(contact.law, *given)[-1]
            by_motion = by_motion / kappa[:, None, None]
            rounding = contact_rounding(contact, nodes, x)[:, -1]
            by_motion[nodes.reaction[:, -1] <= np.maximum(least, rounding)] = 0.0
            changed.append(
                (by_motion @ contact.points.motion(self._modes)).reshape(
                    -1, self._motion_squares.size
                )
            )
        changed = np.concatenate(changed) / np.sqrt(self._motion_squares)
        if len(changed) > self._motion_squares.size:  # not on ranks with few or no contact nodes
            changed = np.linalg.qr(changed, mode="r")
        decomposed = np.linalg.svd(np.concatenate(self._body.comm.allgather(changed)))
        _, values, vectors = self._body.comm.bcast(decomposed)  # bitwise equal on all ranks
        small = np.append(values, np.zeros(len(vectors) - len(values))) <= unfelt
        return vectors[small].T / np.sqrt(self._motion_squares)[:, None]

    def slides(self, state: StepState) -> bool:
        """Return whether the loads exceed friction along a motion.  Collective.

        If they do, ``message`` is set.  The motion changes no reaction of the state to first order,
        so the body slides away along it.
        """
        motions = self._free_motions(state, self.last, SLIDING_PART)
        left, sizes = self._imbalance(state)
        driven = (
            motions @ np.linalg.lstsq(motions.T @ motions, motions.T @ self.loads, rcond=None)[0]
        )
        least = ROUGH_BALANCE * np.linalg.norm(driven) * np.linalg.norm(sizes)
        if np.linalg.norm(left) > np.linalg.norm(self.loads):
            return False  # the reactions are meaningless: the body has left the surfaces
        if driven @ self.loads <= least or abs(driven @ left) <= least:
            both = (self.loads, left)
            overcome = [along for along in both if self._exceeds_friction(state, along, sizes)]
            if not overcome:
                return False
            driven = overcome[0]
        if self._presses(driven):
            return False
        self.message = (
            f"In the best state found the loads drive {self._body.loose.words(driven)} by more than friction carries with its "
            f"normal forces{', of which there are none' if self._friction_unpressed(state) else ''}"
        )
        return True

    def _presses(self, along: np.ndarray) -> bool:
        """Return whether a motion moves nodes into their surfaces.  Collective.

        Normal reactions would then grow until they hold the body.
        """
        velocity = self._motion @ along
        into, fastest = self._body.largest(-velocity[:, -1]), self._body.largest(np.abs(velocity))
        return into > ROUGH_BALANCE * fastest

    def _exceeds_friction(self, state: StepState, along: np.ndarray, sizes: np.ndarray) -> bool:
        """Return whether the loads exceed the resistance to a motion.  Collective.

        The resistance is the work of the state's normal reactions and of their full friction.
        """
        velocity = self._motion @ along
        friction = np.linalg.norm(self._mu * velocity[:, :-1], axis=1)
        carried = self._body.total([_pressures(state) @ (friction - velocity[:, -1])])[0]
        least = ROUGH_BALANCE * np.linalg.norm(along) * np.linalg.norm(sizes)
        return bool(self.loads @ along - carried > least)

    def _advice(self, state: StepState) -> str:
        """Return advice for undetermined motions: add friction, or a normal force.  Collective."""
        if self._friction_unpressed(state):
            return (
                "Friction holds nothing, since no node with friction is pressed: add a normal force"
            )
        return "No reaction changes with them: add friction"

    def _friction_unpressed(self, state: StepState) -> bool:
        """Return whether friction exists only at nodes that are not pressed.  Collective."""
        mu, largest = self._mu.max(axis=1, initial=0.0), self._body.largest
        return largest(mu) > 0.0 >= largest(mu * _pressures(state))

    def hidden(self, step: LoadStep) -> str:
        """Return a message if rounding in gaps and slips hides the loads, else empty.  Collective.

        Rounding errors, as forces, are then not small compared with the external forces.
        """
        total, unit = self._body.total, step.unit
        rounding = [np.zeros(0)]
        for contact in step.contacts:
            rounding.append(contact_rounding(contact, contact.at(self.last), self.last).ravel())
        forces = np.concatenate(rounding), UNIT_ROUNDOFF * self._body.cancelling(self.last)
        hiding = np.sqrt(max(total(np.square(force / unit).sum()) for force in forces))
        acting = self._body.norm(step.external / unit)
        if not 0.0 < BLIND_ROUNDING * acting <= hiding:
            return ""
        return (
            f"Loads are {unit * acting:.1e}, and rounding of coordinates and displacements alone makes contact forces of "
            f"{unit * hiding:.1e}: no step can tell what holds the body. Take the load off altogether, or leave a thousand times as much"
        )

    def balanced(self, state: StepState) -> bool:
        """Return whether reactions balance the loads approximately.  Collective.

        For a body that has moved far away, rounding may hide an imbalance from the errors.  Motions
        without loads are not checked, since reactions along them may be rounding alone.
        """
        left, sizes = self._imbalance(state)
        return bool((np.abs(left) <= ROUGH_BALANCE * sizes)[self.loads != 0.0].all())

    def _imbalance(self, state: StepState) -> tuple[np.ndarray, np.ndarray]:
        """Return the imbalance along the motions, and the size of its terms.  Collective.

        Returns:
            Sums of loads and reactions, and sums of their magnitudes, ``shape=(m,)`` each.
        """
        forces = np.zeros((2, self._body.size))
        for contact, nodes in zip(self._contacts, state.nodes):
            contact.points.add_forces(nodes.reaction, forces[0])
            contact.points.add_magnitudes(nodes.reaction, forces[1])
        sums, sizes = self._body.total(
            [self._modes.T @ forces[0], np.abs(self._modes).T @ forces[1]]
        )
        return sums + self.loads, sizes + np.abs(self.loads)

    def settled(self, state: StepState, choice: str) -> StepState:
        """Return a solution with its undetermined motions chosen.  Collective.

        The result minimises the integral of ``|du|^2`` over the volume, with the difference ``du``
        to the last displacement, as far as the state remains a solution.

        Args:
            state: A solution.
            choice: "refused" or "nearest".

        Raises:
            ValueError: on all ranks, if a motion is undetermined and ``choice`` is "refused".
        """
        step, x = state.step, state.x
        motions = self._free_motions(state, x, UNFELT_PART)
        if not motions.size:
            return state
        if choice == "refused":
            raise ValueError(
                f"{self._body.loose.refusal(motions)} {self._advice(state)} or a soft spring, fix them by Dirichlet conditions, "
                'or take the state nearest to the last one by dc.ContactProblem(..., undetermined="nearest").'
            )
        Z = self._modes @ motions
        weighed = times_volume(self._body.displacements, Z)  # for the integral of |du|^2
        apart, sizes = (
            self._body.total(weighed.T @ (self.last - x)),
            self._body.total(weighed.T @ Z),
        )
        way = Z @ np.linalg.solve(sizes, apart)
        for length in halves(SHORTEST_STEP):
            trial = step.measure(x + length * way, before=state)
            if trial.within:
                return trial
        return state


def _pressures(state: StepState) -> np.ndarray:
    """Return the normal reactions of all contacts in one array."""
    return np.concatenate([np.zeros(0), *(nodes.reaction[:, -1] for nodes in state.nodes)])


def _cone_weights(
    rays: np.ndarray, target: np.ndarray, scale: float = 1.0
) -> tuple[np.ndarray, float]:
    """Return the solution of a non-negative least-squares problem, and its residual norm.

    Args:
        rays: Matrix, a ray in each column.
        target: Vector to approximate by a sum of rays with non-negative weights.
        scale: Estimate of the residual norm, since SciPy's tolerance is absolute.

    It uses bounded-variable least squares [P. B. Stark, R. L. Parker, Computational Statistics 10
    (1995) 129], since SciPy's ``nnls`` changes between releases and stops early here in version
    1.15.
    """
    from scipy.optimize import lsq_linear  # imported only for loose bodies

    lengths = np.linalg.norm(rays, axis=0)
    lengths[lengths == 0.0] = 1.0
    found = lsq_linear(
        rays / lengths, target / scale, bounds=(0.0, np.inf), method="bvls", tol=1e-15
    )
    weights = scale * found.x / lengths
    return weights, float(np.linalg.norm(rays @ weights - target))


def _touching(normal: np.ndarray, gap: np.ndarray, force: np.ndarray) -> np.ndarray | None:
    """Return the motion ``c`` with ``gap + normal c >= 0`` nearest to a distant target.

    The target is a large motion against the given forces.  The least-distance problem is solved by
    non-negative least squares [C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974].

    Args:
        normal: Normal motion of each node by the rigid motions, ``shape=(n, m)``.
        gap: Gaps, ``shape=(n,)``, length.
        force: Normal forces, ``shape=(n,)``.

    Returns:
        The motion, ``shape=(m,)``; None if there is none.
    """
    against = -force @ normal
    length, most = np.abs(gap).max(), np.linalg.norm(against) * np.linalg.norm(normal, axis=1).max()
    if not length * most > 0.0:
        return None
    far = FAR_RATIO * length * np.linalg.norm(against) / most * against / np.linalg.norm(against)
    below = -(gap + normal @ far) / length
    weights, left = _cone_weights(np.vstack((normal.T, below)), np.append(np.zeros(len(far)), 1.0))
    if not left > 1e-14:
        return None
    residual = np.vstack((normal.T, below)) @ weights - np.append(np.zeros(len(far)), 1.0)
    if residual[-1] == 0.0:  # minus the squared residual, lost in rounding
        return None
    return far - length * residual[:-1] / residual[-1]
