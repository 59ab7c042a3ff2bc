"""Node of par4_identification."""
