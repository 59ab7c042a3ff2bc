"""The search for causes: shapes, candidates, and what a cause must gain."""
