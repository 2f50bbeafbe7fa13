"""Opening of image sources by their specification."""

from dfvs_service.camera.sources.source import Source, SourceOptions
from dfvs_service.camera.sources.spec import SourceKind, SourceSpec


def open_source(spec: SourceSpec, options: SourceOptions) -> Source:
    """Open a source.

    Raises
    ------
    SourceLostError
        If a live source cannot be reached right now.
    CameraError
        If it can never be opened like this.
    """
    if spec.kind is SourceKind.PICAMERA:
        from dfvs_service.camera.sources.picamera import PicameraSource

        return PicameraSource(int(spec.place), options)
    if spec.kind is SourceKind.IMAGES:
        from dfvs_service.camera.sources.images import ImageSource

        return ImageSource(spec.place)
    from dfvs_service.camera.sources.capture import CaptureSource

    return CaptureSource(spec, options)
