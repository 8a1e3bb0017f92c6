"""The dynamic gait: strides in place of key poses."""
