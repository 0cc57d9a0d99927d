"""Shop fronts: a window with a room behind its pane, a board with the name, and on some an awning or a sign."""

from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture, shop
from vobench.asset.fitting import PANE
from vobench.asset.furniture import DARK, SIDES, Part, coated, matt, put, stood
from vobench.asset.picture import BRICK, INK, NAVY, PAPER, PLUM, TEAL, Rng, one_of
from vobench.asset.shape import at, block_arrays, card_arrays
from vobench.asset.street_plan import Lot
from vobench.asset.wall import Hole, reveal
from vobench.scene.material import Material, Picture
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays, quad_arrays

FASCIAS = (NAVY, TEAL, BRICK, PLUM, INK, "#2f4a36", "#e6e3da", "#8a2f2a", "#3b3f42")
FASCIA_PX = 96  # height of the picture of a shop's name
FASCIA_LENGTH_PX = 1024
LETTERS_M = 5.0  # the largest length of that picture
BRIGHT = 450  # sum of red, green and blue, above which a name is written in a dark colour
PANE_X_M = -0.12
ROOM_X_M = -0.22  # of the front of the room behind the pane
ROOM_SHARE = 0.4  # of the depth of the lot
BAY_M = 2.2  # of a shop window between its posts, about
AWNING_SHARE = 0.3
SIGN_SHARE = 0.3
AWNING_STRIPE_M = 0.45  # width of a stripe, about
AWNING_WHITE = "#e4ded0"
SIGN_LETTERS = 7  # on a hanging sign, at most


@dataclass(frozen=True, slots=True)
class ShopFront:
    """A shop front, in the frame of the lot.

    `parts` are those outside.
    `room_parts` are the pane and what is behind it.
    `lamps` are faces that shine on the goods.
    """

    parts: list[Part]
    room_parts: list[Part]
    lamps: list[MeshArrays]


@dataclass(frozen=True, slots=True)
class _ShopWindow:
    """The window of a shop in a front: `hole` is in coordinates from the right end of the front and from the ground."""

    hole: Hole
    front_width_m: float

    @property
    def middle_y_m(self) -> float:
        """The y of its middle."""
        first_m, last_m, _, _ = self.hole
        return (first_m + last_m) / 2 - self.front_width_m / 2

    @property
    def width_m(self) -> float:
        """The width."""
        return self.hole[1] - self.hole[0]

    @property
    def sill_m(self) -> float:
        """The height of the lower edge."""
        return self.hole[2]

    @property
    def head_m(self) -> float:
        """The height of the upper edge."""
        return self.hole[3]


def shop_front(rng: Rng, lot: Lot, hole: Hole, high_m: float) -> ShopFront:
    """The front of a shop around a hole in the front of a house that is `high_m` high."""
    window = _ShopWindow(hole, lot.width_m)
    ink = one_of(rng, *FASCIAS)
    paint = coated(ink, roughness=0.3)
    parts = _shop_frame(window, high_m, paint)
    pane_corner_m = (PANE_X_M, window.middle_y_m - window.width_m / 2, window.sill_m)
    pane = quad_arrays(pane_corner_m, (0, window.width_m, 0), (0, 0, window.head_m - window.sill_m))

    kind = shop.drawn_kind(rng)
    depth_m = lot.depth_m * ROOM_SHARE
    inside = shop.interior(rng, kind, width_m=window.width_m, sill_m=window.sill_m, depth_m=depth_m)
    T_house_shop = at(ROOM_X_M, window.middle_y_m, 0)
    room_parts = [Part(pane, PANE), *(part.moved(T_house_shop) for part in inside.parts)]
    lamps = [lamp.moved(T_house_shop) for lamp in inside.lamps]

    name = one_of(rng, *shop.NAMES[kind])
    parts += _fascia_board(window, name, ink, paint)
    choice = rng.random()
    if lot.is_far:
        return ShopFront(parts, room_parts, lamps)
    if choice < AWNING_SHARE:
        parts += _awning(window, ink)
    elif choice < AWNING_SHARE + SIGN_SHARE:
        parts += _hanging_sign(rng, window, name, ink)
    return ShopFront(parts, room_parts, lamps)


