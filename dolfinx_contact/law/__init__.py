"""The friction law: coefficients, cone, maps, work and wear; arrays alone, without DOLFINx."""
