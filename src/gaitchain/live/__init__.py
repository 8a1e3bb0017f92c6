"""The loop that drives a robot in real time: walker, backend and safety."""
