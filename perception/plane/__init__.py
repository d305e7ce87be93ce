"""A plane seen by a moving camera: its motion between two images, contact with it, and what stands out of it."""
