"""Materials of glTF: factors times textures, opacity as holes or panes, and the transform of texture coordinates."""

import numpy as np
import pytest
from PIL import Image

from tests.asset.glb import Glb
from vobench.asset import gltf_material
from vobench.asset.gltf_file import read_gltf_file
from vobench.asset.gltf_material import MaterialReader
from vobench.errors import ModelError

DIFFUSE = {"pbrMetallicRoughness": {"roughnessFactor": 1.0, "metallicFactor": 0.0}}


def reader(glb):
    return MaterialReader(read_gltf_file(glb.bytes(), None))


def look(material, glb=None):
    glb = glb or Glb()
    glb.tree["materials"] = [material]
    return reader(glb).look(0)


def surface(**values):
    return {"pbrMetallicRoughness": values}


def textured(pixels, *, colour=(1, 1, 1, 1), **more):
    """The look of a material with a picture, and more fields of the material."""
    glb = Glb()
    texture = glb.texture(pixels)
    return look({**surface(baseColorTexture=texture, baseColorFactor=list(colour), metallicFactor=0), **more}, glb)


def test_a_material_without_fields_is_that_of_the_standard_a_rough_white_metal_read_as_diffuse():
    default = look({})
    assert default.material.colour == (1, 1, 1)
    assert default.material.metal == 0
    assert default.material.eta == 1
    assert (default.name, default.two_sided, default.uv_set) == ("material_0", False, 0)
    np.testing.assert_array_equal(default.T_uv, np.eye(2, 3))


def test_no_material_is_the_default_and_each_is_read_once():
    glb = Glb(materials=[{"name": "a"}, {"name": "b"}])
    materials = reader(glb)
    assert materials.look(None).name == "default"
    assert materials.look(1) is materials.look(1)
    assert materials.look(0) is not materials.look(1)
    with pytest.raises(ModelError, match="number 2 of 2 materials is requested"):
        materials.look(2)


def test_colours_are_factors_cut_to_what_a_surface_can_reflect():
    assert look(surface(baseColorFactor=[0.2, 1.5, -1, 1])).material.colour == (0.2, 1.0, 0.0)
    with pytest.raises(ModelError, match=r"^material 'm': expected 4 finite numbers"):
        look({"name": "m", **surface(baseColorFactor=[1, 1, 1])})


@pytest.mark.parametrize(("roughness", "is_glossy"), [(0.0, True), (0.5, True), (0.63, True), (0.64, False)])
def test_alpha_is_the_square_of_the_roughness_and_rough_surfaces_are_diffuse(roughness, is_glossy):
    material = look(surface(roughnessFactor=roughness, metallicFactor=0.25)).material
    if is_glossy:
        assert material.roughness == pytest.approx(roughness**2)
        assert (material.metal, material.eta) == (0.25, 1.5)
    else:
        assert (material.metal, material.eta) == (0, 1)


def test_a_coat_has_the_index_of_refraction_of_the_file_and_none_below_one():
    for ior, eta in ((1.33, 1.33), (2.4, 2.4), (0.0, 1.0)):
        source = {**surface(roughnessFactor=0.1), "extensions": {"KHR_materials_ior": {"ior": ior}}}
        assert look(source).material.eta == eta
    unlit = {**surface(roughnessFactor=0.1), "extensions": {"KHR_materials_unlit": {}}}
    assert look(unlit).material.eta == 1


def test_roughness_and_metal_are_factors_times_the_means_of_green_and_blue():
    glb = Glb()
    pixels = np.zeros((2, 2, 3))
    pixels[..., 0] = 255  # red means nothing
    pixels[..., 1] = [[51, 153], [102, 102]]  # 0.4 on average
    pixels[0, :, 2] = 255  # 0.5 on average
    texture = glb.texture(pixels)
    source = surface(metallicRoughnessTexture=texture, roughnessFactor=0.5, metallicFactor=0.8)
    material = look(source, glb)
    assert material.material.roughness == pytest.approx((0.5 * 0.4) ** 2)
    assert material.material.metal == pytest.approx(0.8 * 0.5)
    assert material.notes == ("material 'material_0' is 40% metal and 20% rough, the means of its texture",)


# Emission


@pytest.mark.parametrize("strength", [1.0, 50.0])
def test_emission_is_the_factor_times_the_strength(strength):
    extensions = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    source = {"emissiveFactor": [0.5, 1, 0], "extensions": extensions}
    assert look(source).material.emission_cd_m2 == (0.5 * strength, strength, 0)


@pytest.mark.parametrize(("factor", "is_noted"), [(0.0, False), (0.1, True), (1.0, True), (1.01, False)])
def test_a_weak_emission_is_noted_since_its_strength_is_probably_missing(factor, is_noted):
    notes = look({"emissiveFactor": [factor] * 3, **DIFFUSE}).notes
    assert any("set its emissiveStrength" in note for note in notes) == is_noted


