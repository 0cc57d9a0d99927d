"""The emitters that a light of a scene consists of."""

from vobench.rendering.area_emitter import panel_emitter
from vobench.rendering.emitter import Emitter
from vobench.rendering.point_emitter import bulb_emitter, sun_emitter
from vobench.rendering.sky_emitter import open_sky, sky_pane
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Light, PointLight, Sky, SpotLight, Sun


def emitters(
    light: Light,
    visibility: Visibility,
    *,
    t_ns: float = 0,
) -> list[Emitter]:
    """The emitters of a light at an instant. The sky has one for each pane that shows it, and one for the rest."""
    match light:
        case AreaLight():
            return [panel_emitter(light)]
        case PointLight() | SpotLight():
            return [bulb_emitter(light)]
        case Sun():
            return [sun_emitter(light, t_ns)]
        case Sky():
            panes = [sky_pane(light, pane, visibility) for pane in visibility.sky_panes]
            return [*panes, open_sky(light, visibility)]
