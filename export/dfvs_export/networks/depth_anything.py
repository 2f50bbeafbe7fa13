"""Depth Anything V2 small, by the package ``transformers``.

L. Yang et al., "Depth Anything V2", NeurIPS 2024: relative, or metric where it was tuned for that.
"""

import importlib
import json
from pathlib import Path
from typing import Any

from torch import Tensor, nn

from dfvs_core.errors import ConfigError, ModelError

WEIGHTS_NAME, CONFIG_NAME = "model.safetensors", "config.json"
_SMALL: dict[str, Any] = {
    "backbone_config": {
        "model_type": "dinov2",
        "hidden_size": 384,
        "num_attention_heads": 6,
        "num_hidden_layers": 12,
        "image_size": 518,
        "patch_size": 14,
        "out_features": ["stage3", "stage6", "stage9", "stage12"],
        "apply_layernorm": True,
        "reshape_hidden_states": False,
    },
    "reassemble_hidden_size": 384,
    "neck_hidden_sizes": [48, 96, 192, 384],
    "fusion_hidden_size": 64,
    "head_hidden_size": 32,
}
"""Of the relative network, as published."""


class DepthAnything(nn.Module):
    """Image (1, 3, H, W), normalised as ImageNet's, to depth or inverse depth (1, H, W).

    H and W are multiples of 14. ``folder`` is one that ``transformers`` saved; without one the
    weights are random.

    Raises
    ------
    ConfigError, ModelError
        If ``transformers`` is not installed, or the folder holds another network, or other weights.
    """

    def __init__(self, folder: Path | None = None) -> None:
        super().__init__()
        transformers = _transformers()
        if folder is None:
            config = transformers.DepthAnythingConfig(**_SMALL)
            config._attn_implementation = config.backbone_config._attn_implementation = "eager"
            self.network = transformers.DepthAnythingForDepthEstimation(config)
        else:
            self.network = _loaded(transformers, folder)
        self.is_metric = self.network.config.depth_estimation_type == "metric"

    def forward(self, image: Tensor) -> Tensor:
        """Depth, m, of a metric network; else inverse depth up to a factor and an offset."""
        depth: Tensor = self.network(image).predicted_depth
        return depth


def _loaded(transformers: Any, folder: Path) -> nn.Module:
    """Network of a folder, its weights from safetensors and all of them used."""
    try:
        settings = json.loads((folder / CONFIG_NAME).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(f"{folder / CONFIG_NAME} cannot be read ({error})") from error
    kind = settings.get("model_type") if isinstance(settings, dict) else None
    if kind != "depth_anything":
        raise ModelError(f"{folder} holds a network of the type {kind!r}", "'depth_anything'")
    try:
        network, found = transformers.DepthAnythingForDepthEstimation.from_pretrained(
            folder,
            local_files_only=True,
            use_safetensors=True,
            output_loading_info=True,
            attn_implementation="eager",
        )
    except Exception as error:  # transformers and safetensors raise a dozen kinds
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ModelError(f"{folder} cannot be loaded: {reason}") from error
    if wrong := sorted(map(str, (*found["missing_keys"], *found["mismatched_keys"]))):
        raise ModelError(f"{folder / WEIGHTS_NAME} lacks {wrong[0]}", "weights for the network")
    loaded: nn.Module = network
    return loaded


def _transformers() -> Any:
    try:
        return importlib.import_module("transformers")
    except ImportError as error:
        raise ConfigError(
            f"the package transformers cannot be imported ({error})",
            "it, for depth-anything-v2-small",
            "pip install 'dfvs-lab[published-depth]'",
        ) from error
