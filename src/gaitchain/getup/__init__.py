"""Get up after a fall: key poses found in the robot's own model, arms and all. Ours."""
