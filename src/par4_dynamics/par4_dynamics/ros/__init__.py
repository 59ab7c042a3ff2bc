"""Node of par4_dynamics."""