def test_a_picture_of_emission_is_read_only_where_light_is_emitted():
    glb = Glb()
    texture = glb.texture(np.full((2, 2, 3), 99))
    dark = look({"emissiveTexture": texture}, glb)
    assert dark.material.emission_texture is None
    glb.tree["materials"] = []
    bright = look({"emissiveTexture": texture, "emissiveFactor": [1, 1, 1]}, glb)
    np.testing.assert_array_equal(bright.material.emission_texture.pixels(), np.full((2, 2, 3), 99))


def test_an_emission_that_is_mapped_unlike_the_colour_is_noted():
    glb = Glb()
    texture = glb.texture(np.zeros((1, 1, 3)))
    for other, is_noted in (({"index": 0}, False), ({"index": 0, "texCoord": 1}, True)):
        source = {**surface(baseColorTexture=texture), "emissiveTexture": other, "emissiveFactor": [9, 9, 9]}
        notes = look(source, glb).notes
        assert ("material 'material_0' has its emission mapped as its colour is" in notes) == is_noted


# Opacity


def opacities(*values):
    pixels = np.full((1, len(values), 4), 200)
    pixels[..., 3] = np.array(values)
    return pixels


def test_an_opaque_material_has_neither_holes_nor_opacity():
    material = textured(opacities(0, 255)).material
    assert material.cutout is None
    assert material.texture.pixels().shape == (1, 2, 3)


@pytest.mark.parametrize(("cutoff", "factor"), [(0.5, 1.0), (0.25, 0.5), (0.6, 0.8)])
def test_a_mask_is_cut_where_factor_times_picture_is_below_the_cutoff(cutoff, factor):
    pixels = opacities(*range(256))
    masked = textured(pixels, colour=(1, 1, 1, factor), alphaMode="MASK", alphaCutoff=cutoff).material
    is_hole = masked.texture.pixels()[..., 3] / 255 < masked.cutout
    np.testing.assert_array_equal(is_hole, pixels[..., 3] / 255 * factor < cutoff)


def test_a_mask_that_lets_everything_or_nothing_through_has_no_holes():
    assert textured(opacities(200, 255), alphaMode="MASK").material.cutout is None
    nothing = textured(opacities(10, 100), alphaMode="MASK")
    assert nothing.material.kind == "pane"
    assert nothing.notes == ("material 'material_0' is wholly clear: an open pane",)


@pytest.mark.parametrize(
    ("alphas", "kind", "has_holes", "note"),
    [
        ((255, 255), "body", False, ""),
        ((0, 0, 0, 0, 255), "body", True, "cut out where it is less than half opaque"),
        ((0, 3), "pane", False, "an open pane"),
        ((60, 80), "pane", False, "is 27% opaque: a pane"),
        ((200, 240), "body", False, "is blended: read as solid"),
    ],
)
def test_a_blended_material_is_solid_or_cut_or_a_pane(alphas, kind, has_holes, note):
    blended = textured(opacities(*alphas), alphaMode="BLEND")
    assert blended.material.kind == kind
    assert (blended.material.cutout is not None) == has_holes
    assert note in " ".join(blended.notes)
    assert bool(blended.notes) == bool(note)


@pytest.mark.parametrize("opacity", [0.1, 0.4])
def test_a_pane_lets_through_what_its_opacity_leaves(opacity):
    pane = look({**surface(baseColorFactor=[1, 1, 1, opacity]), "alphaMode": "BLEND"}).material
    assert pane.kind == "pane"
    assert pane.tint == pytest.approx(1 - opacity)
    assert pane.eta == 1.5


def test_transmission_makes_a_pane_in_the_luminance_of_its_colour():
    def transmitting(factor, colour=(0.5, 0.5, 0.5, 1)):
        extensions = {"KHR_materials_transmission": {"transmissionFactor": factor}}
        return look({**surface(baseColorFactor=list(colour)), "extensions": extensions}).material

    assert transmitting(0.4).kind == "body"
    assert transmitting(0.9).kind == "pane"
    assert transmitting(0.9).tint == pytest.approx(0.5)
    assert transmitting(0.9, (0, 1, 0, 1)).tint > transmitting(0.9, (1, 0, 0, 1)).tint > 0


# Texture coordinates


def T_uv(**transform):
    glb = Glb()
    texture = {**glb.texture(np.zeros((1, 1, 3))), "extensions": {"KHR_texture_transform": transform}}
    return look(surface(baseColorTexture=texture), glb).T_uv


@pytest.mark.parametrize("rotation", [0.0, np.pi / 2, 0.3])
def test_coordinates_are_scaled_then_rotated_then_moved_as_the_extension_says(rotation):
    transform = T_uv(offset=[0.1, 0.2], rotation=rotation, scale=[2, 3])
    sine, cosine = np.sin(rotation), np.cos(rotation)
    # The matrices of KHR_texture_transform.
    translation = np.array([[1, 0, 0.1], [0, 1, 0.2], [0, 0, 1]])
    rotated = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    scaled = np.diag([2, 3, 1])
    np.testing.assert_allclose(transform, (translation @ rotated @ scaled)[:2], atol=1e-12)


