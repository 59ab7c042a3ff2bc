"""Plant, drives and sensors as one simulation, and the experiments that are made with it."""
