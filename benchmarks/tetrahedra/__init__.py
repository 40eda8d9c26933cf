"""Contact of second-order tetrahedra: nodes, weighted gaps or points within facets, on the same bodies and by the same solver."""
