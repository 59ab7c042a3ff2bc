"""Command lines; each file is one executable."""
