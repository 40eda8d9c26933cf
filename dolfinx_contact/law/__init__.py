# Copyright (c) 2026 The dolfinx_contact authors
# SPDX-License-Identifier: MIT
"""Friction law on NumPy arrays, without DOLFINx: coefficients, cone, maps, dissipation and wear."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dolfinx_contact.law.bipotential import bipotential_gap
    from dolfinx_contact.law.friction import Friction
    from dolfinx_contact.law.friction_cone import load_function, project_cone
    from dolfinx_contact.law.wear import Wear

__all__ = ["Friction", "Wear", "bipotential_gap", "load_function", "project_cone"]

_MODULE_OF_NAME = dict(
    zip(__all__, ("friction", "wear", "bipotential", "friction_cone", "friction_cone"))
)


def __getattr__(name: str) -> object:
    if name not in _MODULE_OF_NAME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(f"{__name__}.{_MODULE_OF_NAME[name]}"), name)
    return value
