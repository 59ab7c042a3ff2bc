"""Node of par4_sim."""
