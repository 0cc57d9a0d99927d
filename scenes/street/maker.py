"""A street along x between brick and rendered houses with shops, with parked cars, trees, lamps and a crossing."""

from dataclasses import replace

import numpy as np
from PIL import Image, ImageDraw

from vobench.plugin import (
    BRICK,
    DARK,
    INK,
    INKS,
    NAVY,
    PAPER,
    PLUM,
    SAND,
    STEEL,
    TEAL,
    WHITE,
    AreaLight,
    Part,
    Picture,
    Piece,
    Steady,
    at,
    block,
    card,
    coated,
    joined,
    lathe,
    matt,
    moved,
    picture,
    pierced,
    put,
    quad,
    reveal,
    stood,
    things,
    tube,
    wood,
)

LONG = 84.0  # of the street; houses close it at both ends, beyond a crossroad
ROAD_M = 7.0
PAVED_M = 3.2
KERB_M = 0.12
CROSS_M = 8.0
STOREY_M = 3.1
SHOP_M = 3.7
GLASS_NAME = "glass"
GLASS = coated("#1a2025", roughness=0.12)
NORTH_MASTS = (-36.0, -12.0, 12.5, 37.0)
SOUTH_MASTS = (-24.5, 0.0, 26.0)
OFF = Steady(0.0)
NAMES = (
    "BAKERY", "BOOKS", "TEA ROOM", "FLORIST", "OPTICIAN", "CYCLES", "TAILOR", "WINES", "PHARMACY", "SHOES", "MUSIC",
    "HARDWARE", "GALLERY", "BARBER", "DELI", "TOYS", "CAFE", "PRINTS", "LAMPS", "FABRICS",
)  # fmt: skip
FACES = (
    ("brick", "#ffffff"), ("plaster", "#d9c39a"), ("plaster", "#a9bac4"), ("brick", "#d8c0a8"), ("plaster", "#c8a392"),
    ("plaster", "#dcd8cc"), ("brick", "#b98d7c"), ("plaster", "#9fb09a"),
)  # fmt: skip


def make(seed):
    """Its things and their materials."""
    far = list(_ground())
    near = []
    x = -LONG / 2
    k = 0
    rng = np.random.default_rng([seed, 1])
    for side in (-1, 1):
        x = -LONG / 2
        while x < LONG / 2 - 1:
            wide = float(rng.uniform(8.5, 13.0))
            wide = LONG / 2 - x if LONG / 2 - x - wide < 7 else wide
            place = at(x + wide / 2, side * (ROAD_M / 2 + PAVED_M), 0, yaw=-90 * side)
            far += _moved(f"house_{k}", _house(rng, k, wide), place)
            x = x + wide
            k = k + 1
    for end in (-1, 1):
        for y in (-13.0, 0.0, 13.0):
            place = at(end * (LONG / 2 + CROSS_M + PAVED_M), y, 0, yaw=90 + 90 * end)
            far += _moved(f"house_{k}", _house(rng, k, 13.0), place)
            k += 1
    for end, side in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        place = at(end * (LONG / 2 + (CROSS_M + PAVED_M) / 2), side * 22.0, 0, yaw=-90 * side)
        far += _moved(f"house_{k}", _house(rng, k, CROSS_M + PAVED_M), place)
        k += 1
    near += [piece.build(seed) for piece in _pieces(rng)]
    near += _signs()
    made, known = things(far, {GLASS_NAME: GLASS})
    more, known = things(near, known)
    spaced = (replace(thing, spacing_m=_spacing_m(thing.name)) for thing in (*made, *more))
    return tuple(spaced), known, (_lamps(), _lit_windows(made))


def _lamps():
    """What shines below the arms of the street lamps, off by day."""
    heads = [(x, 2.7) for x in NORTH_MASTS] + [(x, -2.7) for x in SOUTH_MASTS]
    faces = [quad((x - 0.09, y - 0.27, KERB_M + 5.0), (0, 0.54, 0), (0.18, 0, 0)) for x, y in heads]
    return AreaLight("street_lamps", joined(faces), 6000.0 * len(heads), OFF, colour=(1.12, 0.98, 0.79))


def _lit_windows(things):
    """Some windows of homes that shine at night: what lies just before their panes."""
    panes = joined([thing.mesh for thing in things if thing.name.startswith("house") and thing.material == GLASS_NAME])
    quads = panes.vertices.reshape(-1, 4, 3)[::5]
    before = panes.vertex_normals.reshape(-1, 4, 3)[::5] * 0.003
    faces = [quad(c[0] + n[0], c[1] - c[0], c[3] - c[0]) for c, n in zip(quads, before, strict=True)]
    return AreaLight("windows", joined(faces), 250.0 * len(faces), OFF, colour=(1.25, 0.95, 0.62))


