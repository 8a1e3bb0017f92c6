"""The dynamic gait: strides and swing shapes in place of key poses."""
