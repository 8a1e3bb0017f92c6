"""Take a robot of servos into service stage by stage, each with a go or a no-go."""
