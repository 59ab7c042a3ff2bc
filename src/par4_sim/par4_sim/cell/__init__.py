"""Which nodes run together, the runner for them, layouts of tools that show their topics."""
