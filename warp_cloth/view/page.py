"""The web page: a viser server whose controls change a live fit."""

from __future__ import annotations

import io
import tempfile
import threading
import time
import webbrowser
from collections.abc import Callable
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.base.errors import InputError
from warp_cloth.base.topology import build_topology
from warp_cloth.export.surface import AVATAR_COLOUR, cloth_colour
from warp_cloth.fitting.fit import Progress
from warp_cloth.maps import MAPS
from warp_cloth.material.fabric import shipped_fabrics
from warp_cloth.scene.schema import CollisionSpec
from warp_cloth.scene.shapes import SIZES, MannequinShape
from warp_cloth.view.live import BODY_MEASURES, LiveFit
from warp_cloth.view.picture import legend_html, map_colours
from warp_cloth.view.surfaces import Surfaces
from warp_cloth.view.verdict import saved_note, schema_limits, swatches_html, verdict_html

PLAIN = "none"
IDLE_SECONDS = 0.03  # between two checks of the controls while nothing moves
MOST_PICTURES = 30.0  # per second
COLOUR_SECONDS = 0.5  # between two measurements of a map while the garment moves, at least
COLOUR_FRACTION = 0.2  # of the time for measuring maps, at most
LEAST_RESIDUAL = 1e-9  # lower end of the logarithmic plot
GROUND_LIGHT, SKY = (150, 150, 155), 1.6  # in addition to the viewer's own light; chosen by eye
SAVED_SECONDS = 15.0  # for which a note stands that says what was saved
STATUS_SECONDS = 0.5  # between two updates of status and plots while the garment moves
AS_SHOWN = "of the shape shown, in which cloth may pass through cloth: press fit for the fit itself"
FITTED = "of the fit itself, as the command makes it"


