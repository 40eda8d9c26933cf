# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Statics of a body that contact alone holds: whether reactions can balance its loads, and whether it can still move."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from mpi4py import MPI

from dolfinx_contact.bodies.loose import times_volume
from dolfinx_contact.contact.nodal import times
from dolfinx_contact.law.friction import principal_axes
from dolfinx_contact.results.record import NO_SOLUTION, NOT_HELD
from dolfinx_contact.step.errors import BLIND_ROUNDING, contact_rounding
from dolfinx_contact.support.checks import UNIT_ROUNDOFF
from dolfinx_contact.support.line_search import halves
from dolfinx_contact.surfaces.sliding import nothing_holds

if TYPE_CHECKING:
    from dolfinx_contact.step.load_step import LoadStep, StepState
    from dolfinx_contact.surfaces.driven import DrivenSurfaces

# Part of loads and reactions that is rounding, of their sum that may be left, and rays of friction cones that are tried.
LOAD_ROUNDING = 1e-12
BALANCED_PART = 1e-7
CONE_RAYS = 400

# What reactions may leave of loads in a state that is no more than rounding away from a solution.
ROUGH_BALANCE = 1e-3

# Part of a motion that is none.
NEGLIGIBLE_MOTION = 1e-6

# Balance that takes reactions more than so many times the loads, as of a body jammed between planes, counts as none.
JAMMED_RATIO = 1e9

# A motion is undetermined if it changes less than this part of what springs at all nodes would change of reactions; a
# body slides away along it if it changes less than the second number, and loads are not balanced.
UNFELT_PART = 1e-9
SLIDING_PART = 1e-3

# Where a body is moved to before it is taken back out of the planes, over the largest gap.
FAR_RATIO = 30.0

# The shortest part of a step towards the last state that is tried.
SHORTEST_STEP = 2.0**-11