def _shop_frame(window: _ShopWindow, high_m: float, paint: Material) -> list[Part]:
    """The reveal of a shop window, and the posts that divide it into bays."""
    corner_m = np.array([0.0, -window.front_width_m / 2, 0.0])
    along_m = (0, window.front_width_m, 0)
    parts = [Part(reveal(corner_m, along_m, (0, 0, high_m), window.hole, 0.22), paint)]
    bays = max(1, round(window.width_m / BAY_M))
    post = block_arrays((0.07, 0.06, window.head_m - window.sill_m), bevel_m=0)
    post_z_m = (window.sill_m + window.head_m) / 2
    for number in range(bays + 1):
        y_m = window.middle_y_m - window.width_m / 2 + number * window.width_m / bays
        parts.append(put(post, paint, PANE_X_M, y_m, post_z_m))
    return parts


def _fascia_board(window: _ShopWindow, name: str, ink: str, paint: Material) -> list[Part]:
    """The board above a shop window with the name of the shop."""
    board_m = (0.12, window.width_m + 0.3, 0.62)
    board = stood(board_m, paint, 0.06, window.middle_y_m, window.head_m + 0.06, bevel=0.01)
    length_m = min(window.width_m, LETTERS_M)
    letters = card_arrays((length_m, length_m * FASCIA_PX / FASCIA_LENGTH_PX))
    lettering = matt(texture=fascia(name, ink))
    return [board, put(letters, lettering, 0.125, window.middle_y_m, window.head_m + 0.37)]


def _awning(window: _ShopWindow, ink: str) -> list[Part]:
    """Cloth over a shop window, in stripes of two colours."""
    count = max(4, round(window.width_m / AWNING_STRIPE_M))
    stripe_m = window.width_m / count
    cloth = block_arrays((1.15, stripe_m, 0.015), bevel_m=0)
    hem = block_arrays((0.012, stripe_m, 0.18), bevel_m=0)
    coloured: list[MeshArrays] = []
    white: list[MeshArrays] = []
    for number in range(count):
        y_m = window.middle_y_m + (number - (count - 1) / 2) * stripe_m
        stripes = coloured if number % 2 == 0 else white
        stripes.append(cloth.moved(at(0.66, y_m, window.head_m - 0.1, pitch=15)))
        stripes.append(hem.moved(at(1.22, y_m, window.head_m - 0.33)))
    return [Part(joined_arrays(coloured), matt(ink)), Part(joined_arrays(white), matt(AWNING_WHITE))]


def _hanging_sign(rng: Rng, window: _ShopWindow, name: str, ink: str) -> list[Part]:
    """A sign that hangs out over the pavement at one end of a shop window."""
    word = name.partition(" ")[0][:SIGN_LETTERS]
    lettering = matt(texture=picture.sign(word, ink))
    y_m = window.middle_y_m + window.width_m / 2 - 0.2
    z_m = float(rng.uniform(2.95, 3.2))
    plate = block_arrays((0.7, 0.04, 0.37), bevel_m=0.004)
    arm = block_arrays((0.8, 0.03, 0.03), bevel_m=0)
    face = card_arrays((0.68, 0.34))
    faces = [put(face, lettering, 0.55, y_m + side * 0.022, z_m, yaw=side * 90) for side in SIDES]
    return [put(plate, DARK, 0.55, y_m, z_m), *faces, put(arm, DARK, 0.4, y_m, z_m + 0.22)]


@picture.painted
def fascia(name: str, ink: str) -> Picture:
    """The name of a shop on its board."""
    image = Image.new("RGB", (FASCIA_LENGTH_PX, FASCIA_PX), ink)
    draw = ImageDraw.Draw(image)
    is_bright = sum(picture.rgb(ink)) > BRIGHT
    middle_px = (FASCIA_LENGTH_PX // 2, FASCIA_PX // 2)
    draw.text(middle_px, name, font=picture._font(64), fill=INK if is_bright else PAPER, anchor="mm")
    return Picture(np.asarray(image))
