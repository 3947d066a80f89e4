"""The command ``warp-cloth resident``: a process that stays, and does the work of ``warp-cloth fit`` at once."""

from __future__ import annotations

import contextlib
import gc
import json
import os
import signal
import socket
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from warp_cloth.base.clock import command_began
from warp_cloth.base.device import begin_waking, device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.cli.options import Device
from warp_cloth.cli.resident_client import ENDING, LENGTH, PATIENCE, PREFIX, READY, is_ours, resident_place
from warp_cloth.cli.terminal import INTERRUPTED, one_line_errors

# What interrupts a command: not SIGINT, which shells let ignore what they start with &, but where there is no other.
INTERRUPT = getattr(signal, "SIGUSR1", signal.SIGINT)
FAILED = 1  # exit status of an error that nobody expected
TERMINATED = 128 + signal.SIGTERM  # the same of a process that was sent that


def resident_of(main: Callable[[], None]) -> Callable[..., None]:
    """The command, for a ``main`` that runs what ``sys.argv`` names."""

    def resident(
        device: Device = None,
        minutes: Annotated[float, typer.Option(help="Idle minutes after which it ends.", min=0.01, max=1440.0)] = 30.0,
    ) -> None:
        """Stay in memory, so that `warp-cloth fit` need not load Python's packages, Warp and the GPU each time.

        Fits of this user, environment and version find it by themselves, and run alone where it is busy or gone.
        It keeps no garments or bodies from fit to fit. For Linux.

        \b
        warp-cloth resident &
        warp-cloth fit tshirt
        """
        with one_line_errors():
            place = resident_place()  # before the imports: a change of code after this is another place
            if place is None:
                needed = "needs Linux, and a cache folder with a short path"
                raise InputError("resident", needed, "set WARP_CLOTH_CACHE")
            with listening(place) as listener:
                begin_waking(device)
                start_warp()
                from warp_cloth.cli import fit_progress  # noqa: F401
                from warp_cloth.export import save  # noqa: F401
                from warp_cloth.fitting.warm_up import KINDS, warm_up

                warm_up(device_named(device), kinds=KINDS[:1])
                typer.echo(f"ready: fits start at once, until none has come for {minutes:g} minutes", err=True)
                forget()
                serve(listener, main, 60.0 * minutes)

    return resident


@contextlib.contextmanager
def listening(place: Path) -> Iterator[socket.socket]:
    """A socket at a place, for this user alone.

    Raises:
        InputError: a resident listens there already, or the place cannot be written.
    """
    if _is_live(place):
        raise InputError("resident", "there is one already", "use that one")
    for other in place.parent.glob(f"{PREFIX}*{ENDING}"):  # of those that were killed: each fit looks at them
        if not _is_live(other):
            other.unlink(missing_ok=True)
    with socket.socket(socket.AF_UNIX) as listener:
        try:
            place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            os.fchmod(listener.fileno(), 0o600)  # before anybody can connect; Linux gives the file this mode
            listener.bind(str(place))
            own = place.stat().st_ino
        except OSError as error:
            raise InputError(str(place), error.strerror or str(error), "set WARP_CLOTH_CACHE") from None
        try:
            listener.listen(1)
            yield listener
        finally:
            with contextlib.suppress(OSError):
                if place.stat().st_ino == own:  # not that of another one, which began at the same moment
                    place.unlink()


def _is_live(place: Path) -> bool:
    """Whether a resident listens there, busy or not."""
    with socket.socket(socket.AF_UNIX) as line:
        line.settimeout(PATIENCE)
        try:
            line.connect(str(place))
        except (BlockingIOError, TimeoutError):  # too many wait for it already
            return True
        except OSError:
            return False
    return True


def serve(listener: socket.socket, command: Callable[[], None], patience: float) -> None:
    """Runs a command for one client after another; ends when none comes for ``patience`` [s], or after a failure."""
    listener.settimeout(patience)
    signal.signal(INTERRUPT, signal.default_int_handler)
    going_on = True
    with contextlib.suppress(TimeoutError):
        while going_on:
            line, _ = listener.accept()
            with line, contextlib.suppress(OSError, ValueError, KeyError):  # a client that is gone, or asks nonsense
                going_on = not is_ours(line) or _answer(line, command)
            forget()


def forget() -> None:
    """Frees what a fit left in circles of references, also where ``collector_paused`` has frozen it."""
    gc.unfreeze()
    gc.collect()
    gc.freeze()


def _answer(line: socket.socket, command: Callable[[], None]) -> bool:
    """Runs a client's command; False: it has failed in a way that may leave this process unsound.

    Raises:
        OSError: the client is gone, or never asked.
        ValueError, KeyError: what it sent is no request.
        SystemExit: this process was terminated; the client, which gets no answer, does the work.
    """
    line.settimeout(PATIENCE)
    line.sendall(READY)
    length, streams, *_ = socket.recv_fds(line, LENGTH, 2)
    try:
        with line.makefile("rb") as sent:
            data = sent.read(int.from_bytes(length, "big"))
        if not data or len(data) < int.from_bytes(length, "big"):  # it had no patience, or was interrupted
            return True
        line.settimeout(None)
        with _standing_for(json.loads(data), streams):
            status = _run(line, command)
        if status == TERMINATED:
            sys.exit(status)
    finally:
        for stream in streams:
            os.close(stream)
    with contextlib.suppress(OSError):
        line.sendall(bytes([status & 0xFF]))
    return status != FAILED


def _run(line: socket.socket, command: Callable[[], None]) -> int:
    """The exit status of a command, which is interrupted where its client ends, or is interrupted, before it."""
    lock, running, own = threading.Lock(), True, threading.get_ident()

    def watch() -> None:
        with contextlib.suppress(OSError):
            line.recv(1)
        with lock:
            if running:
                signal.pthread_kill(own, INTERRUPT)

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    status = INTERRUPTED
    with contextlib.suppress(KeyboardInterrupt):  # as the command began or ended
        try:
            command()
        except SystemExit as ended:
            status = ended.code if isinstance(ended.code, int) else FAILED if ended.code else 0
        except Exception:
            traceback.print_exc()
            status = FAILED
        with lock:
            running = False
    running = False
    with contextlib.suppress(OSError):
        line.shutdown(socket.SHUT_RD)
    watcher.join()
    return status


@contextlib.contextmanager
def _standing_for(request: Mapping[str, Any], streams: list[int]) -> Iterator[None]:
    """Gives this process the folder, environment, arguments and output of a client's; its own again at the end."""
    own = os.getcwd(), dict(os.environ), sys.argv, sys.stdout, sys.stderr, sys.unraisablehook
    mask, kept = os.umask(request["mask"]), [os.dup(1), os.dup(2)]
    try:
        for stream, number in zip(streams, (1, 2), strict=True):
            os.dup2(stream, number)
        sys.stdout = open(1, "w", buffering=1, closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", buffering=1, errors="backslashreplace", closefd=False)  # noqa: SIM115
        os.chdir(request["folder"])
        os.environ.clear()
        os.environ.update(request["environment"])
        sys.argv = request["arguments"]
        with command_began(*request["began"]):
            yield
    finally:
        for text, stream, number in ((sys.stdout, kept[0], 1), (sys.stderr, kept[1], 2)):
            with contextlib.suppress(OSError, ValueError):
                text.flush()
            os.dup2(stream, number)
            os.close(stream)
        os.umask(mask)
        folder, environment, sys.argv, sys.stdout, sys.stderr, sys.unraisablehook = own
        os.environ.clear()
        os.environ.update(environment)
        with contextlib.suppress(OSError):  # its folder may be gone
            os.chdir(folder)
