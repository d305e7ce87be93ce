"""depth-from-motion: from files to files, and whether to believe the result."""
