"""Executables of par4_identification; the package itself is loaded once a signal is quiet."""

from par4_start import Tool, asked_for, node_starts

REPAIR = '--repair'
"""As `par4_sim.choices.REPAIR`, which would have to be loaded first."""


def record() -> int:
    """Run the node par4_record, or the tool that mends a bag; return the exit code."""
    if asked_for(REPAIR):
        with Tool():
            from par4_identification.commands.repair import main
            main()
    node_starts()
    from par4_identification.ros import record
    return record()


def monitor() -> int:
    """Run the node par4_monitor; return its exit code."""
    node_starts()
    from par4_identification.ros import monitor
    return monitor()


def excite() -> None:
    """Run the tool par4_excite."""
    with Tool():
        from par4_identification.commands.excite import main
        main()


def bag() -> None:
    """Run the tool par4_bag."""
    with Tool():
        from par4_identification.commands.bag import main
        main()


def identify() -> None:
    """Run the tool par4_identify."""
    with Tool():
        from par4_identification.commands.identify import main
        main()


def validate() -> None:
    """Run the tool par4_validate."""
    with Tool():
        from par4_identification.commands.validate import main
        main()


def diagnose() -> None:
    """Run the tool par4_diagnose."""
    with Tool():
        from par4_identification.commands.diagnose import main
        main()


def trend() -> None:
    """Run the tool par4_trend."""
    with Tool():
        from par4_identification.commands.trend import main
        main()


def simplification() -> None:
    """Run the tool par4_simplification."""
    with Tool():
        from par4_identification.commands.simplification import main
        main()


def drive_gain() -> None:
    """Run the tool par4_drive_gain."""
    with Tool():
        from par4_identification.commands.drive_gain import main
        main()
