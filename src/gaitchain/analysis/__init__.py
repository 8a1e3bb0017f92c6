"""Records of walks: columns, files, metrics, broken rules and causes of falls."""
