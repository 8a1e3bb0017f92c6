"""Libraries as C99: what is compiled online, translated; the rest of a walker in C."""
