"""Balance and motion of a walk: sensors to servo targets, one period at a time."""
