"""The match and the warp of chapter 2 to the letter."""
