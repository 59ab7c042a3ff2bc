"""Executables of par4_dynamics; the package itself is loaded once a signal is quiet."""

from par4_start import node_starts


def feedforward() -> int:
    """Run the node par4_feedforward; return its exit code."""
    node_starts()
    from par4_dynamics.ros import feedforward
    return feedforward()
