"""Files that a program and its user share: written whole or not at all, read with one line of error."""
