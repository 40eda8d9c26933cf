# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""A step is a value: nothing that is asked of it changes anything."""

import dataclasses
import gc
from contextlib import suppress
from weakref import WeakSet

import dolfinx_contact as dc  # before DOLFINx, which one of its wheels needs

# isort: split
import numpy as np
import pytest
from golden_scenes import COMM, SCENES

from dolfinx_contact.solvers.search import Search
from dolfinx_contact.step.load_step import StepState

# Planes, curved, turning, driven, loose, shared nodes, guided, wear, pressure, two bodies, nonlinear, mixed.
KINDS = (
    "cube", "sphere", "turning", "weight", "tipping", "spring", "loose", "corner", "floor_and_wall", "pushed", "worn", "by_pressure", "small_sliding",
    "ironing", "both_wear", "rubber_block", "mixed",
)  # fmt: skip
FOREIGN = 3  # evaluations of other displacements after each state that a search sees
STEPS = 3


def arrays(value, seen=None):
    """All NumPy arrays that a value holds, through tuples, lists, dictionaries and data classes."""
    seen = set() if seen is None else seen
    if id(value) in seen:
        return []
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        return [value]
    if isinstance(value, dict):
        return [a for part in value.values() for a in arrays(part, seen)]
    if isinstance(value, (tuple, list)):
        return [a for part in value for a in arrays(part, seen)]
    if dataclasses.is_dataclass(value):
        return [a for f in dataclasses.fields(value) for a in arrays(getattr(value, f.name), seen)]
    return []


def held(step, state):
    """What a step, a state, the contacts, their surfaces and ``u`` consist of."""
    contacts = [contact.given for contact in step.contacts]
    given = [(c.present, c.history, c.friction.mu, c.friction.p) for c in contacts]
    surfaces = [contact.surface.stands for contact in contacts]
    own = {name: part for name, part in vars(step).items() if name != "body"}
    return arrays([own, state.nodes, state.required, state.forces, given, surfaces, step.body.u.x.array])  # fmt: skip


def run(name, solver):
    """Reactions of the contacts of a scene after each of its first steps."""
    found = []
    for k, problem in enumerate(SCENES[name].steps(solver=solver)):
        problem.solve()
        found.append([contact.reaction.copy() for contact in problem.contacts])
        if k == STEPS - 1:
            break
    return found


@pytest.mark.ranks
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", KINDS)
def test_evaluations_of_foreign_displacements_change_nothing(name, monkeypatch):
    """Between iterations a step is evaluated at random displacements: every array is as it was, and so is the answer."""
    alone, own, asked = run(name, dc.FixedPoint()), Search.see, []
    random = np.random.default_rng(COMM.rank)

    def see(search, state):
        found, step = own(search, state), search.step
        before = [array.copy() for array in held(step, found)]
        size = step.body.largest(np.abs(found.x)) or 1.0
        for _ in range(FOREIGN):
            x = found.x + size * random.normal(size=found.x.size)
            with np.errstate(all="ignore"):
                other = step.evaluate(x, step.error_maps, before=found)
                step.derivatives(other, step.error_maps)
                asked.append(other.errors.largest)
        after = held(step, found)
        assert len(before) == len(after) > 20
        assert all(np.array_equal(a, b, equal_nan=True) for a, b in zip(before, after))
        return found

    monkeypatch.setattr(Search, "see", see)
    watched = run(name, dc.FixedPoint())
    assert len(asked) >= FOREIGN
    for one, other in zip(alone, watched):
        for a, b in zip(one, other):
            size = max(np.abs(a).max(initial=0.0), np.finfo(float).tiny)
            # on several ranks MUMPS adds in the order of messages
            assert (
                np.array_equal(a, b)
                if COMM.size == 1
                else np.abs(a - b).max(initial=0.0) <= 1e-7 * size
            )


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("solver", ["FixedPoint", "CondensedNewton", "SparseNewton"])
@pytest.mark.parametrize("name", KINDS)
def test_three_states_at_most_are_in_memory(name, solver, monkeypatch):
    """Told of each iterate, a monitor finds no more than three states of the contacts, without Python's search for cycles: what is no longer needed is freed at once."""
    alive, most, own = WeakSet(), [], StepState.__post_init__

    def made(state):
        own(state)
        alive.add(state)

    monkeypatch.setattr(StepState, "__post_init__", made)
    gc.disable()
    try:
        for problem in SCENES[name].steps(solver=getattr(dc, solver)()):
            problem.monitor = lambda *_: most.append(len({id(s.nodes[0].reaction) for s in alive}))
            with suppress(dc.NotConverged, ValueError):
                problem.solve()
    finally:
        gc.enable()
    assert max(most, default=1) <= 3
