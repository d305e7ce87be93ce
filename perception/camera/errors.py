"""The errors of cameras, lenses and calibration."""


class CameraError(Exception):
    """Root of everything a camera raises."""


class CameraNotFound(CameraError):
    """There is no such device, file or address, or it cannot be opened."""


class CameraLost(CameraError):
    """The camera was open and gives no more images: unplugged, closed by its server, at its end."""


class CameraStalled(CameraError):
    """The camera is open but has sent no frame for longer than it may."""


class FrameSizeChanged(CameraError):
    """A frame came in another size than the first; measurements in pixels would be wrong."""


class SettingRefused(CameraError):
    """The camera did not take a size, format, rate, exposure or gain that was asked for."""


class IntrinsicsError(CameraError):
    """An intrinsics file is missing, malformed or belongs to another image size."""


class CameraCalibrationError(CameraError):
    """The views do not determine the parameters, or the residual is above its limit."""