def _spacing_m(name):
    """Fine on the ground near by, coarse on what is high, thin or far."""
    kind = name.split("_")[0]
    return {"road": 0.25, "pavement": 0.25, "house": 0.6, "car": 0.22, "tree": 0.6}.get(kind, 0.18)


def _moved(name, parts, place):
    yield name, [part.moved(place) for part in parts]


def _asphalt():
    rng = np.random.default_rng(5)
    px = 2048
    tone = 88 + 7 * picture.noise(rng, px, 2, 20, slope=1.0) + 13 * picture.noise(rng, px, 80, 900, slope=0.1)
    image = Image.fromarray(np.clip(tone, 20, 200).astype(np.uint8)).convert("RGB")
    draw = ImageDraw.Draw(image)
    for _ in range(9):  # patches where it was dug up, and cracks filled with tar
        x, y, w, h = rng.uniform(0, 0.8 * px, 2).tolist() + rng.uniform(90, 420, 2).tolist()
        shade = int(rng.uniform(62, 84))
        if rng.random() < 0.35:
            draw.rectangle([x, y, x + w, y + h], fill=(shade, shade, shade + 1), outline=(44, 44, 45), width=5)
        walk = np.cumsum(rng.normal([7, 0], [6, 9], (40, 2)), axis=0) + np.array([x, y])
        draw.line([tuple(p) for p in walk.tolist()], fill=(47, 47, 48), width=4)
    grain = 1 + 0.1 * picture.noise(rng, px, 200, 1000, slope=0.0)[..., None]
    return Picture(np.clip(np.asarray(image) * grain, 0, 255).astype(np.uint8), 10.0)


def _ground():
    """Roads, pavements with kerbs, lines, a crossing, gullies and lids."""
    asphalt = matt("#ffffff", _asphalt())
    slabs = matt("#f2eee6", picture.masonry("paving", 2, 1024, 2.4, rows=6, columns=4))
    stone = matt("#b9b5ab", picture.ground("concrete", 4))
    line = matt("#d8d7d0", picture.ground("concrete", 6))
    half = LONG / 2
    edge = ROAD_M / 2
    far = half + CROSS_M
    yield (
        "road",
        [
            Part(quad((-half, -edge, 0), (LONG, 0, 0), (0, ROAD_M, 0)), asphalt),
            *(Part(quad((x, -22, 0), (CROSS_M, 0, 0), (0, 44, 0), uv_m=(3, 4)), asphalt) for x in (-far, half)),
        ],
    )
    slabs_of = [
        quad((-half, s * (edge + PAVED_M / 2) - PAVED_M / 2, KERB_M), (LONG, 0, 0), (0, PAVED_M, 0)) for s in (-1, 1)
    ]
    slabs_of += [quad((x, -22, KERB_M), (PAVED_M, 0, 0), (0, 44, 0)) for x in (-far - PAVED_M, far)]
    yield "pavement", [Part(joined(slabs_of), slabs)]
    kerbs = [
        block((LONG, 0.15, 0.3), bevel_m=0.015, transform=at(0, s * (edge + 0.02), KERB_M - 0.148)) for s in (-1, 1)
    ]
    kerbs += [
        block(
            (0.15, PAVED_M, 0.3),
            bevel_m=0.015,
            transform=at(e * (half - 0.02), s * (edge + PAVED_M / 2), KERB_M - 0.148),
        )
        for e in (-1, 1)
        for s in (-1, 1)
    ]
    kerbs += [block((0.15, 44, 0.3), bevel_m=0.015, transform=at(e * (far + 0.02), 0, KERB_M - 0.148)) for e in (-1, 1)]
    yield "kerb", [Part(joined(kerbs), stone)]
    dashes = [
        quad((x, -0.06, 0.004), (2.0, 0, 0), (0, 0.12, 0))
        for x in np.arange(-half + 6, half - 6, 5.0)
        if abs(x - 8) > 3.4
    ]
    bays = [
        quad((x, s * (edge - 2.1) - 0.05, 0.004), (5.6, 0, 0), (0, 0.1, 0))
        for x in np.arange(-36, 36, 6.0)
        for s in (-1,)
    ]
    zebra = [quad((6.2, y, 0.004), (3.6, 0, 0), (0, 0.5, 0)) for y in np.arange(-edge + 0.25, edge - 0.3, 1.0)]
    stops = [quad((e * (half - 0.8) - 0.2, min(0.0, -e * edge), 0.004), (0.4, 0, 0), (0, edge, 0)) for e in (-1, 1)]
    yield "lines", [Part(joined([*dashes, *bays, *zebra, *stops]), line)]
    lids = [moved(_lid(), at(x, y, 0.003)) for x, y in ((-20, 0.9), (-3, -0.7), (15, 1.0), (29, -0.9))]
    gullies = [
        block((0.45, 0.4, 0.01), bevel_m=0.003, transform=at(x, s * (edge - 0.3), 0.003))
        for x in (-25, -5, 16, 33)
        for s in (-1, 1)
    ]
    yield "lids", [Part(joined(lids + gullies), matt("#4a4b4b"))]


