"""Find the servos on a bus with unknown rate and ids."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager

from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.make import Make
from gaitchain.errors import BackendError, CommandError

_PATIENCE_S, _EACH_S = 0.05, 0.01  # the latter where all ids are asked in turn


@contextmanager
def opened(
    port: str,
    bauds: Sequence[int] | None,
    ids: Iterable[int] | None,
    make: Make,
) -> Iterator[tuple[ServoBus, int, dict[int, int]]]:
    """Open a port at the first rate at which a device answers.

    Args:
        port: name of the serial port.
        bauds: rates to try [bit/s]; those of the make by default.
        ids: ids to ping; all by default.
        make: make of the servos.

    Yields:
        The bus, its rate, and the model number by id of each device that answered.

    Raises:
        BackendError: the port cannot be opened, or no device answers.
    """
    wanted = None if ids is None else list(ids)
    bauds = make.bauds if bauds is None else bauds
    patience_s = _PATIENCE_S if make.wire.knows_ping_all or wanted else _EACH_S
    for baud in bauds:
        bus = ServoBus(port, baud, patience_s, make=make)
        bus.open()
        try:
            models = bus.scan(wanted)
            if models and wanted is None and make.wire.knows_ping_all:
                models |= bus.scan()  # adds devices whose answers collided before
            if models:
                yield bus, baud, models
                return
        finally:
            bus.close()
    rates = ", ".join(map(str, bauds))
    raise BackendError(
        f"{port}: nobody answers at {rates} bit/s; check the servos' supply, the "
        f"cable, the rate (--baud), and the make (--make), which is {make.name} here"
    )


def parse_ids(text: str, make: Make) -> list[int]:
    """Parse ids such as "1-12,200".

    Args:
        text: the ids.
        make: make of the servos.

    Raises:
        CommandError: the text cannot be parsed, or no servo of the make has such an id.
    """
    found: list[int] = []
    most = make.wire.last_id
    for piece in text.split(","):
        first, dash, last = piece.strip().partition("-")
        ends = [first, last] if dash else [first, first]
        if not all(end.isascii() and end.isdigit() and len(end) < 4 for end in ends):
            raise CommandError(f'--ids {text!r}: give ids such as "1-12,200"')
        low, high = map(int, ends)
        if not low <= high <= most:
            raise CommandError(
                f"--ids {piece.strip()!r}: give ids from 0 to {most}, low to high"
            )
        found.extend(range(low, high + 1))
    return found
