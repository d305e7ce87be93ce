"""depth-from-motion: from files to files, with a check whether images and motion belong together."""
