"""Houses on the lots of a street: fronts of some styles with windows, roofs, and shops with depth behind their panes.

A house is built in the frame of its lot: its front is on x = 0 and faces x; it stands on the pavement.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture, shop
from vobench.asset.fitting import PANE
from vobench.asset.furniture import BLACK, DARK, Part, coated, matt, put, stood, wood
from vobench.asset.picture import BRICK, INK, NAVY, PAPER, PLUM, TEAL, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays
from vobench.asset.street_plan import KERB_M, Lot
from vobench.asset.wall import Hole, pierced, reveal
from vobench.geometry.se3 import Array
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import as_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

STYLES = ("brick", "brick", "render", "render", "stone", "panel")
BRICK_TINTS = ("#ffffff", "#d8c0a8", "#b98d7c", "#e6d6b4", "#9c8f8a", "#d2a68c")
RENDER_TINTS = ("#d9c39a", "#a9bac4", "#c8a392", "#dcd8cc", "#9fb09a", "#e6e0d2", "#c2b8a6", "#b98f76", "#8f9aa0")
STONE_TINTS = ("#e2d6bf", "#cfc6b4", "#d8d4cb")
PANEL_TINTS = ("#c9cbca", "#70767a", "#e0dfda", "#4a4f52", "#a59a8c")
TRIMS = ("#d9d5ca", "#b9b3a6", "#e8e5dd", "#9a948a")
FRAMES = ("#e4e2dc", "#e4e2dc", "#2d3234", "#6b4a2c", "#4f5f5a")
FASCIAS = (NAVY, TEAL, BRICK, PLUM, INK, "#2f4a36", "#e6e3da", "#8a2f2a", "#3b3f42")
SHOP_STOREY_M = 3.7
HOME_STOREY_M = 3.0
REVEAL_M = 0.17
FOUNDATION_M = KERB_M + 0.02  # of a house below the pavement
PICTURES = 8  # of what is behind windows
FASCIA_PX = 96  # height of the picture of a shop's name


@dataclass(frozen=True, slots=True)
class FrontStyle:
    """How a house looks."""

    wall: Material
    trim: Material
    frame: Material
    window_m: tuple[float, float]  # width and height
    module_m: float  # distance between windows
    is_modern: bool
    roof: str  # flat, pitched
    has_balconies: bool


@dataclass(slots=True)
class House:
    """The parts of a house while it is built, and the places of its lights, all in the lot's frame.

    shop_lamps are faces that shine on the goods; windows are faces of which some shine at night.
    """

    parts: list[Part] = field(default_factory=list)
    shop_parts: list[Part] = field(default_factory=list)
    shop_lamps: list[MeshArrays] = field(default_factory=list)
    windows: list[MeshArrays] = field(default_factory=list)


def front_style(rng: Rng) -> FrontStyle:
    """The style of a house."""
    # Few textures, in many tints: painting one takes up to half a second.
    kind = one_of(rng, *STYLES)
    seed = int(rng.integers(2))
    if kind == "brick":
        wall = matt(one_of(rng, *BRICK_TINTS), picture.masonry("brick", seed))
    elif kind == "render":
        wall = matt(one_of(rng, *RENDER_TINTS), picture.ground("plaster", seed, 1024, 3.2))
    elif kind == "stone":
        blocks = picture.masonry("paving", 0, 512, 2.4, rows=8, columns=3)
        wall = matt(one_of(rng, *STONE_TINTS), blocks)
    else:
        panels = picture.masonry("tile", 0, 512, 3.6, rows=3, columns=2, bond=0.0)
        wall = coated(one_of(rng, *PANEL_TINTS), panels, 0.35)
    is_modern = kind == "panel" or rng.random() < 0.15
    width_m = float(rng.uniform(1.5, 2.1) if is_modern else rng.uniform(0.9, 1.25))
    height_m = float(rng.uniform(1.4, 1.8) if is_modern else rng.uniform(1.45, 1.9))
    return FrontStyle(
        wall=wall,
        trim=matt(one_of(rng, *TRIMS), picture.ground("concrete", 4)),
        frame=coated(one_of(rng, *FRAMES), roughness=0.35),
        window_m=(width_m, height_m),
        module_m=width_m + float(rng.uniform(0.9, 1.5)),
        is_modern=is_modern,
        roof="flat" if is_modern or rng.random() < 0.45 else "pitched",
        has_balconies=is_modern and bool(rng.random() < 0.6),
    )


def house(rng: Rng, lot: Lot, *, has_shop: bool, number: int) -> House:
    """The house on a lot."""
    style = front_style(rng)
    storeys = int(rng.integers(1, 5) if lot.is_far else rng.integers(1, 4))
    ground_m = SHOP_STOREY_M if has_shop else HOME_STOREY_M + 0.3
    high_m = ground_m + storeys * HOME_STOREY_M + 0.5
    made = House()
    _front(rng, made, lot, style, storeys=storeys, ground_m=ground_m, high_m=high_m, has_shop=has_shop, number=number)
    for is_open, side in zip(lot.is_open, (-1, 1), strict=True):
        if is_open:
            _flank(rng, made, lot, style, side=side, storeys=storeys, ground_m=ground_m, high_m=high_m)
    _body(rng, made, lot, style, high_m)
    return _raised(made, KERB_M)


def _raised(made: House, z_m: float) -> House:
    """The house on the pavement."""
    T = at(z_m=z_m)
    return House(
        [part.moved(T) for part in made.parts],
        [part.moved(T) for part in made.shop_parts],
        [lamp.moved(T) for lamp in made.shop_lamps],
        [window.moved(T) for window in made.windows],
    )


# --- Fronts ---


def _front(
    rng: Rng,
    made: House,
    lot: Lot,
    style: FrontStyle,
    *,
    storeys: int,
    ground_m: float,
    high_m: float,
    has_shop: bool,
    number: int,
) -> None:
    """The front with its door, its windows, and a shop or a ground floor of a home."""
    w = lot.width_m
    windows = _upper_windows(style, w, storeys, ground_m)
    door_width_m = 1.0
    door_is_left = bool(rng.random() < 0.5)
    door_u = w - 0.55 - door_width_m if door_is_left else 0.55
    door: Hole = (door_u, door_u + door_width_m, 0.0, 2.25)
    window: Hole | None = None
    if has_shop:
        window = (0.5, door_u - 0.5, 0.42, 2.85) if door_is_left else (door_u + 1.5, w - 0.5, 0.42, 2.85)
    else:
        room = (0.3, door_u - 0.3) if door_is_left else (door_u + 1.3, w - 0.3)
        windows += _row(style, room, 0.85)
    openings = [*windows, door] + ([window] if window else [])
    _wall(
        rng,
        made,
        style,
        width_m=w,
        high_m=high_m,
        openings=openings,
        windows=windows,
        is_far=lot.is_far,
    )

    y = (door[0] + door[1]) / 2 - w / 2
    corner = np.array([0.0, -w / 2, 0.0])
    made.parts.append(Part(reveal(corner, (0, w, 0), (0, 0, high_m), door, 0.3), style.trim))
    leaf = wood(one_of(rng, "oak", "walnut")) if rng.random() < 0.4 else coated(one_of(rng, *FASCIAS), roughness=0.25)
    made.parts += [
        stood((0.06, door_width_m, 2.25), leaf, -0.27, y, 0, bevel=0.004),
        stood((0.04, 0.5, 0.7), coated("#12161a", roughness=0.08), -0.25, y, 1.25, bevel=0.003),
        put(block_arrays((0.05, 0.03, 0.3), bevel_m=0.008), BLACK, -0.22, y + 0.38, 1.05),
        put(card_arrays((0.24, 0.12)), matt(texture=picture.sign(str(number))), 0.006, y + 0.78, 1.9),
    ]
    made.parts.append(stood((0.28, door_width_m + 0.2, 0.05), style.trim, 0.13, y, 0, bevel=0.01))
    plinth_m = 0.34
    for first, last in _gaps(w, [door]):
        made.parts.append(
            stood((0.05, last - first, plinth_m), style.trim, 0.02, (first + last) / 2 - w / 2, 0, bevel=0)
        )
    if window:
        _shop(rng, made, lot, window, high_m)
    band_m = (0.14, w, 0.16)
    made.parts.append(stood(band_m, style.trim, 0.04, 0, ground_m - 0.2, bevel=0))
    if style.has_balconies and not lot.is_far:
        _balconies(made, style, windows, w)
    pipe_y = w / 2 - 0.14
    made.parts.append(put(block_arrays((0.09, 0.09, high_m - 0.3), bevel_m=0), DARK, 0.05, pipe_y, high_m / 2 - 0.15))


def _gaps(width_m: float, holes: Sequence[Hole]) -> list[tuple[float, float]]:
    """The stretches of a front between its doors."""
    ends = [0.0]
    for u0, u1, _, _ in sorted(holes):
        ends += [u0, u1]
    ends.append(width_m)
    return [(first, last) for first, last in zip(ends[::2], ends[1::2], strict=True) if last - first > 0.05]


def _upper_windows(style: FrontStyle, width_m: float, storeys: int, ground_m: float) -> list[Hole]:
    """The windows of the upper storeys."""
    found = []
    for storey in range(storeys):
        found += _row(style, (0.25, width_m - 0.25), ground_m + storey * HOME_STOREY_M + 0.75)
    return found


def _row(style: FrontStyle, span: tuple[float, float], sill_m: float) -> list[Hole]:
    """Windows side by side between two places along a front."""
    w, h = style.window_m
    length_m = span[1] - span[0]
    count = int(length_m / style.module_m)
    if count == 0 and length_m > w + 0.3:
        count = 1
    middles = span[0] + (np.arange(count) + 0.5) * length_m / max(count, 1)
    return [(u - w / 2, u + w / 2, sill_m, sill_m + h) for u in middles.tolist()]


def _flank(
    rng: Rng, made: House, lot: Lot, style: FrontStyle, *, side: int, storeys: int, ground_m: float, high_m: float
) -> None:
    """The wall of a side that is seen from a street, with windows in its upper storeys."""
    flank = House()
    windows = _upper_windows(style, lot.depth_m, storeys, ground_m)[:: 1 + int(rng.random() < 0.5)]
    _wall(
        rng,
        flank,
        style,
        width_m=lot.depth_m,
        high_m=high_m,
        openings=windows,
        windows=windows,
        is_far=lot.is_far,
    )
    flank.parts.append(stood((0.05, lot.depth_m, 0.34), style.trim, 0.02, 0, 0, bevel=0))
    T = at(-lot.depth_m / 2, side * lot.width_m / 2, 0, yaw=90 * side)
    made.parts += [part.moved(T) for part in flank.parts]
    made.windows += [window.moved(T) for window in flank.windows]


def _wall(
    rng: Rng,
    made: House,
    style: FrontStyle,
    *,
    width_m: float,
    high_m: float,
    openings: Sequence[Hole],
    windows: Sequence[Hole],
    is_far: bool,
) -> None:
    """A wall on x = 0, centred along y, with openings, and what is in its windows."""
    corner = np.array([0.0, -width_m / 2, 0.0])
    along_m = (0.0, width_m, 0.0)
    up = (0.0, 0.0, high_m)
    made.parts.append(Part(pierced(corner, along_m, up, openings), style.wall))
    if windows:
        reveals = [as_arrays(reveal(corner, along_m, up, hole, REVEAL_M)) for hole in windows]
        made.parts.append(Part(joined_arrays(reveals), style.trim if not style.is_modern else style.frame))
    by_picture: dict[int, list[MeshArrays]] = {}
    bars = []
    sills = []
    for u0, u1, v0, v1 in windows:
        y = (u0 + u1) / 2 + corner[1]
        z = (v0 + v1) / 2
        w = u1 - u0
        h = v1 - v0
        pane = card_arrays((w, h)).moved(at(-REVEAL_M + 0.03, y, z))
        by_picture.setdefault(int(rng.integers(PICTURES)), []).append(pane)
        made.windows.append(pane.moved(at(0.003)))
        bars += _bars(w, h, y, z, is_modern=style.is_modern, is_far=is_far)
        sills.append(block_arrays((0.2, w + 0.16, 0.07), bevel_m=0).moved(at(0.0, y, v0 - 0.035)))
    for number, panes in by_picture.items():
        glass = coated("#ffffff", window_picture(number), roughness=0.06)
        made.parts.append(Part(joined_arrays(panes), glass))
    if bars:
        made.parts += [Part(joined_arrays(bars), style.frame), Part(joined_arrays(sills), style.trim)]


def _bars(w: float, h: float, y: float, z: float, *, is_modern: bool, is_far: bool) -> list[MeshArrays]:
    """The frame of a window."""
    x = -REVEAL_M + 0.055
    upright = block_arrays((0.05, 0.06, h), bevel_m=0)
    level = block_arrays((0.05, w, 0.06), bevel_m=0)
    ys = [-w / 2 + 0.03, w / 2 - 0.03] + ([] if is_far else [0.0])
    zs = [-h / 2 + 0.03, h / 2 - 0.03] + ([] if is_far or is_modern else [0.16 * h])
    uprights = [upright.moved(at(x, y + dy, z)) for dy in ys]
    return uprights + [level.moved(at(x, y, z + dz)) for dz in zs]


def _balconies(made: House, style: FrontStyle, windows: Sequence[Hole], width_m: float) -> None:
    """Balconies of a slab and rails before every other window."""
    rails = []
    for u0, u1, v0, _ in windows[::2]:
        y = (u0 + u1) / 2 - width_m / 2
        w = u1 - u0 + 0.5
        if v0 < 2.5:
            continue
        made.parts.append(stood((0.95, w, 0.14), style.trim, 0.475, y, v0 - 0.2, bevel=0))
        top = block_arrays((0.04, w, 0.04), bevel_m=0).moved(at(0.92, y, v0 + 0.85))
        rails.append(top)
        bar = block_arrays((0.016, 0.016, 0.9), bevel_m=0).moved(at(0.92, y, v0 + 0.4))
        rails += [bar.moved(at(0, dy)) for dy in np.arange(-w / 2 + 0.04, w / 2, 0.16).tolist()]
    if rails:
        made.parts.append(Part(joined_arrays(rails), DARK))


# --- The ground floor of a shop ---


def _shop(rng: Rng, made: House, lot: Lot, window: Hole, high_m: float) -> None:
    """A shop window with a room behind its pane, a fascia with the name above it, and perhaps an awning."""
    w = lot.width_m
    u0, u1, v0, v1 = window
    middle = (u0 + u1) / 2 - w / 2
    width_m = u1 - u0
    ink = one_of(rng, *FASCIAS)
    paint = coated(ink, roughness=0.3)
    corner = np.array([0.0, -w / 2, 0.0])
    made.parts.append(Part(reveal(corner, (0, w, 0), (0, 0, high_m), window, 0.22), paint))
    bays = max(1, round(width_m / 2.2))
    for k in range(bays + 1):
        y = middle - width_m / 2 + k * width_m / bays
        made.parts.append(put(block_arrays((0.07, 0.06, v1 - v0), bevel_m=0), paint, -0.12, y, (v0 + v1) / 2))
    pane = quad_arrays((-0.12, middle - width_m / 2, v0), (0, width_m, 0), (0, 0, v1 - v0))
    made.shop_parts.append(Part(pane, PANE))

    kind = shop.drawn_kind(rng)
    inside = shop.interior(rng, kind, width_m=width_m, sill_m=v0, depth_m=lot.depth_m * 0.4)
    T = at(-0.22, middle, 0)
    made.shop_parts += [part.moved(T) for part in inside.parts]
    made.shop_lamps += [lamp.moved(T) for lamp in inside.lamps]

    name = one_of(rng, *shop.NAMES[kind])
    board_m = (0.12, width_m + 0.3, 0.62)
    made.parts.append(stood(board_m, paint, 0.06, middle, v1 + 0.06, bevel=0.01))
    length_m = min(width_m, 5.0)
    letters = card_arrays((length_m, length_m * FASCIA_PX / 1024))
    made.parts.append(put(letters, matt(texture=fascia(name, ink)), 0.125, middle, v1 + 0.37))
    choice = rng.random()
    if choice < 0.3 and not lot.is_far:
        _awning(made, ink, middle, width_m, v1)
    elif choice < 0.6 and not lot.is_far:
        _hanging_sign(rng, made, name, ink, middle + width_m / 2 - 0.2)


def _awning(made: House, ink: str, middle: float, width_m: float, head_m: float) -> None:
    """Striped cloth over a shop window."""
    count = max(4, round(width_m / 0.45))
    stripe_m = width_m / count
    stripes: tuple[list[MeshArrays], list[MeshArrays]] = ([], [])
    for k in range(count):
        y = middle + (k - (count - 1) / 2) * stripe_m
        cloth = block_arrays((1.15, stripe_m, 0.015), bevel_m=0).moved(at(0.66, y, head_m - 0.1, pitch=15))
        hem = block_arrays((0.012, stripe_m, 0.18), bevel_m=0).moved(at(1.22, y, head_m - 0.33))
        stripes[k % 2].extend([cloth, hem])
    made.parts += [Part(joined_arrays(stripes[0]), matt(ink)), Part(joined_arrays(stripes[1]), matt("#e4ded0"))]


def _hanging_sign(rng: Rng, made: House, name: str, ink: str, y: float) -> None:
    """A sign that hangs out over the pavement."""
    word = name.partition(" ")[0][:7]
    plate = matt(texture=picture.sign(word, ink))
    z = float(rng.uniform(2.95, 3.2))
    body = block_arrays((0.7, 0.04, 0.37), bevel_m=0.004)
    made.parts.append(put(body, DARK, 0.55, y, z))
    for side in (-1, 1):
        made.parts.append(put(card_arrays((0.68, 0.34)), plate, 0.55, y + side * 0.022, z, yaw=side * 90))
    made.parts.append(put(block_arrays((0.8, 0.03, 0.03), bevel_m=0), DARK, 0.4, y, z + 0.22))


@picture.painted
def fascia(name: str, ink: str) -> Picture:
    """The name of a shop on its board."""
    image = Image.new("RGB", (1024, FASCIA_PX), ink)
    draw = ImageDraw.Draw(image)
    letters = INK if sum(picture.rgb(ink)) > 450 else PAPER
    draw.text((512, FASCIA_PX // 2), name, font=picture._font(64), fill=letters, anchor="mm")
    return Picture(np.asarray(image))


@picture.painted
def window_picture(number: int) -> Picture:
    """What is behind a window by day: a dim room with curtains, a blind, a plant or a lamp."""
    rng = np.random.default_rng([number, 77])
    w = 128
    h = 192
    dim = 26 + 10 * rng.random()
    image = Image.new("RGB", (w, h), (int(dim), int(dim * 1.02), int(dim * 1.05)))
    draw = ImageDraw.Draw(image)
    back = int(dim * 1.5)
    draw.rectangle([0.25 * w, 0.1 * h, 0.8 * w, 0.62 * h], fill=(back, back - 2, back - 6))
    draw.rectangle([0, 0.9 * h, w, h], fill=(int(dim * 1.8), int(dim * 1.6), int(dim * 1.3)))
    cloth = picture.rgb(one_of(rng, "#8f887a", "#a49c8c", "#77807f", "#9a8878", "#b5b0a4"))
    kind = number % 4
    if kind == 0:
        _curtains(draw, rng, cloth, w, h, share=0.24)
    elif kind == 1:
        drop = rng.uniform(0.3, 0.75)
        for y in np.arange(0, drop * h, 5).tolist():
            draw.rectangle([0, y, w, y + 3], fill=cloth)
    elif kind == 2:
        _curtains(draw, rng, cloth, w, h, share=0.12)
        for _ in range(26):
            x = rng.normal(0.6 * w, 0.09 * w)
            y = rng.normal(0.78 * h, 0.07 * h)
            draw.ellipse([x - 6, y - 3, x + 6, y + 3], fill=(42, 62 + int(rng.integers(30)), 34))
    else:
        _curtains(draw, rng, cloth, w, h, share=0.5)
    return Picture(np.asarray(image))


def _curtains(draw: ImageDraw.ImageDraw, rng: Rng, cloth: Sequence[int], w: int, h: int, *, share: float) -> None:
    """Curtains in folds that cover a share of a window from either side."""
    for side in (0, 1):
        for fold in range(9):
            x = fold * share * w / 9
            tone = 0.72 + 0.28 * np.sin(1.9 * fold + rng.uniform(0, 0.6))
            fill = tuple(int(channel * tone) for channel in cloth)
            left = x if side == 0 else w - x - share * w / 9
            draw.rectangle([left, 0, left + share * w / 9 + 1, h], fill=fill)


# --- The rest of a house ---


def _body(rng: Rng, made: House, lot: Lot, style: FrontStyle, high_m: float) -> None:
    """The sides that nobody sees well, the back, and the roof."""
    corners = lot.local_corners_m
    right, left, back_left, back_right = (np.array([x, y, 0.0]) for x, y in corners.tolist())
    up = np.array([0.0, 0.0, high_m])
    walls = [quad_arrays(back_left, back_right - back_left, up)]
    if not lot.is_open[1]:
        walls.append(quad_arrays(left, back_left - left, up))
    if not lot.is_open[0]:
        walls.append(quad_arrays(back_right, right - back_right, up))
    made.parts.append(Part(joined_arrays(walls), style.wall))
    made.parts.append(Part(_foundation(right, left, back_left, back_right), style.trim))
    parapet_m = 0.3 if style.roof == "flat" else 0.0
    top = _polygon([right + up, left + up, back_left + up, back_right + up])
    made.parts.append(Part(top, DARK))
    w = lot.width_m
    if style.roof == "flat":
        made.parts.append(stood((0.3, w, parapet_m), style.trim, -0.06, 0, high_m - 0.06, bevel=0))
        return
    made.parts.append(stood((0.5, w, 0.14), style.trim, 0.1, 0, high_m - 0.16, bevel=0))
    _pitched_roof(rng, made, lot, style, high_m)


def _foundation(right: Array, left: Array, back_left: Array, back_right: Array) -> MeshArrays:
    """The front and the sides down to the road, for houses at the end of a road, where there is no pavement."""
    up = np.array([0.0, 0.0, FOUNDATION_M])
    down = -up
    sides = [
        quad_arrays(right + down, left - right, up),
        quad_arrays(left + down, back_left - left, up),
        quad_arrays(back_right + down, right - back_right, up),
    ]
    return joined_arrays(sides)


def _polygon(corners_m: Sequence[Array]) -> MeshArrays:
    """A flat quadrilateral."""
    vertices_m = np.array(corners_m)
    a, b, c = vertices_m[:3]
    normal = np.cross(b - a, c - a)
    normals = np.tile(normal / np.linalg.norm(normal), (4, 1))
    return MeshArrays(vertices_m, np.array([[0, 1, 2], [0, 2, 3]]), vertices_m[:, :2].copy(), normals)


def _pitched_roof(rng: Rng, made: House, lot: Lot, style: FrontStyle, high_m: float) -> None:
    """Two slopes with a ridge along the street, gables, and a chimney."""
    right, left, back_left, back_right = lot.local_corners_m
    ridge_m = high_m + float(rng.uniform(2.2, 3.4))
    ridge_right = np.array([*((right + back_right) / 2), ridge_m])
    ridge_left = np.array([*((left + back_left) / 2), ridge_m])
    eaves_x = np.array([0.25, 0.0])
    eave_right = np.array([*(right + eaves_x), high_m - 0.02])
    eave_left = np.array([*(left + eaves_x), high_m - 0.02])
    back_r = np.array([*back_right, high_m - 0.02])
    back_l = np.array([*back_left, high_m - 0.02])
    tint = one_of(rng, "#b98d7c", "#8a8f94", "#6f7276", "#a86a52", "#5d5f62")
    tiles = matt(tint, picture.masonry("tile", 1, 512, 2.0, rows=12, columns=8))
    slopes = [
        _slope(eave_right, eave_left, ridge_left, ridge_right),
        _slope(back_l, back_r, ridge_right, ridge_left),
    ]
    made.parts.append(Part(joined_arrays(slopes), tiles))
    gables = [
        _triangle(np.array([*left, high_m]), np.array([*back_left, high_m]), ridge_left),
        _triangle(np.array([*back_right, high_m]), np.array([*right, high_m]), ridge_right),
    ]
    made.parts.append(Part(joined_arrays(gables), style.wall))
    if rng.random() < 0.7:
        stack_m = (0.5, 0.9, 1.5)
        middle = (ridge_left + ridge_right) / 2
        y = float(middle[1] + rng.uniform(-0.3, 0.3) * lot.width_m)
        chimney = matt("#b98d7c", picture.masonry("brick", 1))
        made.parts.append(stood(stack_m, chimney, float(middle[0]), y, ridge_m - 0.6, bevel=0))


def _slope(a: Array, b: Array, c: Array, d: Array) -> MeshArrays:
    """A quadrilateral with texture coordinates along its first side and up the slope."""
    mesh = _polygon([a, b, c, d])
    along = (b - a) / np.linalg.norm(b - a)
    normal = mesh.normals[0]
    upwards = np.cross(normal, along)
    uv = np.column_stack([(mesh.vertices_m - a) @ along, -((mesh.vertices_m - a) @ upwards)])
    return replace(mesh, uv=uv)


def _triangle(a: Array, b: Array, c: Array) -> MeshArrays:
    """A triangle, which is visible from the side from which its corners are counter-clockwise."""
    normal = np.cross(b - a, c - a)
    normals = np.tile(normal / np.linalg.norm(normal), (3, 1))
    vertices_m = np.array([a, b, c])
    along = (b - a) / np.linalg.norm(b - a)
    uv = np.column_stack([(vertices_m - a) @ along, -vertices_m[:, 2]])
    return MeshArrays(vertices_m, np.array([[0, 1, 2]]), uv, normals)
