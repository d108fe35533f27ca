"""What paths that scatter add to a source: only the files of effects that the scene has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from freepath.compose import kernel_files
from freepath.compose.kernel_files import KernelFile, TrackerFile, taken
from freepath.config.axes import AUTO, UNLIMITED
from freepath.config.path_axes import chance_of_absorption

MOST_SCATTERINGS = (1 << 24) - 1
"""What `unlimited` is in a kernel, which counts in float; far above any path's steps."""
ALL_CHANNELS = 3
HELD = {"ray": "Ray", "t": "real", "weight": "real"}
"""What a path is at a collision, beside what it has in each channel."""
SKY_ROWS, SKY_COLUMNS = 64, 128
"""Of the table that an image of the environment is resampled to, without the rows beyond poles."""


def modes_pay(medium: str, channels: int) -> bool:
    """Whether lanes on shadow rays and on paths are faster together, if they can share a lookup.

    Where it is expensive, in voxel grids, and holding a path is not: docs/decisions/shadow-rays.md.
    """
    return medium in {"grid_nearest", "grid_trilinear"} and channels == 1


@dataclass(frozen=True)
class Effects:
    """The effects of a scene along paths, named as `freepath list effects` does."""

    names: tuple[str, ...]
    channels: int
    chromatic: bool
    phase: str
    tracker: TrackerFile
    shadow: TrackerFile | None = None
    modes: bool = False
    """Whether a lane is on its path or on a shadow ray; else these are flown in an inner loop."""
    values: Mapping[str, Mapping[str, Any]] = field(default_factory=dict, hash=False)
    """{group: {field of the kernel's Numbers: value or list of values}}, in their order."""

    def __contains__(self, name: str) -> bool:
        return name in self.names

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """The fields of each group; those of a list are arrays."""
        return {
            group: tuple(
                f"{name}[{len(v)}]" if isinstance(v, list) else name for name, v in f.items()
            )
            for group, f in self.values.items()
        }

    @property
    def numbers(self) -> list[float]:
        """All values, in the order in which `groups` declares them."""
        return [
            float(number)
            for fields in self.values.values()
            for value in fields.values()
            for number in (value if isinstance(value, list) else [value])
        ]

    @property
    def state(self) -> dict[str, str]:
        """What a path carries for its effects."""
        near = ["light/near_light"] if "light" in self.tracker.needs else []
        files = [kernel_files.read(name) for name in [*near, *self._after]]
        state = {name: kind for file in files for name, kind in file.state.items()}
        return state | {f"held_{name}": kind for name, (kind, _) in self._held.items()}

    @property
    def uses(self) -> tuple[str, ...]:
        """What its phase function has composed before it."""
        return kernel_files.read(f"light/phase_{self.phase}").uses if "scattering" in self else ()

    @property
    def _held(self) -> dict[str, tuple[str, str]]:
        """The kind and the place of what a lane keeps of its path while it flies a shadow ray."""
        channels = kernel_files.read(
            f"score/channels_{'several' if self.chromatic else 'one'}"
        ).state
        held = {name: (kind, f"path->{name}") for name, kind in HELD.items()}
        held |= {name: (kind, f"path->state.{name}") for name, kind in channels.items()}
        return held if self.modes else {}

    def around_tracker(self, *, exact: bool) -> list[KernelFile]:
        """The tracker's files with those of the effects before and behind them."""
        before = []
        if "scattering" in self:
            circle = "math/circle_builtin" if exact else "math/circle_polynomial"
            before += [circle, f"light/phase_{self.phase}"]
        if "space" in self.values:
            before.append("light/direction")
        if "scattering" in self:
            before += ["light/near_light"] if "light" in self.tracker.needs else []
            before += (
                ["light/angle_table"] if self.tracker.aims and self.phase != "isotropic" else []
            )
            before.append(f"light/{self._ended_by}")
        files = [kernel_files.read(name) for name in before]
        files += self.tracker.files("flight", step=not self.modes)
        if self.shadow:
            files.append(kernel_files.read("light/shadow"))
            files += self.shadow.files("shadow", step=not self.modes)
        files += [KernelFile("held", self._keeping())] if self.modes else []
        files += [kernel_files.read(name) for name in self._after]
        return [*files, KernelFile("hooks", self._hooks()), kernel_files.read("light/paths")]

    @property
    def _after(self) -> list[str]:
        order = (
            "length",
            "emission",
            "environment",
            "environment_image",
            "point_light",
            "scattering",
        )
        after = [f"light/{name}" for name in order if name in self]
        if "scattering" in self:
            direction = "aimed_direction" if self.tracker.aims else "new_direction"
            after[-1:-1] = ["light/around", f"light/{direction}", f"light/{self._until}"]
        if self.modes:
            after.append("light/shadow_mode")
        elif "point_light" in self:
            after.append("light/shadow_loop")
        return after

    @property
    def _ended_by(self) -> str:
        """By which chance a path ends at a collision."""
        return next((name for name in ("p_absorb", "roulette") if name in self), "no_roulette")

    @property
    def _until(self) -> str:
        """Where a path ends: behind the last light of a point there must be something else."""
        beyond = ("length", "emission", "environment", "environment_image")
        return "until_out" if any(name in self for name in beyond) else "until_last_light"

    def _keeping(self) -> str:
        """How lanes keep their path and go on with it."""
        kept = [(kind, at, f"path->state.held_{n}") for n, (kind, at) in self._held.items()]
        hold = [taken(kind, held, at) for kind, at, held in kept]
        resume = [taken(kind, at, held) for kind, at, held in kept]
        both = {"hold_path": hold, "resume_path": resume}
        given = "Path *path, const mask where"
        return "\n\n".join(_function(name, given, lines) for name, lines in both.items())

    def _hooks(self) -> str:
        """What happens at the beginning of a path and at the end of a flight."""
        scatters = "scattering" in self
        at_begin = ["path->state.scatterings = (index)0;"] if scatters else []
        at_begin += ["path->state.shadow = path->state.waiting = (mask)0;"] if self.modes else []
        # a path may be cut off on a shadow ray
        over = ["return_to_path(path, ended & path->state.shadow);"] if self.modes else []
        over += ["restore_ray(path, ended);"] if scatters else []
        at_end = "Path *path, const Scene *scene, Rng *rng, const mask "
        at_end += "stopped" if self.modes else "ended"
        return "\n\n".join(
            [
                _function("path_begin", "Path *path", at_begin),
                _function("path_end", "Path *path, const mask ended", over),
                _function("at_end", at_end, self._at_end()),
            ]
        )

    def _at_end(self) -> list[str]:
        """What the scene's effects do where flights have ended, in turn."""
        gone = "ended & path->escaped"
        calls = {
            "length": "collect_length(path, ended);",
            "environment": f"see_environment(path, scene, {gone});",
            "environment_image": f"see_image(path, scene, {gone});",
        }
        collided = {
            "emission": "emit(path, scene, here);",
            "point_light": "light_directly(path, scene, rng, here);",
            "scattering": "scatter(path, scene, rng, goes_on(path, scene, here));",
        }
        if self.modes:
            collided |= {"point_light": "begin_shadow(path, scene, rng, here);"}
            del collided["scattering"]
        flights = [
            "const mask seen = stopped & path->state.shadow, ended = stopped & ~seen;",
            "end_shadow(path, scene, rng, seen);",
        ]
        return [
            *(flights if self.modes else ()),
            *(call for name, call in calls.items() if name in self),
            "const mask here = ended & ~path->escaped;",
            "if (!any_lane(here))",
            "    return;",
            *(call for name, call in collided.items() if name in self),
        ]


