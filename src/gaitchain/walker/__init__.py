"""The walker: commands and sensors in, joint targets out, one control period a call."""
