"""Linear solvers: PETSc behind a few verbs."""
