"""The machine as it truly is: bodies, friction, transmissions, amplifiers, sensors and noise."""
