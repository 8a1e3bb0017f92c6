"""Commands and sensors to joint targets, one control period at a time."""
