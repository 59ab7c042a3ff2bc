"""Signals as rows of equations: filters, derivatives, rates and the noise of rows."""
