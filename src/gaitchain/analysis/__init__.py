"""Records of walks: their columns and files, figures, broken rules, causes of falls."""
