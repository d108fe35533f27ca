"""Media: extinction, optical depth and bounds in float64, and the numbers that kernels read."""
