# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The scenes of the stress matrix: a block on a plane in all the ways that may break a solver."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product

import numpy as np

from mechanics.scenes import Move, rotation

A = dict(mu=0.2)
B = dict(mu=(0.3, 0.15))
C = dict(mu=(0.3, 0.15), p=(0.05, 0.20))
LAWS = {"A": A, "B": B, "C": C}


@dataclass
class Scene:
    """A name, a group for tables, and what ``build`` or a random problem is made of."""

    group: str
    name: str
    programme: str = "press"
    body: dict = field(default_factory=dict)
    seed: int | None = None  # of a random condensed problem
    most_steps: int | None = None  # of the programme
    depth: float | None = None  # of a condensed problem that slides at a penetration of this depth
    tol: float = 1e-8
    goes_on: bool = False  # a step that is refused does not end it

    @property
    def tops(self) -> list[tuple]:
        """Displacements of the top, step by step, scene's axes."""
        return PROGRAMMES[self.programme][: self.most_steps]

    @property
    def condensed(self) -> bool:
        """Whether it is given as arrays, without a body."""
        return self.seed is not None or self.depth is not None


def cycles(count, high=0.01, low=0.002):
    """Up and down in 5 + 10 increments, as the paper; displacement of the top, scene's axes."""
    steps = []
    for start in [0.0, *[low] * (count - 1)]:
        steps += [*np.linspace(start, high, 6)[1:], *np.linspace(high, low, 11)[1:]]
    return [(0, 0, -d) for d in steps]


def circle(radius, steps, depth):
    """Around a circle at one height; the last step closes it."""
    angles = np.linspace(0, 2 * np.pi, steps + 1)
    return [(radius * np.cos(a), radius * np.sin(a), -depth) for a in angles]


