"""MuJoCo: the robot's model, the world around it, and what the robot cannot sense."""
