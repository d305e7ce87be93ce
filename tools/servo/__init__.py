"""Runs of the servo loops on the emulated head, beside what the design predicts for them."""
