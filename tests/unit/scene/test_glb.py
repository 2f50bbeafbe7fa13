import json
import struct

import numpy as np
import pytest
from tiny_scenes import GlbFile

from dfvs_core.messages.image import encode_png
from dfvs_sim.scene.frames import gltf_from_ned
from dfvs_sim.scene.glb import GlbError, load_glb
from dfvs_sim.scene.glb_writer import save_glb
from dfvs_sim.scene.mesh import NO_TEXTURE, Scene
from dfvs_sim.scene.texture import Texture, Wrap


def loaded(file, tmp_path):
    return load_glb(file.write(tmp_path / "scene.glb"))


def triangle_file(change=lambda file: None, **fields):
    file = GlbFile()
    file.triangle(**fields)
    change(file)
    return file


def points_of(scene):
    """Corners (M, 3, 3) of the triangles, in the file's axes."""
    return gltf_from_ned(scene.vertices[scene.triangles])


class TestAFileByHand:
    def test_takes_x_to_east_y_to_up_and_minus_z_to_north(self, tmp_path):
        scene = loaded(triangle_file(points=((1, 0, 0), (0, 2, 0), (0, 0, 3))), tmp_path)
        np.testing.assert_allclose(scene.vertices, [(0, 1, 0), (0, 0, -2), (-3, 0, 0)])

    def test_multiplies_colours_of_any_type_with_the_material_factor(self, tmp_path):
        for colours, normalized in (
            (np.full((3, 3), 0.5, np.float32), False),
            (np.full((3, 4), 51, np.uint8), True),
            (np.full((3, 4), 13107, np.uint16), True),
        ):
            file = GlbFile()
            share = 0.5 if colours.dtype == np.float32 else 0.2
            colour = file.accessor(colours, normalized)
            material = file.material(baseColorFactor=[0.5, 1.0, 0.25, 1.0])
            file.triangle(attributes={"COLOR_0": colour}, material=material)
            expected = np.tile(share * np.array([0.5, 1.0, 0.25]), (3, 1))
            np.testing.assert_allclose(loaded(file, tmp_path).colours, expected, rtol=1e-6)

    def test_is_white_without_material_and_colours(self, tmp_path):
        scene = loaded(triangle_file(), tmp_path)
        assert (scene.colours == 1.0).all()
        assert (scene.texture_index == NO_TEXTURE).all()

    def test_places_meshes_by_the_chain_of_their_nodes(self, tmp_path):
        file = triangle_file(points=((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        shift = np.eye(4)
        shift[:3, 3] = (10, 0, 0)
        half = np.sqrt(0.5)
        file.json["nodes"] = [
            {"children": [1], "matrix": shift.T.reshape(-1).tolist()},
            {
                "mesh": 0,
                "rotation": [0, 0, half, half],
                "scale": [2, 2, 2],
                "translation": [0, 5, 0],
            },
        ]
        expected = [(10, 7, 0), (8, 5, 0), (10, 5, 2)]
        np.testing.assert_allclose(points_of(loaded(file, tmp_path))[0], expected, atol=1e-6)

    def test_draws_each_node_once_where_the_file_names_no_scene(self, tmp_path):
        file = triangle_file(points=((1, 0, 0), (0, 1, 0), (0, 0, 1)))
        file.json["nodes"] = [{"mesh": 0}, {"children": [0], "translation": [10, 0, 0]}]
        del file.json["scenes"], file.json["scene"]
        expected = [[(11, 0, 0), (10, 1, 0), (10, 0, 1)]]
        np.testing.assert_allclose(points_of(loaded(file, tmp_path)), expected, atol=1e-6)

    def test_draws_a_mesh_once_for_every_node_that_has_it(self, tmp_path):
        file = triangle_file()
        file.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]
        file.json["scenes"] = [{"nodes": [0, 1]}]
        assert len(loaded(file, tmp_path).triangles) == 2

    def test_joins_primitives_and_keeps_their_textures_apart(self, tmp_path):
        file = GlbFile()
        png = encode_png(np.full((2, 2, 3), 200, np.uint8))
        textured = file.material(baseColorTexture={"index": file.picture(png)})
        uv = file.accessor(np.zeros((3, 2), np.float32))
        file.triangle(attributes={"TEXCOORD_0": uv}, material=textured)
        file.triangle()
        assert loaded(file, tmp_path).texture_index.tolist() == [0, NO_TEXTURE]

    @pytest.mark.parametrize(
        ("mode", "expected"), [(5, [[0, 1, 2], [1, 2, 3]]), (6, [[0, 1, 2], [0, 2, 3]])]
    )
    def test_unfolds_strips_and_fans(self, tmp_path, mode, expected):
        file = triangle_file(points=((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), mode=mode)
        triangles = loaded(file, tmp_path).triangles
        assert [sorted(t) for t in triangles.tolist()] == expected

    def test_leaves_out_lines_and_points(self, tmp_path):
        file = triangle_file(mode=1)
        file.triangle()
        assert len(loaded(file, tmp_path).triangles) == 1

    def test_reads_indices_of_every_width(self, tmp_path):
        for dtype in (np.uint8, np.uint16, np.uint32):
            file = GlbFile()
            file.triangle(indices=file.accessor(np.array([2, 0, 1], dtype)))
            assert loaded(file, tmp_path).triangles.tolist() == [[2, 0, 1]]

    def test_moves_texture_coordinates_as_the_material_says(self, tmp_path):
        file = GlbFile()
        texture = file.picture(encode_png(np.zeros((2, 2, 3), np.uint8)))
        transform = {"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2.0, 4.0]}
        info = {"index": texture, "extensions": {"KHR_texture_transform": transform}}
        uv = file.accessor(np.array([(1, 0), (0, 1), (0, 0)], np.float32))
        file.triangle(attributes={"TEXCOORD_0": uv}, material=file.material(baseColorTexture=info))
        # offset + rotation * scale * uv; the rotation takes (1, 0) to (0, -1)
        expected = [(0.5, 0.25 - 2.0), (0.5 + 4.0, 0.25), (0.5, 0.25)]
        np.testing.assert_allclose(loaded(file, tmp_path).uv, expected, atol=1e-6)

    def test_reads_pictures_and_how_they_wrap(self, tmp_path, rng):
        pixels = rng.integers(0, 256, (4, 8, 3), dtype=np.uint8)
        file = GlbFile()
        file.picture(encode_png(pixels), wrapS=33071, wrapT=33648)
        file.triangle()
        (texture,) = loaded(file, tmp_path).textures
        np.testing.assert_array_equal(texture.image, pixels)
        assert (texture.wrap_u, texture.wrap_v) == (Wrap.CLAMP, Wrap.MIRROR)


LOOP = [{"children": [1]}, {"children": [0]}]
OUTSIDE = {"images": [{"uri": "wood.png"}], "textures": [{"source": 0}]}
BEYOND = np.array([0, 1, 3], np.uint16)
NOT_A_NUMBER = ((0, 0, 0), (1, 0, np.nan), (0, 1, 0))
DRACO = "KHR_draco_mesh_compression"
DAMAGED = struct.pack("<4sIIII", b"glTF", 2, 28, 8, 0x4E4F534A) + b'{"nodes"'


@pytest.mark.parametrize(
    ("file", "match"),
    [
        (None, r"cannot be read .*No such file"),
        (b"v 0 0 0\nv 1 0 0\nf 1 2 3\n", "begins with b'v 0 '"),
        (triangle_file().to_bytes()[:-40], "complete"),
        (DAMAGED, "damaged"),
        (triangle_file(extensions={DRACO: {}}), "Draco"),
        (triangle_file(lambda f: f.json.update(extensionsRequired=[DRACO])), f"requires {DRACO}"),
        (GlbFile(), "no triangles"),
        (triangle_file(lambda f: f.triangle(indices=f.accessor(BEYOND))), "indices are 0 to 3"),
        (triangle_file(lambda f: f.json["accessors"][0].update(count=30)), "runs past"),
        (
            triangle_file(lambda f: f.json["bufferViews"][0].update(byteLength=10**9)),
            "buffer view 0",
        ),
        (triangle_file(points=NOT_A_NUMBER), "not finite"),
        (triangle_file(lambda f: f.json.update(OUTSIDE)), "outside the file"),
        (triangle_file(lambda f: f.picture(b"not a picture at all, really")), "PNG or JPEG"),
        (triangle_file(lambda f: f.json.update(nodes=LOOP)), "loop"),
    ],
)
def test_a_file_that_cannot_be_read_is_named_with_the_reason(tmp_path, file, match):
    path = tmp_path / "bad.glb"
    if file is not None:
        path.write_bytes(file if isinstance(file, bytes) else file.to_bytes())
    with pytest.raises(GlbError, match=match) as caught:
        load_glb(path)
    assert str(path) in str(caught.value)


class TestOurOwnFiles:
    @pytest.fixture
    def scene(self, rng):
        image = np.full((16, 16, 3), 90, np.uint8)
        return Scene(
            vertices=rng.uniform(-3, 4, (300, 3)).astype(np.float32),
            triangles=rng.permutation(300).reshape(-1, 3).astype(np.int32),
            uv=rng.uniform(-2, 5, (300, 2)).astype(np.float32),
            colours=rng.uniform(0, 1, (300, 3)).astype(np.float32),
            texture_index=np.repeat([NO_TEXTURE, 0], 50).astype(np.int32),
            textures=(Texture(image, Wrap.CLAMP, Wrap.REPEAT),),
        )

    def test_come_back_to_within_the_quantisation(self, scene, tmp_path):
        save_glb(tmp_path / "room.glb", scene)
        back = load_glb(tmp_path / "room.glb")
        half_step = 0.5 * 7.0 / 65535
        for name, tolerance in (
            ("vertices", half_step),
            ("colours", 0.5 / 65535),
            ("uv", half_step),
        ):
            expected = getattr(scene, name)[scene.triangles]
            if name == "uv":
                expected[:50] = 0.0  # of no use without a texture, so not stored
            got = getattr(back, name)[back.triangles]
            # single precision of the numbers themselves adds 1e-6
            np.testing.assert_allclose(got, expected, atol=tolerance + 1e-6)
        np.testing.assert_array_equal(back.texture_index, scene.texture_index)
        assert back.textures[0].wrap_u == Wrap.CLAMP
        assert np.abs(back.textures[0].image.astype(int) - 90).max() <= 2  # JPEG of a flat colour

    def test_say_which_extensions_a_reader_needs(self, scene, tmp_path):
        save_glb(tmp_path / "room.glb", scene)
        data = (tmp_path / "room.glb").read_bytes()
        document = json.loads(data[20 : 20 + struct.unpack_from("<I", data, 12)[0]])
        assert document["extensionsRequired"] == ["KHR_mesh_quantization"]
        assert all(view["byteOffset"] % 4 == 0 for view in document["bufferViews"])


BLACK = {"baseColorFactor": [0, 0, 0, 1]}


@pytest.mark.parametrize("base", [{"pbrMetallicRoughness": BLACK}, {}], ids=["black", "absent"])
def test_light_that_is_baked_as_emission_is_drawn(tmp_path, base, capsys):
    file = GlbFile()
    texture = file.picture(encode_png(np.full((2, 2, 3), 200, np.uint8)))
    emission = {"emissiveTexture": {"index": texture}, "emissiveFactor": [1, 0.5, 1]}
    file.json["materials"].append(base | emission)
    uv = file.accessor(np.ones((3, 2), np.float32))
    file.triangle(attributes={"TEXCOORD_0": uv}, material=0)
    scene = loaded(file, tmp_path)
    assert scene.texture_index.tolist() == [0]
    np.testing.assert_allclose(scene.colours[0], [1, 0.5, 1])
    np.testing.assert_allclose(scene.uv, 1.0)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("emission", [{}, {"emissiveFactor": [0.2, 0.2, 0.2]}])
def test_a_base_colour_is_drawn_without_its_emission(tmp_path, emission):
    file = GlbFile()
    material = file.material(baseColorFactor=[0.5, 0.25, 0, 1])
    file.json["materials"][material] |= emission
    file.triangle(material=material)
    np.testing.assert_allclose(loaded(file, tmp_path).colours[0], [0.5, 0.25, 0])


def test_materials_that_cannot_be_drawn_are_named_in_one_warning(tmp_path, capsys):
    file = GlbFile()
    texture = file.picture(encode_png(np.zeros((2, 2, 3), np.uint8)))
    textured = file.material(baseColorTexture={"index": texture})
    extension = {"KHR_materials_pbrSpecularGlossiness": {"diffuseTexture": {"index": texture}}}
    file.json["materials"].append({"extensions": extension})
    for material in (textured, textured, 1):
        file.triangle(material=material)
    loaded(file, tmp_path)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("warning: ")
    assert "TEXCOORD" in line
    assert "KHR_materials_pbrSpecularGlossiness" in line


def test_a_texture_of_too_many_bytes_comes_with_the_remedy(tmp_path):
    file = GlbFile()
    file.picture(bytes(2**25 + 1))
    file.triangle()
    with pytest.raises(GlbError, match="expected at most 33554432; save it as JPEG"):
        loaded(file, tmp_path)


@pytest.mark.parametrize(
    "node", [{"translation": [5e5, 0, 4e6]}, {"scale": [3e3, 3e3, 3e3]}], ids=["UTM", "mm"]
)
def test_a_scene_that_reaches_far_from_its_origin_is_warned_about(tmp_path, capsys, node):
    file = triangle_file()
    file.json["nodes"][0] |= node
    loaded(file, tmp_path)
    assert "move it to the origin, in metres" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("material", "is_named"),
    [
        ({"alphaMode": "OPAQUE"}, False),
        ({"alphaMode": "BLEND"}, True),
        ({"alphaMode": "MASK"}, True),
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}, True),
    ],
)
def test_transparency_that_is_drawn_opaque_is_named(tmp_path, capsys, material, is_named):
    file = triangle_file(material=0)
    file.json["materials"].append(material)
    loaded(file, tmp_path)
    warned = capsys.readouterr().err
    assert ("transparency" in warned) == bool(warned) == is_named