def test_the_set_of_coordinates_is_that_of_the_transform_or_else_of_the_texture():
    glb = Glb()
    texture = {**glb.texture(np.zeros((1, 1, 3))), "texCoord": 1}
    assert look(surface(baseColorTexture=texture), glb).uv_set == 1
    texture["extensions"] = {"KHR_texture_transform": {"texCoord": 2}}
    assert look(surface(baseColorTexture=texture), glb).uv_set == 2


# Pictures


@pytest.mark.parametrize("form", ["PNG", "WEBP"])
def test_a_picture_has_the_pixels_of_its_file_row_by_row(form):
    pixels = np.random.default_rng(0).integers(0, 256, (5, 7, 3))
    glb = Glb()
    if form == "PNG":
        texture = glb.texture(pixels)
        material = look(surface(baseColorTexture=texture), glb).material
        np.testing.assert_array_equal(material.texture.pixels(), pixels)
    else:
        flat = np.full((5, 7, 3), [200, 100, 50])
        texture = glb.texture(flat, "WEBP")
        glb.tree["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
        material = look(surface(baseColorTexture=texture), glb).material
        np.testing.assert_allclose(material.texture.pixels(), flat, atol=6)


def test_sixteen_bits_are_read_as_their_upper_eight():
    grey = (np.array([[0, 255, 100, 128]]) * 257).astype(np.uint16)
    glb = Glb()
    file = gltf_material.BytesIO()
    Image.fromarray(grey).save(file, "PNG")
    glb.tree["images"].append({"bufferView": glb.view(file.getvalue())})
    glb.tree["textures"] = [{"source": 0}]
    pixels = look(surface(baseColorTexture={"index": 0}), glb).material.texture.pixels()
    np.testing.assert_array_equal(pixels[..., 0], [[0, 255, 100, 128]])


@pytest.mark.parametrize(("side", "reduced_side"), [(8, 8), (9, 5), (16, 8), (20, 7)])
def test_a_large_picture_is_reduced_by_a_whole_number_and_remembered(monkeypatch, side, reduced_side):
    monkeypatch.setattr(gltf_material, "MOST_SIDE", 8)
    glb = Glb()
    texture = glb.texture(np.full((side, side, 3), 77))
    glb.tree["materials"] = [surface(baseColorTexture=texture)]
    materials = reader(glb)
    pixels = materials.look(0).material.texture.pixels()
    assert pixels.shape == (reduced_side, reduced_side, 3)
    assert set(pixels.ravel()) == {77}
    assert materials.reduced == ({0} if side > 8 else set())


def test_many_pictures_share_the_memory_that_one_has_alone(monkeypatch):
    monkeypatch.setattr(gltf_material, "MOST_TEXELS", 64)
    sides = []
    for count in (1, 4, 16):
        glb = Glb()
        for _ in range(count):
            texture = glb.texture(np.zeros((8, 8, 3)))
        sides.append(look(surface(baseColorTexture=texture), glb).material.texture.pixels().shape[0])
    assert sides == [8, 4, 2]


def test_one_picture_is_one_value_for_all_materials_that_show_it():
    glb = Glb()
    texture = glb.texture(np.zeros((2, 2, 3)))
    glb.tree["materials"] = [surface(baseColorTexture=texture) for _ in range(2)]
    materials = reader(glb)
    assert materials.look(0).material.texture is materials.look(1).material.texture


@pytest.mark.parametrize("most_pixels", [11, 12])
def test_a_picture_that_is_too_large_or_damaged_is_refused_by_its_name(monkeypatch, most_pixels):
    monkeypatch.setattr(gltf_material, "MOST_PIXELS", most_pixels)
    glb = Glb()
    texture = glb.texture(np.zeros((3, 4, 3)))
    source = surface(baseColorTexture=texture)
    if most_pixels == 12:
        assert look(source, glb).material.texture.pixels().shape == (3, 4, 3)
        glb.tree["bufferViews"][0]["byteLength"] = 20
        expected = r"image 'grain': cannot be read \(.*\); save it as PNG of 12 pixels at most"
    else:
        expected = r"image 'grain': cannot be read \(4 x 3 pixels\); save it as PNG of 11 pixels at most"
    with pytest.raises(ModelError, match=expected):
        look(source, glb)


def test_pictures_in_another_compression_are_refused_with_the_tool_that_converts_them():
    glb = Glb(textures=[{"extensions": {"KHR_texture_basisu": {"source": 0}}}])
    with pytest.raises(ModelError, match="has KTX2 images; make them PNG"):
        look(surface(baseColorTexture={"index": 0}), glb)
