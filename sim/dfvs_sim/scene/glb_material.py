"""What of a glTF material is drawn, and what is ignored."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from dfvs_sim.scene.mesh import NO_TEXTURE

_SPECULAR_GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
_TRANSMISSION = "KHR_materials_transmission"
_WHITE, _BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Material:
    """What of a material is used."""

    factor: tuple[float, ...] = _WHITE
    texture: int = NO_TEXTURE
    uv_set: int = 0
    uv_offset: tuple[float, ...] = (0.0, 0.0)
    uv_rotation_rad: float = 0.0
    uv_scale: tuple[float, ...] = (1.0, 1.0)

    @property
    def uv_name(self) -> str:
        """Attribute with the coordinates of its texture."""
        return f"TEXCOORD_{self.uv_set}"

    def has_coordinates(self, attributes: Iterable[str]) -> bool:
        """Whether it has a texture, and a primitive of these attributes the coordinates of it."""
        return self.texture != NO_TEXTURE and self.uv_name in attributes


def material_of(gltf: dict[str, Any], primitive: dict[str, Any]) -> Material:
    """Base colour of a primitive's material, or its emission where that is black or absent."""
    if "material" not in primitive:
        return Material()
    factor, info = _colour(gltf["materials"][primitive["material"]])
    if info is None:
        return Material(factor)
    transform = info.get("extensions", {}).get("KHR_texture_transform", {})
    return Material(
        factor,
        int(info["index"]),
        int(transform.get("texCoord", info.get("texCoord", 0))),
        tuple(transform.get("offset", (0.0, 0.0))),
        float(transform.get("rotation", 0.0)),
        tuple(transform.get("scale", (1.0, 1.0))),
    )


def _colour(material: dict[str, Any]) -> tuple[tuple[float, ...], dict[str, Any] | None]:
    """Factor and texture that are drawn."""
    pbr = material.get("pbrMetallicRoughness", {})
    factor = tuple(float(x) for x in pbr.get("baseColorFactor", _WHITE))[:3]
    emitted = tuple(float(x) for x in material.get("emissiveFactor", _BLACK))
    is_absent = not {"baseColorFactor", "baseColorTexture"} & set(pbr)
    if any(emitted) and (is_absent or not any(factor)):
        return emitted, material.get("emissiveTexture")
    return factor, pbr.get("baseColorTexture")


def ignored_features(gltf: dict[str, Any]) -> list[str]:
    """What materials of a file rely on and is not drawn."""
    ignored = []
    materials = [(m, m.get("extensions", {})) for m in gltf.get("materials", [])]
    if any(_SPECULAR_GLOSSINESS in x and "pbrMetallicRoughness" not in m for m, x in materials):
        ignored.append(f"{_SPECULAR_GLOSSINESS} (export with base colours)")
    if any(m.get("alphaMode", "OPAQUE") != "OPAQUE" or _TRANSMISSION in x for m, x in materials):
        ignored.append("transparency (glass and cut-outs become walls: take them out)")
    primitives = [p for mesh in gltf.get("meshes", []) for p in mesh["primitives"]]
    drawn = [(material_of(gltf, p), p["attributes"]) for p in primitives]
    if any(m.texture != NO_TEXTURE and not m.has_coordinates(of) for m, of in drawn):
        ignored.append("textures without their TEXCOORD (export with UV coordinates)")
    return ignored
