"""What tests and benchmarks share: scenes, a material, a judge of answers; no part of any solver."""
