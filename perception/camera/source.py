"""What a camera may be opened from: a device, a video file, a folder of images, an address."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit

from perception.camera.errors import CameraNotFound

Kind = Literal["device", "video", "folder", "address"]
IMAGE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff"})


@dataclass(frozen=True)
class Source:
    """Where the images come from; a device's `place` is its path in /dev with links resolved."""

    kind: Kind
    place: str


def find_source(text: str) -> Source:
    """What a text names.

    A number n is /dev/videoN; a bare name is looked for in /dev/v4l/by-id, so that a camera keeps its side
    when the cables are swapped; a folder is its images in the order of their names; tcp, udp, http(s) and
    rtsp addresses go to OpenCV.

    Raises:
        CameraNotFound: there is no such thing.
    """
    if not text:
        raise CameraNotFound("no camera given: a device, file, folder or address is needed")
    if urlsplit(text).scheme in {"tcp", "udp", "http", "https", "rtsp"}:
        return Source("address", text)
    path = Path(f"/dev/video{text}") if text.isdecimal() else Path(text)
    if not path.exists() and "/" not in text and not text.isdecimal():
        path = Path("/dev/v4l/by-id") / text
    if path.is_char_device():
        return Source("device", str(path.resolve()))
    if path.is_dir():
        return Source("folder", str(path))
    if path.is_file():
        return Source("video", str(path))
    raise CameraNotFound(f"no camera {text!r}: {path} does not exist")


def images_in(folder: str) -> list[Path]:
    """The images of a folder in the order of their names.

    Raises:
        CameraNotFound: there is none.
    """
    found = sorted(path for path in Path(folder).iterdir() if path.suffix.lower() in IMAGE_SUFFIXES)
    if not found:
        raise CameraNotFound(f"no images in {folder} (looked for {', '.join(sorted(IMAGE_SUFFIXES))})")
    return found
