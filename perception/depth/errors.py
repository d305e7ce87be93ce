"""What can be wrong with the estimator's input."""


class DepthError(Exception):
    """Root of the errors of this room."""


class ImageError(DepthError):
    """An image that cannot be used: unreadable, of another size, colour where grey was expected."""


class MotionError(DepthError):
    """A motion that cannot be used: rows missing, no rotation matrix, a unit that cannot be right."""


class OptionError(DepthError):
    """An option, or the file or folder that it names, cannot be used; the message names value and range."""