def _lid():
    return lathe(
        [[0, -0.01], [0.32, -0.01], [0.32, 0.004], [0.29, 0.004], [0.28, 0.0], [0.2, 0.0], [0.19, 0.004], [0, 0.004]]
    )


def _display(rng):
    """What is to be seen in a shop window: goods on shelves before a wall, with cards and lamps."""
    w = 640
    h = 420
    back = picture.rgb(picture.one_of(rng, "#a08c70", "#8d999a", "#b3a894", "#8f7c80"))
    image = Image.new("RGB", (w, h), back)
    draw = ImageDraw.Draw(image)
    for k in range(8):
        draw.rectangle([0, k * h / 8, w, (k + 1) * h / 8], fill=tuple(int(c * (1.1 - 0.06 * k)) for c in back))
    for row in range(3):
        z = 130 + row * 125
        draw.rectangle([20, z, w - 20, z + 9], fill=(120, 92, 62))
        x = 30.0
        while x < w - 60:
            bw = rng.uniform(16, 58)
            bh = rng.uniform(28, 96)
            ink = picture.rgb(picture.one_of(rng, *INKS, PAPER, SAND))
            if rng.random() < 0.4:
                draw.ellipse([x, z - bh, x + bw, z], fill=ink)
            else:
                draw.rectangle([x, z - bh, x + bw, z], fill=ink)
                draw.rectangle([x + 0.15 * bw, z - 0.7 * bh, x + 0.85 * bw, z - 0.4 * bh], fill=picture.rgb(PAPER))
            x += bw + rng.uniform(2, 30)
    for x in rng.uniform(40, w - 80, 3):
        draw.rectangle([x, 20, x + 56, 62], fill=picture.rgb(PAPER), outline=picture.rgb(INK), width=3)
    return Picture(np.asarray(image))


def _fascia(name, ink):
    image = Image.new("RGB", (1024, 96), ink)
    draw = ImageDraw.Draw(image)
    draw.rectangle([6, 6, 1017, 89], outline=PAPER, width=3)
    draw.text((512, 48), name, font=picture._font(62), fill=PAPER, anchor="mm")
    return Picture(np.asarray(image))


