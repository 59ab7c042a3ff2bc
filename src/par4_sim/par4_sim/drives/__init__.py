"""What follows references: the queue of their points, the laws of the drives, the control step."""
