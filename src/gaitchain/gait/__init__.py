"""What can be walked: key poses, strides, their library and its file, schedules."""
