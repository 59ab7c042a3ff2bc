"""Mistakes of the setup and faults of the log, looked for before any model is blamed."""
