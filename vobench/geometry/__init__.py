"""SE(3), cameras and rigs: pure functions on float64 arrays."""
