"""Estimators of linear problems y = W chi; nothing in here knows what machine the rows are of."""
