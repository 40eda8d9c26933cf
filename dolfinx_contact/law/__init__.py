"""The friction law: coefficients, cone, maps, frictional work and wear; arrays alone, without DOLFINx."""

from dolfinx_contact.law.bipotential import bipotential_gap
from dolfinx_contact.law.friction import Friction
from dolfinx_contact.law.friction_cone import load_function, project_cone
from dolfinx_contact.law.wear import Wear

__all__ = ["Friction", "Wear", "bipotential_gap", "load_function", "project_cone"]
