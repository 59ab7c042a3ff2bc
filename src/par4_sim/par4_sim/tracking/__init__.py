"""How well a machine follows a motion: controllers, models and motions compared."""
