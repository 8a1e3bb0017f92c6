"""The extras that a verb needs, checked before its modules are imported."""

from typing import Any

_ALWAYS = {
    "bench": ("sim",),
    "build": ("sim",),
    "explain": ("sim", "view", "serve"),
    "figures": ("sim", "view"),
    "push": ("sim",),
    "qualify": ("sim",),
    "replay": ("sim", "view", "serve"),
    "serve": ("serve",),
    "trial": ("sim",),
    "walk": ("sim", "view"),
}
_PICTURES = {"push": "output", "qualify": "map"}  # options that write a picture
_BACKENDS = {"mujoco": "sim", "dask": "dask", "ray": "ray"}


def extras_of(options: Any) -> list[str]:
    """Return the extras that a verb needs with these options.

    Extras for some robots only, such as `servos`, are checked when these are opened.
    """
    verb = type(options).__name__.lower()
    extras = [*_ALWAYS.get(verb, ())]
    if verb in _PICTURES and getattr(options, _PICTURES[verb]) is not None:
        extras.append("view")
    backend = _BACKENDS.get(getattr(options, "backend", ""))
    return [*extras, backend] if backend else extras
