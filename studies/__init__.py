"""Studies: programmes of computations that reproduce a paper. Run from the clone's root: ``python -m studies.punch``."""