def _function(name: str, parameters: str, lines: list[str]) -> str:
    body = [f"    {line}" for line in lines]
    return "\n".join([f"static void {name}({parameters})", "{", *body, "}"])


def of_scene(
    case: Any, medium: Any, tracker: TrackerFile, shadow: TrackerFile | None, *, chromatic: bool
) -> Effects:
    """Derive the effects of a case in its medium, followed by a tracker.

    `effects: all` has every effect that this scene could have, switched on with what adds nothing.
    """
    everything = case.effects == "all"
    count = len(medium.channels)
    channels = ALL_CHANNELS if everything and count == 1 else count
    names = _names(case, shadow, everything=everything)
    # trackers that decide at a tentative collision can share it and its lookup
    shares = shadow and tracker.at_tentative and shadow.at_tentative
    phase = "isotropic"
    if case.medium.g or everything:
        phase = "henyey_greenstein"
    if case.medium.phase != "henyey_greenstein":  # which alone has a g
        phase = case.medium.phase
    return Effects(
        names=names,
        channels=channels,
        chromatic=chromatic or channels > 1,
        phase=phase,
        tracker=tracker,
        shadow=shadow if "point_light" in names else None,
        modes=bool(shares) and modes_pay(medium.kernel, channels) and "point_light" in names,
        values=_values(case, medium, names, channels),
    )


