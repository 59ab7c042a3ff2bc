"""The model that a diagnosis starts from, or why the data cannot carry a diagnosis."""
