"""Depth from motion: images and the camera's motion in, inverse depth with its uncertainty out."""
