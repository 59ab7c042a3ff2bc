"""What computes the motion of a machine: exact, by pybullet, behind springs and gaps."""