def _house(rng, number, wide):
    """A front on x = 0 that faces x: a shop below, storeys of windows above, a cornice, a door and a downpipe."""
    kind, colour = FACES[(number * 3 + number // 8) % len(FACES)]
    storeys = int(rng.integers(2, 5))
    ink = picture.one_of(rng, NAVY, TEAL, BRICK, PLUM, INK, "#2f4a36")
    look = (
        matt(colour, picture.masonry("brick", number % 3))
        if kind == "brick"
        else matt(colour, picture.ground("plaster", number % 4, 1280, 3.2))
    )
    trim = matt(("#d9d5ca", "#b9b3a6", "#e8e5dd")[number % 3])
    high = SHOP_M + storeys * STOREY_M + 0.5
    corner = np.array([0.0, -wide / 2, 0.0])
    along = np.array([0.0, wide, 0.0])
    up = np.array([0.0, 0.0, high])
    count = max(2, round(wide / float(rng.uniform(2.3, 3.0))))
    module = wide / count
    w = float(rng.uniform(0.95, 1.25))
    h = float(rng.uniform(1.5, 1.9))
    upper = [((k + 0.5) * module, SHOP_M + s * STOREY_M + 0.75) for s in range(storeys) for k in range(count)]
    holes = [(y - w / 2, y + w / 2, z, z + h) for y, z in upper]
    door_at = 0.8 if number % 2 else wide - 1.8
    shop = (0.35, wide - 2.2, 0.45, 2.75) if number % 2 == 0 else (2.2, wide - 0.35, 0.45, 2.75)
    entry = (door_at, door_at + 1.0, 0.0, 2.3)
    parts = [Part(pierced(corner, along, up, [*holes, shop, entry]), look)]
    parts.append(Part(joined([reveal(corner, along, up, hole, 0.18) for hole in holes]), trim))
    parts.append(Part(joined([reveal(corner, along, up, hole, 0.3) for hole in (shop, entry)]), wood("walnut")))
    bars = []
    sills = []
    panes = []
    for u0, u1, v0, v1 in holes:
        y = (u0 + u1) / 2 - wide / 2
        z = (v0 + v1) / 2
        bars += [
            block((0.05, 0.06, v1 - v0), bevel_m=0, transform=at(-0.13, y + s * (w / 2 - 0.03), z)) for s in (-1, 0, 1)
        ]
        bars += [
            block((0.05, w, 0.06), bevel_m=0, transform=at(-0.13, y, zz))
            for zz in (v0 + 0.03, v0 + 0.68 * h, v1 - 0.03)
        ]
        sills.append(block((0.2, w + 0.2, 0.09), bevel_m=0, transform=at(0.02, y, v0 - 0.045)))
        panes.append(quad((-0.15, u0 - wide / 2, v0), (0, w, 0), (0, 0, h)))
    cornice = [
        block((0.5, wide, 0.14), bevel_m=0, transform=at(0.16, 0, high - 0.07)),
        block((0.3, wide, 0.2), bevel_m=0, transform=at(0.06, 0, high - 0.25)),
    ]
    band = block((0.16, wide, 0.16), bevel_m=0, transform=at(0.04, 0, SHOP_M + 0.1))
    parts += [Part(joined([*sills, *cornice, band]), trim), Part(joined(panes), GLASS), Part(joined(bars), WHITE)]
    if number % 3 == 1:  # curtains behind some of the windows
        parts.append(
            Part(
                joined([quad((-0.149, u0 - wide / 2, v0), (0, 0.22 * w, 0), (0, 0, h)) for u0, _, v0, _ in holes[::2]]),
                matt("#b9b2a2"),
            )
        )
    parts += _shop(rng, shop, wide, ink)
    u0, u1, _, _ = shop
    middle = (u0 + u1) / 2 - wide / 2
    name = NAMES[number % len(NAMES)]
    length = min(u1 - u0, 6.0)
    parts.append(stood((0.12, u1 - u0 + 0.2, 0.66), coated(ink), 0.05, middle, 2.86, bevel=0))
    parts.append(put(card((length, length * 96 / 1024)), matt(texture=_fascia(name, ink)), 0.115, middle, 3.19))
    leaf_y = (entry[0] + entry[1]) / 2 - wide / 2
    parts += [
        stood((0.06, 1.0, 2.3), wood("oak") if number % 2 else coated(ink), -0.24, leaf_y, 0),
        stood((0.3, 1.2, 0.12), trim, 0.05, leaf_y, 0),
    ]
    parts.append(put(card((0.24, 0.12)), matt(texture=picture.sign(str(2 * number + 3))), 0.006, leaf_y + 0.75, 1.9))
    if number % 3 == 0:
        parts += _awning(ink, middle, u1 - u0)
    parts.append(put(tube([[0.08, wide / 2 - 0.15, KERB_M], [0.08, wide / 2 - 0.15, high - 0.3]], 0.045), DARK))
    return [*parts, *_body(wide, high, look)]


def _body(wide, high, look):
    """The roof and the two sides behind a front."""
    deep = 15.5
    roof = [block((deep, wide, 0.1), bevel_m=0, transform=at(-deep / 2, 0, high - 0.06))]
    side = block((deep, 0.1, high - 0.1), bevel_m=0)
    sides = [moved(side, at(-0.02 - deep / 2, s * (wide / 2 - 0.05), high / 2 - 0.06)) for s in (-1, 1)]
    return [Part(joined(roof), DARK), Part(joined(sides), look)]


def _shop(rng, shop, wide, ink):
    """The window of a shop: goods behind the glass of each bay, and posts between the bays."""
    u0, u1, v0, v1 = shop
    bays = max(2, round((u1 - u0) / 2.4))
    parts = []
    for k in range(bays):
        width = (u1 - u0) / bays
        goods = coated("#ffffff", _display(rng), roughness=0.12)
        parts.append(put(card((width, v1 - v0)), goods, -0.25, u0 - wide / 2 + (k + 0.5) * width, (v0 + v1) / 2))
    posts = [
        block((0.07, 0.07, v1 - v0), bevel_m=0, transform=at(-0.2, u0 - wide / 2 + k * (u1 - u0) / bays, (v0 + v1) / 2))
        for k in range(bays + 1)
    ]
    parts.append(Part(joined(posts), coated(ink)))
    return parts


def _awning(ink, middle, wide):
    """Striped cloth over a shop window."""
    stripes = [
        block((1.25, wide / 10, 0.015), bevel_m=0, transform=at(0.66, middle + (k - 4.5) * wide / 10, 2.72, pitch=16))
        for k in range(10)
    ]
    hems = [
        block((0.012, wide / 10, 0.2), bevel_m=0, transform=at(1.27, middle + (k - 4.5) * wide / 10, 2.46))
        for k in range(10)
    ]
    pale = matt("#e4ded0")
    return [Part(joined([*stripes[::2], *hems[::2]]), matt(ink)), Part(joined([*stripes[1::2], *hems[1::2]]), pale)]


def _pieces(rng):
    """Parked cars on the south side, trees, street lamps, bollards, benches and bins."""
    for k, x in enumerate((-34.5, -28.6, -22.4, -10.7, -4.5, 13.4, 19.6, 31.3)):
        back = 180 if k in (2, 5) else 0
        yield Piece(
            "car",
            f"car_{k}",
            (x + float(rng.normal(0, 0.15)), -2.45 + float(rng.normal(0, 0.05)), 0),
            back + float(rng.normal(0, 1)),
        )
    for k, x in enumerate((-31.0, -18.0, -5.0, 20.0, 33.0)):
        yield Piece("tree", f"tree_{k}", (x, 4.6, KERB_M), 40 * k, size={"height_m": 5.6 + 0.5 * (k % 3)})
    for k, x in enumerate(NORTH_MASTS):
        yield Piece("street_lamp", f"mast_{k}", (x, 3.9, KERB_M), -90)
    for k, x in enumerate(SOUTH_MASTS):
        yield Piece("street_lamp", f"mast_{k + 4}", (x, -3.9, KERB_M), 90)
    for k, x in enumerate((3.6, 4.9, 11.1, 12.4)):
        yield Piece("bollard", f"bollard_{k}", (x, -3.85, KERB_M))
        yield Piece("bollard", f"bollard_n{k}", (x - 0.2, 3.85, KERB_M))
    for k, x in enumerate((-14.5, 16.0)):
        yield Piece(
            "bench", f"bench_{k}", (x, 4.6, KERB_M), -90, size={"width_m": 1.8, "depth_m": 0.45, "height_m": 0.45}
        )
        yield Piece("waste_bin", f"bin_{k}", (x + 1.5, 4.5, KERB_M), size={"width_m": 0.45, "height_m": 0.8})
    for k, (x, y) in enumerate(((-20.5, -6.2), (22.0, 6.2))):
        yield Piece("plant", f"plant_{k}", (x, y, KERB_M), size={"height_m": 1.3})
    for k, (x, y, yaw) in enumerate(
        ((-8.0, 5.6, 10), (-7.0, 5.3, 14), (24.2, -5.4, 176), (2.5, -5.2, -8), (9.3, 5.2, -80))
    ):
        yield Piece("person", f"person_{k}", (x, y, KERB_M), yaw, size={"height_m": 1.62 + 0.05 * k})


def _signs():
    """Traffic signs on poles, and a pillar box."""
    for k, (x, y, text, ink) in enumerate(
        (
            (5.6, 4.0, "30", "#b3241c"),
            (10.6, -4.0, "ZONE", NAVY),
            (-26.0, 4.0, "P", NAVY),
            (28.2, -4.0, "ONE WAY", NAVY),
        )
    ):
        pole = put(tube([[0, 0, 0], [0, 0, 2.7]], 0.03), STEEL)
        plate = matt(texture=picture.sign(text, ink))
        faces = [put(card((0.62, 0.31)), plate, s * 0.036, 0, 2.4, yaw=90 * (1 - s)) for s in (-1, 1)]
        body = put(block((0.06, 0.63, 0.32), bevel_m=0.004), STEEL, 0, 0, 2.4)
        yield f"sign_{k}", [part.moved(at(x, y, KERB_M)) for part in (pole, *faces, body)]
