"""The emulated PWM servo amplifiers and their multidrop line."""
