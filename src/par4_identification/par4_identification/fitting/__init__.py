"""Base parameters of a machine from its rows, and how well they hold."""
