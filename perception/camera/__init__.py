"""Cameras: frames stamped with their exposure, from devices, addresses, files and folders; lenses; calibration."""

from typing import TYPE_CHECKING

from perception.exports import export

if TYPE_CHECKING:
    from perception.camera.calibration import BoardView as BoardView
    from perception.camera.calibration import CalibrationBoard as CalibrationBoard
    from perception.camera.calibration import IntrinsicsCalibration as IntrinsicsCalibration
    from perception.camera.calibration import estimate_intrinsics as estimate_intrinsics
    from perception.camera.capture_messages import CaptureSettings as CaptureSettings
    from perception.camera.device import DeviceCamera as DeviceCamera
    from perception.camera.device import open_camera as open_camera
    from perception.camera.errors import CameraCalibrationError as CameraCalibrationError
    from perception.camera.errors import CameraError as CameraError
    from perception.camera.errors import CameraLost as CameraLost
    from perception.camera.errors import CameraNotFound as CameraNotFound
    from perception.camera.errors import CameraStalled as CameraStalled
    from perception.camera.errors import FrameSizeChanged as FrameSizeChanged
    from perception.camera.errors import IntrinsicsError as IntrinsicsError
    from perception.camera.errors import SettingRefused as SettingRefused
    from perception.camera.frame import Camera as Camera
    from perception.camera.frame import CameraStatistics as CameraStatistics
    from perception.camera.frame import Frame as Frame
    from perception.camera.frame import Image as Image
    from perception.camera.intrinsics import Intrinsics as Intrinsics
    from perception.camera.intrinsics import format_intrinsics as format_intrinsics
    from perception.camera.intrinsics import load_intrinsics as load_intrinsics
    from perception.camera.motion import Motion as Motion
    from perception.camera.pairing import FramePair as FramePair
    from perception.camera.pairing import paired as paired
    from perception.camera.slot import SlotCamera as SlotCamera
    from perception.camera.source import Source as Source
else:
    __getattr__ = export(
        __name__,
        {
            "calibration": "CalibrationBoard BoardView IntrinsicsCalibration estimate_intrinsics",
            "capture_messages": "CaptureSettings",
            "device": "DeviceCamera open_camera",
            "errors": "CameraCalibrationError CameraError CameraLost CameraNotFound CameraStalled FrameSizeChanged"
            " IntrinsicsError SettingRefused",
            "frame": "Camera CameraStatistics Frame Image",
            "intrinsics": "Intrinsics format_intrinsics load_intrinsics",
            "motion": "Motion",
            "pairing": "FramePair paired",
            "slot": "SlotCamera",
            "source": "Source",
        },
    )
