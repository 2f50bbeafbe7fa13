"""Input and output tensors of networks, as a bundle's manifest describes them."""

from dataclasses import dataclass
from typing import Literal

from dfvs_core.depth.network import DepthUnit
from dfvs_core.errors import ModelError
from dfvs_core.messages.schema import setting


@dataclass(frozen=True, slots=True)
class ImageInput:
    """How an image becomes a tensor: resized, ``(pixel * scale - mean) / std``, channels first.

    ``layout`` says how two images enter a ``pair`` or ``pose`` graph: as two inputs of (1, C, H,
    W), as one input of (1, 2C, H, W), or as one of (1, 2, C, H, W). One image is (1, C, H, W).
    """

    width: int = setting(320, "width of the network's images, px", low=16, high=4096)
    height: int = setting(240, "height of the network's images, px", low=16, high=4096)
    multiple_of: int = setting(1, "what width and height must be multiples of", low=1, high=256)
    layout: Literal["separate", "channels", "stack"] = "separate"
    channels: Literal["rgb", "bgr", "grey"] = "rgb"
    scale: float = setting(1.0 / 255.0, "factor on 0..255", low=1e-6, high=1e3)
    mean: tuple[float, ...] = (0.0,)
    std: tuple[float, ...] = (1.0,)

    def __post_init__(self) -> None:
        """Refuse sizes and normalisations that contradict themselves."""
        if self.width % self.multiple_of or self.height % self.multiple_of:
            raise ModelError(
                f"input size {self.width} x {self.height}", f"multiples of {self.multiple_of}"
            )
        for name, values in (("mean", self.mean), ("std", self.std)):
            if len(values) not in (1, self.channel_count):
                raise ModelError(f"{name} has {len(values)} values", f"1 or {self.channel_count}")
        if min(self.std) <= 0.0:
            raise ModelError(f"std is {self.std}", "positive numbers")

    @property
    def channel_count(self) -> int:
        """Channels of one image."""
        return 1 if self.channels == "grey" else 3

    def pair_shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of the inputs of a ``pair`` or ``pose`` graph."""
        c, h, w = self.channel_count, self.height, self.width
        if self.layout == "separate":
            return (1, c, h, w), (1, c, h, w)
        if self.layout == "channels":
            return ((1, 2 * c, h, w),)
        return ((1, 2, c, h, w),)


@dataclass(frozen=True, slots=True)
class FlowOutput:
    """What the flow tensor (1, 2, height / stride, width / stride) means.

    Times ``scale`` it is in px of the network's images; ``order`` is that of its channels.
    """

    stride: int = setting(1, "network's px per vector", low=1, high=64)
    scale: float = 1.0
    order: Literal["uv", "vu"] = "uv"

    def __post_init__(self) -> None:
        """Refuse a scale that makes every flow zero."""
        if self.scale == 0.0:
            raise ModelError("flow scale is 0", "a number other than 0")


@dataclass(frozen=True, slots=True)
class DepthOutput:
    """What the depth tensor (1, height / stride, width / stride) means.

    Depth is along the optical axis. ``unit`` is ``"m"`` of depth, ``"1/m"`` of inverse depth;
    ``"relative"`` of either that is known up to a factor, ``"affine"`` of inverse depth that is
    known up to a factor and an offset. ``spread`` is the standard deviation of the logarithm of
    depth where the graph does not give it as its second output; ``scale_spread`` that of the whole
    image's scale, of a metric network.
    """

    quantity: Literal["depth", "inverse-depth"]
    unit: DepthUnit
    stride: int = setting(1, "network's px per value", low=1, high=64)
    spread: float | None = setting(
        None, "standard deviation of the logarithm of depth", low=0.001, high=10.0
    )
    scale_spread: float | None = setting(
        None, "standard deviation of the logarithm of the scale", low=0.001, high=10.0
    )

    def __post_init__(self) -> None:
        """Refuse a unit that does not go with the quantity, or with what is said of the scale."""
        units = {"depth": ("m", "relative"), "inverse-depth": ("1/m", "relative", "affine")}
        if self.unit not in units[self.quantity]:
            raise ModelError(
                f"{self.quantity} in the unit {self.unit!r}",
                f"one of {', '.join(map(repr, units[self.quantity]))}",
            )
        if self.is_metric != (self.scale_spread is not None):
            raise ModelError(
                f"depth in the unit {self.unit!r} {'without' if self.is_metric else 'with'}"
                " 'scale_spread'",
                "it for metric networks, and only for those",
            )

    @property
    def is_metric(self) -> bool:
        """Whether it has a length."""
        return self.unit in ("m", "1/m")


@dataclass(frozen=True, slots=True)
class PoseOutput:
    """What the outputs of a ``pose`` graph mean: pose of the second camera in the first.

    The first output is the translation (1, 3), in m or, with the unit ``"depth"``, in median
    depths of the second image. The second one is the rotation: a quaternion (1, 4) as (w, x, y,
    z) of any length, or a rotation vector (1, 3) rad. The graph's last input is the images' focal
    length over their width (1, 1).
    """

    unit: Literal["m", "depth"]
    rotation: Literal["quaternion", "vector"]

    @property
    def shapes(self) -> tuple[tuple[int, ...], ...]:
        """Shapes of the two outputs."""
        return (1, 3), (1, 4 if self.rotation == "quaternion" else 3)
