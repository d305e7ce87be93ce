"""What can be wrong with what the estimators of a plane are given."""


class PlaneError(ValueError):
    """An image, window, motion or plane that cannot be used; the message names value and allowed range."""
