"""Pictures of the robot, offscreen or in a window."""
