"""What tests and benchmarks share: scenes, a material, a judge of answers, orders of convergence; no part of any solver."""
