"""The robot as URDF: chains for the rigid-body engine, the tree to look at, `robot_description`."""
