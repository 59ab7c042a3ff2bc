"""Nodes of par4_kinematics and what the nodes of all packages share."""
