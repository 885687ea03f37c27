"""A renderer that is kept from one picture to the next, as for the frames of an animation, and whose picture grows while it renders."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from . import _native, arguments, mesh
from .checked import checked
from .mesh import Mesh
from .picture import CurvePoint, Picture, Volumes, finished, in_order, require_end, told_points
from .scene import Scene
from .session import Frame
from .volume import Job


class Renderer:
    """Renders scenes one after another. What a scene has in common with the one before is not built again: hierarchies, tables of
    materials, lights, and on a graphics processor the device with its programs. Each picture is the one that `render` makes, bit for bit.

    `backend`: as for `render`. One call renders at a time; `latest` may be called from any thread meanwhile.
    """

    @checked
    def __init__(self, *, backend: str = "auto") -> None:
        self._native = _native.Renderer(backend)

    @checked
    def render(
        self,
        scene: Scene,
        volumes: Volumes,
        *,
        meshes: Sequence[Mesh] = (),
        spp: int | None = None,
        seconds: float | None = None,
        error: float | None = None,
        growing: bool = False,
        growing_passes: bool = False,
        unfinished: bool = False,
        denoise: bool | str = False,
        job: Job | None = None,
        on_progress: Callable[[CurvePoint], None] | None = None,
    ) -> Picture:
        """Renders `scene` until the first limit is reached; arguments as for `render`. Volumes and meshes that are the same objects as before
        keep their hierarchies.

        `growing`: `latest` gives frames meanwhile, about one a second; of a large film the first ones are coarse.
        `growing_passes`: `take_so_far` gives pictures with all passes meanwhile, the first one after the first samples, the next ones so
        seldom that making them takes at most a hundredth of the time.
        `unfinished`: once the job is cancelled, the result is the picture so far; `Cancelled` is raised only if it has no sample.
        `denoise`: as for `render`; frames are not denoised.
        """
        require_end(scene, spp, seconds, error)
        limits = arguments.limits(spp, seconds, error)
        native = self._native.render(
            scene._native,
            in_order(scene, volumes),
            mesh.natives(meshes),
            limits,
            (bool(growing), bool(growing_passes), bool(unfinished)),
            denoise=arguments.denoiser(denoise),
            job=job,
            on_progress=told_points(on_progress),
        )
        return finished(native)

    @checked
    def latest(self, after: int = 0) -> Frame | None:
        """The newest frame of the picture that is rendered now, if its serial is above `after`, else None; never waits. A frame has no
        passes; read its pixels as those of `Session.latest`."""
        return self._native.latest(after)

    def take_so_far(self) -> Picture | None:
        """The newest picture so far of what is rendered now, with all its passes; each is given once, so None where there is no newer one.
        Never waits. Only a call of `render` with `growing_passes` makes them. It does not say of which scene it is: `save` writes no scene."""
        native = self._native.take_so_far()
        return None if native is None else Picture(native)

    @property
    def rebuilt(self) -> dict[str, int]:
        """How often each kind of data was built: camera, film, lights, materials, acceleration, top_level. Waits for the picture that is
        rendered now."""
        return self._native.rebuilt()
