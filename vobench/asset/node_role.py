"""The roles of nodes in a model file: mirror, pane, lamp, mover, or ignored."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np

from vobench.asset.gltf import Node
from vobench.asset.gltf_material import Look
from vobench.errors import ModelError, unknown_name_sentence
from vobench.scene.material import LUMINANCE, Material

RoleByGlob = Mapping[str, str]
ROLES = ("mirror", "pane", "lamp", "mover", "ignored")
SILVER_TINT = 0.9  # the reflectance of a mirror whose material is not a metal


@dataclass(frozen=True, slots=True)
class NodeRole:
    """The role of a node.

    `name` is "" for a node without a role.
    `mover` is the index, in the names of the node, of the ancestor that moves the node; None if it is stationary.
    """

    name: str
    mover: int | None


class NamedMaterial(NamedTuple):
    """A material and the name that it should have in the model."""

    name: str
    material: Material


def require_matching_nodes(roles: RoleByGlob, nodes: Sequence[Node]) -> None:
    """Raise ModelError for a glob in `roles` that matches no node."""
    names = sorted({name for node in nodes for name in node.names})
    for glob in roles:
        if not any(fnmatchcase(name, glob) for name in names):
            raise ModelError(unknown_name_sentence("node", glob, names))


def node_role(node: Node, roles: RoleByGlob) -> NodeRole:
    """The role of a node; if none is assigned to it, that of its nearest ancestor with a role.

    `roles` maps glob patterns for node names to roles, and overrides the roles in the file.
    The roles `ignored` and `mover` apply to all descendants, even to those with another role.
    Raises ModelError for an unknown role.
    """
    names = [_assigned_role(name, in_file, roles) for name, in_file in zip(node.names, node.roles, strict=True)]
    for name in names:
        if name and name not in ROLES:
            raise ModelError(f"{node}: {unknown_name_sentence('role', name, [*ROLES])}")

    mover = names.index("mover") if "mover" in names else None
    if "ignored" in names:
        return NodeRole("ignored", mover)
    appearances = [name for name in names if name not in ("", "mover")]
    nearest = appearances[-1] if appearances else ""
    return NodeRole(nearest, mover)


def _assigned_role(node_name: str, role_in_file: str, roles: RoleByGlob) -> str:
    """The role of the first glob that matches the name of a node; if none matches, the role in the file."""
    matching_roles = (role for glob, role in roles.items() if fnmatchcase(node_name, glob))
    return next(matching_roles, role_in_file)


def material_in_role(look: Look, role: str) -> NamedMaterial:
    """The material of an object that has a look and a role.

    The reflectance of a mirror is the luminance of its metal's colour; if it is not a metal, it is that of silver.
    """
    material = look.material
    if role == "mirror":
        is_metal = material.metal > 0.5
        tint = float(np.array(material.colour) @ LUMINANCE) if is_metal else SILVER_TINT
        return NamedMaterial(f"{look.name}_mirror", Material("mirror", tint=tint))
    if role == "pane" and material.kind != "pane":
        return NamedMaterial(f"{look.name}_pane", Material("pane", eta=1.5))
    return NamedMaterial(look.name, material)
