"""Depth from motion: pictures and the camera's motion in, inverse depth with its uncertainty out."""
