# Copyright (c) 2025 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""The scenes of the stress matrix: a block on a plane in all the ways that may break a solver."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
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
    steps, start = [], 0.0
    for _ in range(count):
        steps += list(np.linspace(start, high, 6)[1:]) + list(np.linspace(high, low, 11)[1:])
        start = low
    return [(0, 0, -d) for d in steps]


def turning(steps=16):
    """Pressed, then dragged around a circle."""
    angles = np.linspace(0, 2 * np.pi, steps + 1)
    return [(0, 0, -0.01)] + [(0.004 * np.cos(a), 0.004 * np.sin(a), -0.01) for a in angles]


def circle(**how):
    """Slides of 0.01 in 73 directions; the first one closes the circle."""
    angles = np.linspace(0, 2 * np.pi, 73)
    return [Move((0.01 * np.cos(a), 0.01 * np.sin(a), 0), **how) for a in angles]


PROGRAMMES = {
    "press": [(0, 0, -0.005), (0.001, 0.0005, -0.01), (0.002, -0.001, -0.006), (0.01, 0, -0.002)],
    "six cycles": cycles(6),
    "one step": [(0, 0, -0.01)],
    "one large step": [(0, 0, -0.1)],
    "to zero and again": cycles(2, low=0.0),
    "into the air": [(0, 0, -0.01), (0, 0, 0.05), (0.01, 0, 0.05), (0.01, 0, -0.01), (0, 0, 0.01)],
    "reversals": [(0.004 * (-1) ** k, 0.002 * (-1) ** (k // 2), -0.01) for k in range(12)],
    "turning": turning(),
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
    "unloaded": circle(fresh=True),
    "after a load was removed": [(0, 0, -0.01), (0, 0, 0), *circle()],
    "lift after a touch of 1e-6": [(0, 0, -1e-6), (0, 0, 0.1), (0, 0, 0.1)],
    "lift after a touch of 1e-8": [(0, 0, -1e-8), (0, 0, 0.1), (0, 0, 0.1)],
    **{f"grazing at 1e-{k}": [(0.1, 0, -(10.0**-k))] for k in range(9, 15)},
}  # fmt: skip
PAPERS = list(PROGRAMMES)[: list(PROGRAMMES).index("tip")]  # with the laws of the paper


def small(scene: Scene) -> Scene:
    """The same scene for slow programs: nine contact nodes where it names no number of cells, and of a
    thousand steps the first 90."""
    return replace(scene, body={"cells": (2, 2, 1)} | scene.body, most_steps=90)


def scenes() -> list[Scene]:
    """All scenes, in an order that does not change."""
    found = []

    def add(group, name, programme="press", **body):
        found.append(Scene(group, f"{name}, {programme}", programme, body))

    for (law, friction), programme in product(LAWS.items(), PAPERS):
        add("paper's laws", law, programme, **friction)
    for mu, programme in product(
        (0, 1e-6, 1e-4, 1e-3, 1e-2, 0.05, 0.1, 0.3, 0.5, 0.8, 1, 3, 10, 100, 1e3),
        ("press", "reversals", "turning"),
    ):
        add("isotropic mu", f"mu {mu:g}", programme, mu=mu)
    for ratio, swap, programme in product(
        (3, 10, 30, 100, 300, 1e3), (1, -1), ("press", "turning")
    ):
        add("mu ratio", f"{ratio:g} {swap:+d}", programme, mu=(0.3, 0.3 / ratio)[::swap])
    for ratio, kind, mu, programme in product(
        (3, 10, 30, 100, 300, 1e3),
        ("aligned", "crossed"),
        ((0.3, 0.15), (0.3, 0.03), (1.0, 0.1)),
        ("press", "reversals"),
    ):
        p = (1.0, 1 / ratio) if kind == "aligned" else (1 / ratio, 1.0)
        add("p ratio", f"{ratio:g} {kind} mu {mu}", programme, mu=mu, p=p)
    for nu, (law, friction), programme in product(
        (0.0, 0.45, 0.49, 0.499, 0.49999), LAWS.items(), ("press", "into the air")
    ):
        add("nearly incompressible", f"nu {nu} {law}", programme, nu=nu, **friction)
    for length, E, (law, friction) in product(
        (1e-9, 1.0, 1e9), (1e-6, 1.0, 2.1e5, 1e15), LAWS.items()
    ):
        add("units", f"length {length:g} E {E:g} {law}", length=length, E=E, **friction)
    for seed, (law, friction), programme in product(
        range(6), LAWS.items(), ("press", "into the air")
    ):
        add("inclined", f"rotation {seed} {law}", programme, turn=rotation(seed), **friction)
    for aspect, (law, friction) in product((10, 1e2, 1e3, 1e4), LAWS.items()):
        add("slivers", f"aspect {aspect:g} {law}", aspect=aspect, **friction)
    for jump, (law, friction) in product((1e-6, 1e-3, 1e3, 1e6), LAWS.items()):
        add("stiffness jumps", f"jump {jump:g} {law}", jump=jump, **friction)
    for spring, (law, friction), programme in product(
        (1.0, 1e-2, 1e-4, 1e-6), LAWS.items(), ("press", "rocking")
    ):
        add("soft spring", f"spring {spring:g} {law}", programme, spring=spring, **friction)
    for cells, (law, friction) in product(((1, 1, 1), (2, 1, 1), (8, 8, 2)), LAWS.items()):
        add("few and many nodes", f"cells {cells} {law}", cells=cells, **friction)
    for seed in range(150):
        found.append(Scene("random condensed", f"seed {seed}", "condensed", seed=seed))
    found += hard_scenes()
    found.sort(key=lambda scene: scene.programme == "1000 tiny steps")  # the long ones last
    return found


def hard_scenes() -> list[Scene]:
    """Slender and softly held bodies, states with small forces, and where too large a scale broke down."""
    found = []

    def add(group, name, programme, tol=1e-8, goes_on=False, **body):
        name = f"{name} {law}, {programme}"
        found.append(Scene(group, name, programme, body | friction, tol=tol, goes_on=goes_on))

    for law, friction in LAWS.items():
        for slender, nx in ((3, 6), (10, 20), (30, 30), (60, 60), (100, 60)):
            add("cantilevers", f"L/W {slender}", "tip", edges=(slender, 1.0, 1.0), cells=(nx, 2, 2), tip=2.5 * slender / nx)  # fmt: skip
            add("columns", f"L/W {slender}", "press", edges=(1.0, 1.0, slender), cells=(2, 2, nx // 2))  # fmt: skip
        for spring, programme in product((1e-7, 1e-8, 1e-9), ("press", "rocking")):
            add("softest springs", f"spring {spring:g}", programme, spring=spring)
        for spring in (1e-2, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9):
            add("own weight on springs", f"spring {spring:g}", "weight", spring=spring, loads=True)
        for spring in (1e-2, 1e-4, 1e-6, 1e-9):
            add("own weight on springs", f"143 nodes spring {spring:g}", "weight", spring=spring, loads=True, cells=(12, 10, 2))  # fmt: skip
        for spring in (1e-4, 1e-9):
            add("softest springs", f"143 nodes spring {spring:g}", "rocking", spring=spring, cells=(12, 10, 2))  # fmt: skip
        for programme in ("deep unloading", "deep unloading after a drag"):
            add("deep unloading", "block", programme)
        for cells in ((4, 4, 2), (8, 8, 2)):
            add("partial lift-off", f"cells {cells}", "tilting", cells=cells)
        for ratio, thickness in product((1e4, 1e-4), (0.1, 0.01)):
            add("thin coatings", f"modulus {ratio:g} thickness {thickness:g}", "press", coat=(ratio, thickness), cells=(4, 4, 3))  # fmt: skip
        for programme in ("press", "turning"):
            add("tiny and huge elements", "1 to 1000", programme, grade=1e3, cells=(8, 8, 2))
        for programme in ("unloaded", "after a load was removed"):
            add("sliding without load", "block", programme, goes_on=True)
        add("sliding without load", "no contact", "unloaded", goes_on=True, touching=False)
        for k, tol in ((6, 1e-10), (8, 1e-8)):
            add("lift after a light touch", f"tol {tol:g}", f"lift after a touch of 1e-{k}", tol, True, E=1.0, cells=(4, 4, 3))  # fmt: skip
        for k in range(9, 15):
            add("grazing while sliding", "block", f"grazing at 1e-{k}")
            found.append(Scene("grazing condensed", f"depth 1e-{k} {law}", "condensed", friction, depth=10.0**-k))  # fmt: skip
    return found
