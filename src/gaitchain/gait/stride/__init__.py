"""The dynamic gait: strides and swing shapes in the place of key poses."""
