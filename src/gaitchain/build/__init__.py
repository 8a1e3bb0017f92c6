"""Config to qualified library, and the experiments that a library goes through."""
