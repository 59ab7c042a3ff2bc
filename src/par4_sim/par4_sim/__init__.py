"""Simulated Par4 with drives and sensors, in pybullet and in reduced coordinates."""
