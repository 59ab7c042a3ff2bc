"""Drive gains and payloads: what scales torque, and what is carried."""
