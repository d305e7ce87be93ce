"""Work on whole images: in bands of rows, between the pixels, through planes, level by level, in order."""
