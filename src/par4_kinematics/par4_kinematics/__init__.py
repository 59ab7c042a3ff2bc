"""Kinematics, motions, files and contract of the Par4 parallel robot."""