def _names(case: Any, shadow: TrackerFile | None, *, everything: bool) -> tuple[str, ...]:
    """The effects that a scene has, or all that it could have."""
    model, light = case.medium, case.light
    collects = case.estimand != "path_length"
    scatters = everything or (any(model.albedo) and case.scatterings != 0)
    lit = everything or hasattr(light, "intensity")
    has = {
        "length": not collects,
        "emission": collects and (everything or any(model.emission)),
        "environment": collects and (everything or hasattr(light, "radiance")),
        "environment_image": collects and hasattr(light, "file"),
        "point_light": collects and scatters and lit and shadow is not None,
        "scattering": scatters,
        "p_absorb": scatters and case.p_absorb != AUTO,
        "roulette": scatters and case.p_absorb == AUTO and case.scatterings == UNLIMITED,
    }
    return tuple(name for name, there in has.items() if there)


def _values(
    case: Any, medium: Any, names: tuple[str, ...], channels: int
) -> dict[str, dict[str, Any]]:
    """The numbers of a scene's effects, by their groups."""
    model, light = case.medium, case.light

    def spread(given: tuple[float, ...]) -> list[float]:
        return list(given) * channels if len(given) == 1 else list(given)

    optics: dict[str, Any] = {"albedo": spread(model.albedo)}
    if "emission" in names:
        optics["emission"] = spread(model.emission)
    if "environment" in names:
        optics["environment"] = spread(getattr(light, "radiance", (0.0,)))
    values: dict[str, dict[str, Any]] = {"optics": optics}
    if "scattering" in names:
        unlimited = case.scatterings == UNLIMITED
        optics["scatterings"] = MOST_SCATTERINGS if unlimited else case.scatterings
        optics |= (
            {"g": model.g, "alpha": model.alpha} if model.phase == "draine" else {"g": model.g}
        )
    if "p_absorb" in names:
        optics["p_absorb"] = chance_of_absorption(case)
    if "scattering" in names or "environment_image" in names:
        values["space"] = _space(medium)
    if "point_light" in names:
        position = np.array(getattr(light, "position", (0.0, 0.0, 0.0)))
        place = medium.to_medium[:, :3] @ position + medium.to_medium[:, 3]
        values["light"] = dict(zip("xyz", place.tolist(), strict=True))
        values["light"]["intensity"] = spread(getattr(light, "intensity", (0.0,)))
    return values


def _space(medium: Any) -> dict[str, list[float]]:
    """The linear maps between directions of the world and of the medium, row by row."""
    linear = medium.to_medium[:, :3]
    return {
        "to_world": np.linalg.inv(linear).reshape(-1).tolist(),
        "to_medium": linear.reshape(-1).tolist(),
    }
