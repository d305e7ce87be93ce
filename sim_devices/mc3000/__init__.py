"""The emulated MC3000 three-axis servo board."""