class Page:
    """Shows a live fit and applies the changes of its controls; ``run`` serves until ``stop``."""

    def __init__(self, live: LiveFit, *, host: str = "127.0.0.1", port: int = 8080) -> None:
        import viser

        self._live = live
        with redirect_stdout(io.StringIO()):  # it prints the address in a box of its own, verbose or not
            self._server = viser.ViserServer(host=host, port=port, label="warp-cloth", verbose=False)
        self._pending: dict[str, str | None] = {}  # overrides not applied yet; None: the first value
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        self._work = threading.Lock()  # locked while the live fit is read or changed: controls call from other threads
        self._reset_pending = self._fit_pending = False
        self._stale = False  # a new picture is due although nothing moves
        self._surfaces = Surfaces(self._server)
        self._map: tuple[list[Any], tuple[float, float]] | None = None
        self._map_time = 0.0  # when a map may be measured again
        self._status_time = 0.0  # when status and plots may be updated again
        self.pictures = 0
        self._build()

    @property
    def port(self) -> int:
        """The port that the page is served on."""
        return int(self._server.get_port())

    def stop(self) -> None:
        """Ends ``run`` and the server."""
        self._stopped.set()

    def run(self) -> None:
        """The loop: apply changes, relax a burst, show it; until ``stop``."""
        try:
            while not self._stopped.is_set():
                began = time.perf_counter()
                if self._step():
                    time.sleep(max(1.0 / MOST_PICTURES - (time.perf_counter() - began), 0.0))
                else:
                    time.sleep(IDLE_SECONDS)
        finally:
            self._server.stop()

    def _step(self) -> bool:
        """Applies changes, relaxes a burst and shows it; False if there was nothing to do."""
        with self._work:
            changed, self._stale = self._apply() or self._stale, False
            moving = self._is_moving() and self._is_watched()
            if moving and not changed:
                self._live.advance()
            if changed or moving:
                self.show()
            else:
                self._surfaces.settle()
            return changed or moving

    def _build(self) -> None:
        """All controls, the avatar and the garments."""
        server, live = self._server, self._live
        server.scene.set_up_direction("+y")
        # the browser may have no graphics card, and shadows would draw everything five times more
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(None)
        server.scene.add_light_hemisphere("/sky", ground_color=GROUND_LIGHT, intensity=SKY)
        server.gui.configure_theme(control_width="medium", dark_mode=False)
        lowest = np.min([live.points.min(axis=0), self._body_bounds()[0]], axis=0)
        highest = np.max([live.points.max(axis=0), self._body_bounds()[1]], axis=0)
        middle, size = 0.5 * (lowest + highest), float((highest - lowest).max())
        server.initial_camera.position = tuple(middle + np.array([0.22, 0.06, 0.85]) * size)
        server.initial_camera.look_at = tuple(middle)
        gui = server.gui
        self._status = gui.add_markdown(live.status())
        self._verdict = gui.add_html(verdict_html(None, ""))
        with gui.add_folder("Garment"):
            if live.sized:
                self._size_choice()
            self._fabric = self._fabric_choice()
            if live.scene.avatar is not None:
                low, high = schema_limits(CollisionSpec, "offset_mm")
                offset_mm = live.scene.collision.offset_mm
                offset = gui.add_slider("offset [mm]", min=low, max=high, step=0.5, initial_value=offset_mm)
                offset.on_update(lambda _: self._request("collision.offset_mm", f"{offset.value}"))
        measures = live.body
        if measures is not None:
            with gui.add_folder("Body"):
                self._measure_sliders(measures)
        with gui.add_folder("Map"):
            possible = [n for n, kind in MAPS.items() if live.scene.avatar is not None or not kind.needs_avatar]
            self._map_choice = gui.add_dropdown("map", (PLAIN, *possible), initial_value=PLAIN)
            self._map_choice.on_update(lambda _: self._recolour())
            self._legend = gui.add_html("")
        with gui.add_folder("Run"):
            self._pause = gui.add_checkbox("pause", initial_value=False)
            fit = gui.add_button("fit", hint="The fit itself, with cloth meeting cloth, as the command makes it")
            fit.on_click(lambda _: self._request_fit())
            reset = gui.add_button("reset", hint="Back to where the garment was loaded")
            reset.on_click(lambda _: self._request_reset())
            save = gui.add_button("save", hint="The shape shown, as a .usdz file")
            save.on_click(self._save)
        self._build_plots()
        self._show_avatar()
        self.show()

    def _build_plots(self) -> None:
        data = (np.zeros(1), np.zeros(1))
        with self._server.gui.add_folder("Progress"):
            self._residual = self._server.gui.add_uplot(
                data,
                series=({"label": "iteration"}, {"label": "log10", "stroke": "#4a7da8", "width": 2}),
                scales={"x": {"time": False}},  # not a logarithmic axis, which labels 0.0001 as 0
                title="relative residual (log10)",
                aspect=2.2,
            )
            self._speed = self._server.gui.add_uplot(
                data,
                series=({"label": "iteration"}, {"label": "iterations per second", "stroke": "#c46b57", "width": 2}),
                scales={"x": {"time": False}},
                title="iterations per second",
                aspect=2.2,
            )

    def _fabric_choice(self) -> Any:
        """A menu of the shipped fabrics, after the scene's own where it has one."""
        shipped, fabric = shipped_fabrics(), self._live.scene.garments[0].fabric
        own = "" if shipped.get(fabric.name) == fabric else f"{fabric.name} (from the scene)"
        names = tuple(filter(None, (own, *shipped)))
        chosen = self._server.gui.add_dropdown("fabric", names, initial_value=own or fabric.name)

        def choose(_: object) -> None:
            self._request("garment.fabric", None if chosen.value == own else chosen.value, every_garment=True)

        chosen.on_update(choose)
        return chosen

    def _size_choice(self) -> None:
        shape = self._live.scene.garments[0].shape
        now = str(getattr(shape, "size", SIZES[1]))
        size = self._server.gui.add_dropdown("size", SIZES, initial_value=now)
        size.on_update(lambda _: self._request_size(size.value))

    def _request_size(self, size: str) -> None:
        """Of the innermost garment."""
        self._request(f"{self._live.scene.garment_keys[0]}.shape.size", size)

    def _measure_sliders(self, measures: dict[str, float]) -> None:
        def connect(name: str) -> None:
            low, high = (100 * end for end in schema_limits(MannequinShape, name))
            slider = self._server.gui.add_slider(
                f"{name} [cm]", min=low, max=high, step=1.0, initial_value=100 * measures[name]
            )
            slider.on_update(lambda _: self._request(f"avatar.shape.{name}", f"{slider.value / 100:.3f}"))

        for name in BODY_MEASURES:
            connect(name)

    def _request(self, key: str, value: str | None, *, every_garment: bool = False) -> None:
        count = len(self._live.scene.garments)
        with self._lock:
            if every_garment and count > 1:
                for index in range(count):
                    self._pending[key.replace("garment.", f"garment[{index}].")] = value
            else:
                self._pending[key] = value

    def _request_reset(self) -> None:
        with self._lock:
            self._reset_pending = True

    def _request_fit(self) -> None:
        with self._lock:
            self._fit_pending = True

    def _apply(self) -> bool:
        """Applies the changes since the last step; whether there were any."""
        with self._lock:
            changes, self._pending = self._pending, {}
            reset, self._reset_pending = self._reset_pending, False
            fit, self._fit_pending = self._fit_pending, False
        if not (changes or reset or fit):
            return False
        self._status.content = (
            f"Changing {', '.join(changes)} …" if changes else "Resetting …" if reset else "Fitting …"
        )
        try:
            if changes:
                self._live.change(changes)
            if reset:
                self._live.reset()
            if fit:
                self._live.fit(self._show_progress)
        except InputError as error:
            self._status.content = f"**Not possible:** {error}"
            return False
        if any(key.startswith("avatar.shape") for key in changes):
            self._show_avatar()
        self._map_time = 0.0
        return True

    def _show_progress(self, step: Progress) -> None:
        """Shows how far the fit is."""
        now = time.perf_counter()
        if step.stage != "relax" or now > self._status_time:
            self._status_time = now + STATUS_SECONDS
            error = f", rest error {step.rest_error_mm:.2g} mm" if np.isfinite(step.rest_error_mm or np.nan) else ""
            self._status.content = f"Fitting: {step.stage}{error} …"

    def _recolour(self) -> None:
        self._map_time = 0.0
        self._stale = True

    def _body_bounds(self) -> tuple[Any, Any]:
        avatar = self._live.problem.outfit.avatar
        return avatar.bounds() if avatar is not None else (self._live.points.min(axis=0), self._live.points.max(axis=0))

    def _show_avatar(self) -> None:
        avatar = self._live.problem.outfit.avatar
        if avatar is not None:
            topology = build_topology(avatar.triangles, avatar.vertex_count)
            closed = len(topology.hinges) == len(topology.edges)
            self._surfaces.plain("avatar", avatar.points, avatar.triangles, AVATAR_COLOUR, closed=closed)

    def show(self) -> None:
        """Updates the picture: garments in their colours, status, plots."""
        live = self._live
        now = time.perf_counter()
        name = self._map_choice.value
        if name == PLAIN:
            self._map = None
            names = [f"{spec.name} ({spec.fabric.name})" for spec in live.scene.garments]
            self._set_legend(swatches_html(names, live.scene.avatar is not None))
        elif now > self._map_time or live.ended:
            self._map = live.values(name)
            spent = time.perf_counter() - now
            self._map_time = now + max(COLOUR_SECONDS, spent / COLOUR_FRACTION)
            known = self._map is not None
            self._set_legend(legend_html(MAPS[name], self._map[1]) if self._map and known else "not available here")
        for index, worn in enumerate(live.garments()):
            node, triangles = f"garment_{index}", worn.mesh.triangles
            if self._map is not None and name in MAPS and len(self._map[0][index]) == len(worn.points):
                colours = map_colours(MAPS[name], self._map[0][index], self._map[1])
                self._surfaces.coloured(node, worn.points, triangles, colours)
            else:
                self._surfaces.plain(node, worn.points, triangles, cloth_colour(index))
        self.pictures += 1
        if now > self._status_time or not self._is_moving():
            self._status_time = now + STATUS_SECONDS
            self._show_status()

    def _set_legend(self, html: str) -> None:
        if self._legend.content != html:  # every content set is sent
            self._legend.content = html

    def _is_watched(self) -> bool:
        """Whether a browser shows the page: the garment waits for one, and while there is none."""
        return bool(self._server.get_clients())

    def _is_moving(self) -> bool:
        return not (self._pause.value or self._live.ended)

    def _show_status(self) -> None:
        """Updates status and plots, which a browser takes longer to draw than a garment."""
        self._status.content = self._live.status()
        note = AS_SHOWN if self._live.fitted is None else FITTED
        html = verdict_html(self._live.judged(), note)
        if self._verdict.content != html:
            self._verdict.content = html
        history = self._live.history
        if history.iteration and len(history.iteration) != len(self._residual.data[0]):
            x = np.array(history.iteration)
            self._residual.data = (x, np.log10(np.maximum(np.array(history.residual), LEAST_RESIDUAL)))
            self._speed.data = (x, np.array(history.speed))

    def _save(self, event: Any) -> None:
        live = self._live
        with self._work, tempfile.TemporaryDirectory() as folder:
            chosen = "" if self._map_choice.value == PLAIN else self._map_choice.value
            path = live.saved(Path(folder), chosen)
            content, spec = path.read_bytes(), live.scene.garments[0]
            size = getattr(spec.shape, "size", "") if live.sized else ""
            settings = {"garment": spec.name, "size": size, "fabric": spec.fabric.name}
            said = saved_note(path.name, len(content), settings, live.status(), chosen)
        target = event.client if event.client is not None else self._server
        target.send_file_download(path.name, content, save_immediately=True)
        for client in [event.client] if event.client is not None else self._server.get_clients().values():
            client.add_notification("Saved", said, auto_close_seconds=SAVED_SECONDS)


def serve(live: LiveFit, *, host: str, port: int, show: Callable[[str], None], opened: bool = False) -> None:
    """Serves the page until it is interrupted; ``show`` is called with its address, which a browser opens if wanted."""
    page = Page(live, host=host, port=port)
    address = f"http://{'127.0.0.1' if host == '0.0.0.0' else host}:{page.port}"
    show(f"{'opening' if opened else 'open'} {address} in a browser, which the garment waits for; Ctrl-C ends the page")
    if opened and not webbrowser.open(address):
        show("no browser could be opened here: open that address yourself")
    page.run()
