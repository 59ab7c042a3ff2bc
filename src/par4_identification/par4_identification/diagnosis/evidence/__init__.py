"""What the data say of a hypothesis: rows, columns, whitened algebra."""
