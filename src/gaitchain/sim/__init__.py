"""MuJoCo: the robot's model, its world with disturbances, and the ground truth."""
