"""Studies: computations that reproduce a paper. From the clone's root: ``python -m studies.punch``."""
