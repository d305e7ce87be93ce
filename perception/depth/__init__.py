"""Depth from motion: images and the camera's motion in, inverse depth with its uncertainty out."""

from typing import TYPE_CHECKING

from perception.exports import export

if TYPE_CHECKING:
    from perception.depth.errors import DepthError as DepthError
    from perception.depth.errors import ImageError as ImageError
    from perception.depth.errors import MotionError as MotionError
    from perception.depth.errors import OptionError as OptionError
    from perception.depth.estimator import DepthFromMotion as DepthFromMotion
    from perception.depth.estimator import DepthMap as DepthMap
    from perception.depth.filter.inverse_depth import InverseDepth as InverseDepth
    from perception.depth.geometry.pinhole import Pinhole as Pinhole
    from perception.depth.settings import DEFAULT as DEFAULT
    from perception.depth.settings import PRESETS as PRESETS
    from perception.depth.settings import DepthSettings as DepthSettings
else:
    __getattr__ = export(
        __name__,
        {
            "errors": "DepthError ImageError MotionError OptionError",
            "estimator": "DepthFromMotion DepthMap",
            "filter.inverse_depth": "InverseDepth",
            "geometry.pinhole": "Pinhole",
            "settings": "DEFAULT PRESETS DepthSettings",
        },
    )
