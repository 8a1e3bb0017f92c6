"""Full robots: their joints and their MuJoCo models."""
