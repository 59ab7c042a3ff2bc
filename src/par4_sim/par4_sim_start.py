"""Executables of par4_sim; the package itself is loaded once a signal is quiet."""

from par4_start import Tool, node_starts


def simulation() -> int:
    """Run the node par4_simulation; return its exit code."""
    node_starts()
    from par4_sim.ros import simulation
    return simulation()


def cell() -> None:
    """Run the tool par4_cell."""
    with Tool():
        from par4_sim.commands.cell import main
        main()


def simulate() -> None:
    """Run the tool par4_simulate."""
    with Tool():
        from par4_sim.commands.simulate import main
        main()


def fastest() -> None:
    """Run the tool par4_fastest."""
    with Tool():
        from par4_sim.commands.fastest import main
        main()


def track() -> None:
    """Run the tool par4_track."""
    with Tool():
        from par4_sim.commands.track import main
        main()


def push() -> None:
    """Run the tool par4_push."""
    with Tool():
        from par4_sim.commands.push import main
        main()
