"""The simulation against the measurement, with the model before and after."""