class Statics:
    """Loads and reactions of a loose body along its rigid motions ``Z``, which have no elastic energy.

    Args:
        step: The ``LoadStep`` of a body with ``loose`` motions.
        last: The last converged displacement, owned degrees of freedom.  Collective.

    Attributes:
        loads: Their sums along the motions, ``shape=(m,)``; zero where they are rounding.
        last: The last converged displacement.
        start: Displacement near which the solution may lie; ``placed`` if it is not the last one.
        message: Why there is no static state, in words; empty where there may be one.
        reason: The same as the record of a step has it.

    Raises:
        ValueError: on all ranks, if no contact node is on a part of the body that nothing holds.
    """

    def __init__(self, step: LoadStep, last: np.ndarray):
        body, contacts = step.body, step.contacts
        self._body, self._contacts, self._modes = body, contacts, body.loose.modes
        m, self._dim = self._modes.shape[1], body.V.mesh.geometry.dim
        parts, coefficients = [np.zeros((0, self._dim, m))], [np.zeros((0, self._dim - 1))]
        for contact in contacts:
            points = contact.points
            motion = points.motion(self._modes)
            points.without_held(motion[:, :-1])
            motion[points.closed] = 0.0
            turns = principal_axes(contact.free_friction, points.count, self._dim)
            parts.append(turns @ motion)
            mu = contact.free_friction.mu[..., : self._dim - 1]
            coefficients.append(np.broadcast_to(mu, (points.count, self._dim - 1)))
        self._motion, self._mu = np.concatenate(parts), np.concatenate(coefficients)
        self._felt = body.total((self._motion**2).sum(axis=(0, 1)))
        self.start, self.last, self.placed, self.message = last, last, False, ""
        self.reason = NO_SOLUTION
        if not self._felt.all():
            free = body.loose.refusal(np.eye(m)[:, self._felt == 0.0])
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
        escape, self._balancing = self._escape(self._motion, self.loads)
        if escape is None and step.surfaces is not None:
            escape, _ = self._escape(*self._with_surfaces(step.surfaces))
            self.message = "" if escape is None else nothing_holds(contacts)
        # Planes that move alone are the concern of ``DrivenSurfaces.beyond``.
        if escape is not None and np.linalg.norm(escape[:m]) > NEGLIGIBLE_MOTION * np.linalg.norm(
            escape
        ):
            self.message = self.message or (
                f"The loads drive {body.loose.words(escape[:m])}, which no reactions of the contact nodes within their friction can "
                "hold: no static state exists"
            )

    def _with_surfaces(self, surfaces: DrivenSurfaces) -> tuple[np.ndarray, np.ndarray]:
        """Motions of the contact nodes with those of planes under dead loads behind the body's, and what drives both.

        Of such planes reactions are in balance with their forces: ``D^T r = F``, what they press with is known.
        """
        dead, felt = surfaces.springs == 0.0, self._felt.max()
        driving = surfaces.driving(np.zeros(surfaces.count))[dead]
        parts = [np.zeros((0, self._dim, dead.sum()))]
        for contact, axes in zip(self._contacts, surfaces.axes):
            turns = principal_axes(contact.free_friction, contact.points.count, self._dim)
            parts.append(-turns @ axes[:, :, dead])
        moved = np.concatenate(parts)
        sizes = np.sqrt(self._body.total((moved**2).sum(axis=(0, 1))) / felt)
        sizes[sizes == 0.0] = np.inf  # nothing of it is felt
        return np.concatenate((self._motion, moved / sizes), axis=2), np.append(
            self.loads, driving / sizes
        )

    def _escape(
        self, motion: np.ndarray, loads: np.ndarray
    ) -> tuple[np.ndarray | None, np.ndarray]:
        """A motion along which loads push and no reaction can hold, ``shape=(m,)``, None if there is none; what balances them.

        Args:
            motion: Of the contact nodes, ``shape=(n, gdim, m)``.
            loads: Along the motions.

        The sums of forces and moments that reactions in their friction cones can have are a cone.  The loads' nearest
        point in it leaves a rest: along that motion loads do work, and reactions can only do more.  It is found by
        the rays that reach farthest along the rest, one after another, and least squares with weights that are not
        negative.  The last ones are reactions that balance the loads.
        """
        unit = float(np.linalg.norm(loads)) or 1.0
        target, rays, weights = -loads / unit, np.zeros((loads.size, 0)), np.zeros(0)
        rest, kept, balancing = target, [], np.zeros(motion.shape[:2])
        for _ in range(CONE_RAYS):
            if np.linalg.norm(rest) <= BALANCED_PART:
                break
            reach, ray, *reaction = self._farthest(motion, rest)
            length = float(np.linalg.norm(ray))
            if reach <= length * max(1e-14, np.linalg.norm(rest) / JAMMED_RATIO):
                return self._along_surfaces(-rest, loads, kept, weights), balancing
            rays = np.column_stack((rays[:, weights > 0], ray))
            kept = [one for one, weight in zip(kept, weights) if weight > 0] + [reaction]
            weights, _ = self._body.comm.bcast(
                _cone_weights(rays, target, float(np.linalg.norm(rest)))
            )
            rest = target - rays @ weights
        for weight, (_, reaction) in zip(weights, kept):
            balancing += unit * weight * reaction
        return None, balancing  # or not decided: the solver will

    def _along_surfaces(
        self, motion: np.ndarray, loads: np.ndarray, kept: list, weights: np.ndarray
    ) -> np.ndarray:
        """The part of a motion with which the nodes of some reactions stay on their planes, if loads drive that."""
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
        """Of reactions with ``r_n = 1`` at one node those whose sums reach farthest along a motion.

        Returns:
            How far; the sums; what ``r_n`` alone makes of them; the reactions of this rank's nodes.
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
        """Move the start until it touches, where it can.  Collective.

        A linear program for the rigid motion: no node penetrates, and those of the reactions that balance the loads are
        as near as they can be.
        """
        gaps = [contact.at(self.start).gap for contact in self._contacts]
        gaps = np.concatenate([np.zeros(0), *gaps])
        mine = self._motion[:, -1], gaps, self._balancing[:, -1]
        parts = [np.concatenate(each) for each in zip(*self._body.comm.allgather(mine))]
        motion = self._body.comm.bcast(_touching(*parts) if self._body.comm.rank == 0 else None)
        if motion is not None:
            self.start, self.placed = self.start + self._modes @ motion, True

    def follow(self) -> None:
        """Let the start move along with surfaces that have moved, by the rigid motion nearest to theirs.  Collective.

        By least squares over nodes that were pressed: without slip where there is friction, with the gap that they had.
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
        """What the loads are of those that the last reactions balance: these may only have to be scaled.  Collective."""
        forces = np.zeros(self._body.size)
        for contact in self._contacts:
            contact.points.add_forces(contact.last.reaction, forces)
        sums = self._body.total(self._modes.T @ forces)
        return max(float(-(self.loads @ sums) / ((sums @ sums) or 1.0)), 0.0)

    def _free_motions(self, state: StepState, x: np.ndarray, unfelt: float) -> np.ndarray:
        """Motions that change no reaction of a state, to first order: ``shape=(m, k)``.  Collective.

        Args:
            state: The state.
            x: Displacement about as large as that of the state: nodes pressed by no more than its rounding are not.
            unfelt: A motion is one of them if it changes less than this part of what springs at all nodes would.
        """
        changed = [np.zeros((0, self._felt.size))]
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
                (by_motion @ contact.points.motion(self._modes)).reshape(-1, self._felt.size)
            )
        changed = np.concatenate(changed) / np.sqrt(self._felt)
        if len(changed) > self._felt.size:  # and not empty, as where a rank has no contact nodes
            changed = np.linalg.qr(changed, mode="r")
        decomposed = np.linalg.svd(np.concatenate(self._body.comm.allgather(changed)))
        _, values, vectors = self._body.comm.bcast(decomposed)  # to the same bits on all ranks
        small = np.append(values, np.zeros(len(vectors) - len(values))) <= unfelt
        return vectors[small].T / np.sqrt(self._felt)[:, None]

    def slides(self, state: StepState) -> bool:
        """Whether loads are left along a motion that changes no reaction of a state; says so.  Collective."""
        motions = self._free_motions(state, self.last, SLIDING_PART)
        left, sizes = self._left(state)
        driven = (
            motions @ np.linalg.lstsq(motions.T @ motions, motions.T @ self.loads, rcond=None)[0]
        )
        least = ROUGH_BALANCE * np.linalg.norm(driven) * np.linalg.norm(sizes)
        if np.linalg.norm(left) > np.linalg.norm(self.loads):
            return False  # reactions of a body that is lost, not of one that slides
        if driven @ self.loads <= least or abs(driven @ left) <= least:
            both = (self.loads, left)
            overcome = [along for along in both if self._overcome(state, along, sizes)]
            if not overcome:
                return False
            driven = overcome[0]
        if self._presses(driven):
            return False
        self.message = (
            f"In the best state found the loads drive {self._body.loose.words(driven)} by more than friction carries with its "
            f"normal forces{', of which there are none' if self._unpressed(state) else ''}"
        )
        return True

    def _presses(self, along: np.ndarray) -> bool:
        """Whether a motion takes nodes into their planes: normal reactions would grow until they hold it.  Collective."""
        velocity = self._motion @ along
        into, fastest = self._body.largest(-velocity[:, -1]), self._body.largest(np.abs(velocity))
        return into > ROUGH_BALANCE * fastest

    def _overcome(self, state: StepState, along: np.ndarray, sizes: np.ndarray) -> bool:
        """Whether loads along a motion are more than normal reactions carry with all their friction.  Collective."""
        velocity = self._motion @ along
        friction = np.linalg.norm(self._mu * velocity[:, :-1], axis=1)
        carried = self._body.total([_pressures(state) @ (friction - velocity[:, -1])])[0]
        least = ROUGH_BALANCE * np.linalg.norm(along) * np.linalg.norm(sizes)
        return bool(self.loads @ along - carried > least)

    def _needed(self, state: StepState) -> str:
        """Whether friction or a normal force is missing where no reaction changes with a motion, in words.  Collective."""
        if self._unpressed(state):
            return (
                "Friction holds nothing, since no node with friction is pressed: add a normal force"
            )
        return "No reaction changes with them: add friction"

    def _unpressed(self, state: StepState) -> bool:
        """Whether there is friction, but only at nodes that are not pressed.  Collective."""
        mu, largest = self._mu.max(axis=1, initial=0.0), self._body.largest
        return largest(mu) > 0.0 >= largest(mu * _pressures(state))

    def hidden(self, step: LoadStep) -> str:
        """Whether rounding in gaps and slips makes forces as large as the loads, in words.  Collective."""
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
        """Whether reactions balance the loads, roughly: of a body that is lost rounding hides that they do not.  Collective.

        Along motions without loads reactions may be no more than rounding, and say nothing.
        """
        left, sizes = self._left(state)
        return bool((np.abs(left) <= ROUGH_BALANCE * sizes)[self.loads != 0.0].all())

    def _left(self, state: StepState) -> tuple[np.ndarray, np.ndarray]:
        """Sums of loads and reactions along the motions, and those of their magnitudes.  Collective."""
        forces = np.zeros((2, self._body.size))
        for contact, nodes in zip(self._contacts, state.nodes):
            contact.points.add_forces(nodes.reaction, forces[0])
            contact.points.add_magnitudes(nodes.reaction, forces[1])
        sums, sizes = self._body.total(
            [self._modes.T @ forces[0], np.abs(self._modes).T @ forces[1]]
        )
        return sums + self.loads, sizes + np.abs(self.loads)

    def settled(self, state: StepState, choice: str) -> StepState:
        """A solution whose undetermined motions are those nearest to the last displacement, by volume.  Collective.

        Args:
            state: A solution.
            choice: "refused" or "nearest".

        Raises:
            ValueError: on all ranks, if a motion is undetermined and none is to be chosen.
        """
        step, x = state.step, state.x
        motions = self._free_motions(state, x, UNFELT_PART)
        if not motions.size:
            return state
        if choice == "refused":
            raise ValueError(
                f"{self._body.loose.refusal(motions)} {self._needed(state)} or a soft spring, fix them by Dirichlet conditions, "
                'or take the state nearest to the last one by dc.ContactProblem(..., undetermined="nearest").'
            )
        Z = self._modes @ motions
        weighed = times_volume(
            self._body.displacements, Z
        )  # nearest is least the integral of |du|^2
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
    """Normal reactions of all contacts."""
    return np.concatenate([np.zeros(0), *(nodes.reaction[:, -1] for nodes in state.nodes)])