PROGRAMMES = {
    "press": [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.01, 0, -0.002)],
    "six cycles": cycles(6),
    "one step": [(0, 0, -0.01)],
    "one large step": [(0, 0, -0.1)],
    "to zero and again": cycles(2, low=0.0),
    "into the air": [(0, 0, -0.01), (0, 0, 0.05), (0.01, 0, 0.05), (0.01, 0, -0.01), (0, 0, 0.01)],
    "reversals": [(0.004 * (-1) ** k, 0.002 * (-1) ** (k // 2), -0.01) for k in range(12)],
    "turning": [(0, 0, -0.01), *circle(0.004, 16, 0.01)],
    "1000 tiny steps": [(1e-5 * k, 0, -1e-5 * k) for k in range(1, 1001)],
    "rocking": [(0, 0, -0.005), (0.02, 0, -0.005), (-0.02, 0, -0.003), (0, 0.02, -0.004)],
    "tip": [(0, 0, -0.01), (0.002, 0.001, -0.02), (0.004, -0.002, -0.01), (0, 0.01, -0.002)],
    "weight": [Move(load=(x, y, z)) for x, y, z in
               ((0, 0, -1e-3), (1.5e-4, 0, -1e-3), (1.5e-4, 1e-4, -1e-3), (-5e-5, 1e-4, -7e-4))],
    "deep unloading": [(0, 0, -(10.0**-k)) for k in range(2, 9)],
    "deep unloading after a drag":
        [(0, 0, -0.01), (0.002, 0.001, -0.01)] + [(0.002, 0, -(10.0**-k)) for k in range(3, 9)],
    "tilting": [Move((x, 0, -0.005), tilt) for x, tilt in
                ((0, 0), (0, 0.005), (0, 0.02), (0.002, 0.05), (0.004, -0.02), (0.004, 0))],
    "unloaded": [Move(top, fresh=True) for top in circle(0.01, 72, 0)],
    "after a load was removed": [(0, 0, -0.01), (0, 0, 0), *circle(0.01, 72, 0)],
    "lift after a touch of 1e-6": [(0, 0, -1e-6), (0, 0, 0.1), (0, 0, 0.1)],
    "lift after a touch of 1e-8": [(0, 0, -1e-8), (0, 0, 0.1), (0, 0, 0.1)],
    **{f"grazing at 1e-{k}": [(0.1, 0, -(10.0**-k))] for k in range(9, 15)},
}  # fmt: skip
PAPERS = list(PROGRAMMES)[: list(PROGRAMMES).index("tip")]  # with the laws of the paper


def small(scene: Scene) -> Scene:
    """The same scene for slow programs: nine contact nodes where it names no number of cells, and of a
    thousand steps the first 90."""
    return replace(scene, body={"cells": (2, 2, 1)} | scene.body, most_steps=90)


class Family(list):
    """Scenes; a body that is added is given each law and programme, whose names become part of its own."""

    def __init__(self, kind=Scene):
        self._kind = kind

    def add(self, group, name, *programmes, laws=LAWS, tol=1e-8, goes_on=False, **body):
        for (law, friction), programme in product(laws.items(), programmes or ["press"]):
            full = f"{name} {law}".strip() + f", {programme}"
            self.append(
                self._kind(group, full, programme, body | friction, tol=tol, goes_on=goes_on)
            )


def scenes() -> list[Scene]:
    """All scenes, in an order that does not change."""
    found = Family()
    own, add = {"": {}}, found.add  # bodies with a law of their own
    add("paper's laws", "", *PAPERS)
    for mu in (0, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.3, 0.5, 0.8, 1, 3, 10, 100, 1e3):
        add("isotropic mu", f"mu {mu:g}", "press", "reversals", "turning", laws=own, mu=mu)
    for ratio, swap in product((3, 10, 30, 100, 300, 1e3), (1, -1)):
        mu = (0.3, 0.3 / ratio)[::swap]
        add("mu ratio", f"{ratio:g} {swap:+d}", "press", "turning", laws=own, mu=mu)
    coefficients = ((0.3, 0.15), (0.3, 0.03), (1.0, 0.1))
    for ratio, way, mu in product((3, 10, 30, 100, 300, 1e3), ("aligned", "crossed"), coefficients):
        p = (1.0, 1 / ratio) if way == "aligned" else (1 / ratio, 1.0)
        add("p ratio", f"{ratio:g} {way} mu {mu}", "press", "reversals", laws=own, mu=mu, p=p)
    for nu in (0.0, 0.45, 0.49, 0.499, 0.49999):
        add("nearly incompressible", f"nu {nu}", "press", "into the air", nu=nu)
    for length, E in product((1e-9, 1.0, 1e9), (1e-6, 1.0, 2.1e5, 1e15)):
        add("units", f"length {length:g} E {E:g}", length=length, E=E)
    for seed in range(6):
        add("inclined", f"rotation {seed}", "press", "into the air", turn=rotation(seed))
    for aspect in (10, 1e2, 1e3, 1e4):
        add("slivers", f"aspect {aspect:g}", aspect=aspect)
    for jump in (1e-6, 1e-3, 1e3, 1e6):
        add("stiffness jumps", f"jump {jump:g}", jump=jump)
    for spring in (1.0, 1e-2, 1e-4, 1e-6):
        add("soft spring", f"spring {spring:g}", "press", "rocking", spring=spring)
    for cells in ((1, 1, 1), (2, 1, 1), (8, 8, 2)):
        add("few and many nodes", f"cells {cells}", cells=cells)
    for seed in range(150):
        found.append(Scene("random condensed", f"seed {seed}", "condensed", seed=seed))
    found += hard_scenes()
    return sorted(
        found, key=lambda scene: scene.programme == "1000 tiny steps"
    )  # the long ones last


def hard_scenes() -> list[Scene]:
    """Slender and softly held bodies, states with small forces, and where too large a scale broke down."""
    found = Family()
    for law, friction in LAWS.items():
        add, many, high = partial(found.add, laws={law: friction}), (12, 10, 2), (4, 4, 3)
        for size, n in ((3, 6), (10, 20), (30, 30), (60, 60), (100, 60)):
            add("cantilevers", f"L/W {size}", "tip", edges=(size, 1, 1), cells=(n, 2, 2), tip=2.5 * size / n)  # fmt: skip
            add("columns", f"L/W {size}", edges=(1.0, 1.0, size), cells=(2, 2, n // 2))
        for spring in (1e-7, 1e-8, 1e-9):
            add("softest springs", f"spring {spring:g}", "press", "rocking", spring=spring)
        weight = partial(add, "own weight on springs", loads=True)
        for spring in (1e-2, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9):
            weight(f"spring {spring:g}", "weight", spring=spring)
        for spring in (1e-2, 1e-4, 1e-6, 1e-9):
            weight(f"143 nodes spring {spring:g}", "weight", spring=spring, cells=many)
        for spring in (1e-4, 1e-9):
            add(
                "softest springs",
                f"143 nodes spring {spring:g}",
                "rocking",
                spring=spring,
                cells=many,
            )
        add("deep unloading", "block", "deep unloading", "deep unloading after a drag")
        for cells in ((4, 4, 2), (8, 8, 2)):
            add("partial lift-off", f"cells {cells}", "tilting", cells=cells)
        for E, thick in product((1e4, 1e-4), (0.1, 0.01)):
            add("thin coatings", f"modulus {E:g} thickness {thick:g}", coat=(E, thick), cells=high)
        add("tiny and huge elements", "1 to 1000", "press", "turning", grade=1e3, cells=(8, 8, 2))
        slides = partial(add, "sliding without load", goes_on=True)
        slides("block", "unloaded", "after a load was removed")
        slides("no contact", "unloaded", touching=False)
        lifts = partial(add, "lift after a light touch", goes_on=True, E=1.0, cells=high)
        for k, tol in ((6, 1e-10), (8, 1e-8)):
            lifts(f"tol {tol:g}", f"lift after a touch of 1e-{k}", tol=tol)
        for k in range(9, 15):
            add("grazing while sliding", "block", f"grazing at 1e-{k}")
            name = f"depth 1e-{k} {law}"
            found.append(Scene("grazing condensed", name, "condensed", friction, depth=10.0**-k))
    return found
