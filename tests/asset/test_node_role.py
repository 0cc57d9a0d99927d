"""A node has the role that is nearest to it, and its material looks like that role."""

import pytest

from tests.asset.glb import Reader, triangle


def test_roles_come_from_extras_and_globs_and_hold_for_what_is_below(read: Reader) -> None:
    glb = triangle(nodes=[{"name": "glass"}, {"name": "panel", "extras": {"vobench": "mirror"}}, {"name": "junk"}])
    glb.tree["nodes"].append({"name": "Window", "children": [0], "extras": {"other": 1}})
    model = read(glb, roles={"Win*": "pane", "junk": "ignored"})
    kinds = {thing.name: model.materials[thing.material].kind for thing in model.things}
    assert kinds == {"glass": "pane", "panel": "mirror"}
    assert model.materials["default_mirror"].tint == 0.9
    assert read(glb, roles={"panel": "ignored"}).things[0].name == "glass"  # a glob goes before the extras
    nearest = read(glb, roles={"Window": "mirror", "glass": "pane", "junk": "ignored"})
    assert {nearest.materials[thing.material].kind for thing in nearest.things if thing.name == "glass"} == {"pane"}


def test_a_mirror_of_metal_is_in_the_tone_of_the_metal(read: Reader) -> None:
    surface = {"baseColorFactor": [0.5, 0.5, 0.5, 1], "roughnessFactor": 0.1}
    model = read(triangle(material={"name": "steel", "pbrMetallicRoughness": surface}), roles={"*": "mirror"})
    assert model.materials["steel_mirror"].tint == pytest.approx(0.5)