def _cone_weights(
    rays: np.ndarray, target: np.ndarray, scale: float = 1.0
) -> tuple[np.ndarray, float]:
    """Weights, none negative, of columns whose sum is nearest to a target, and its distance.

    ``scale`` is about that distance: SciPy compares with its tolerance what is not relative to it.

    By bounded least squares [P. B. Stark, R. L. Parker, Computational Statistics 10 (1995) 129]: SciPy's ``nnls`` is
    another program from release to release, and that of 1.15 stops early here.
    """
    from scipy.optimize import lsq_linear  # of loose bodies alone

    lengths = np.linalg.norm(rays, axis=0)
    lengths[lengths == 0.0] = 1.0
    found = lsq_linear(
        rays / lengths, target / scale, bounds=(0.0, np.inf), method="bvls", tol=1e-15
    )
    weights = scale * found.x / lengths
    return weights, float(np.linalg.norm(rays @ weights - target))


def _touching(normal: np.ndarray, gap: np.ndarray, force: np.ndarray) -> np.ndarray | None:
    """The motion ``c`` with ``gap + normal c >= 0`` that is nearest to a far one against these forces; None if there is none.

    Least distance by non-negative least squares [C. L. Lawson, R. J. Hanson, Solving Least Squares Problems, 1974].
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
    rest = np.vstack((normal.T, below)) @ weights - np.append(np.zeros(len(far)), 1.0)
    if rest[-1] == 0.0:  # minus the square of what is left, which rounding has taken
        return None
    return far - length * rest[:-1] / rest[-1]
