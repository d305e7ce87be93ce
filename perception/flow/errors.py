"""What can be wrong with what the flow is measured from."""


class FlowError(Exception):
    """Root of the errors of this room."""


class ImageError(FlowError):
    """An image that cannot be used: colour, not 8 bits, too small for its window, or of another size than the first."""


class SettingError(FlowError):
    """A window, mounting or setting outside its range."""


class MotionError(FlowError):
    """A motion of the camera that is not finite."""
