"""Key poses and strides, the gait library and its file, schedules."""
