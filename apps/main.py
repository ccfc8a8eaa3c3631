"""The entry point: exit codes, one sentence for every user error, immediate Ctrl-C."""

import io
import os
import signal
import sys
import threading
from contextlib import suppress

from ..tools.visible import visible

INTERRUPTED = 130
WINDING_UP = 0.2
"""Seconds to wait for each tool's thread to end before exiting without it."""


def main() -> None:
    """Run the command line and exit."""
    # asyncio turns Python's own handler into a cancellation, so a run ends with messages stored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = _run()
    except KeyboardInterrupt:
        print("formup: interrupted; nothing more is done.", file=sys.stderr)  # noqa: T201
        code = INTERRUPTED
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # too late to interrupt: the work is done
    _leave(code)


def _leave(code: int) -> None:
    """Exit, skipping teardown while the native code of a tool that was given up still runs."""
    from ..tools.tool import THREAD

    tools = [thread for thread in threading.enumerate() if thread.name == THREAD]
    for thread in tools:
        thread.join(WINDING_UP)
    if not any(thread.is_alive() for thread in tools):
        sys.exit(code)
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _say_broken(error: Exception) -> int:
    """Say what to do about a broken installation, using the standard library alone.

    Returns:
        The exit code.
    """
    from . import doctor

    if sys.argv[1:2] == ["doctor"]:
        print(visible(doctor.findings_text(as_json="--json" in sys.argv)))  # noqa: T201
        return 0
    advice = "formup doctor shows what is broken; reinstall that."
    print(f"formup: {visible(str(error))}; {advice}", file=sys.stderr)  # noqa: T201
    return 2


def _run() -> int:
    try:
        import typer

        from ..prompts import PromptError
        from ..tools.errors import FleetError, FormupError, ModelError
        from .cli import app
        from .run_display import say_failed
    except Exception as error:  # a broken library may raise anything when imported
        sys.exit(_say_broken(error))
    try:
        code = app(standalone_mode=False) or 0
        if code == INTERRUPTED:  # typer turns Ctrl-C into an exit code
            raise KeyboardInterrupt
        return code
    except typer.TyperException as error:
        say_failed(f"{error.format_message()} (see --help)")
        return 2
    except typer.Abort:
        raise KeyboardInterrupt from None
    except (FormupError, PromptError) as error:
        say_failed(str(error))
        return 4 if isinstance(error, (ModelError, FleetError)) else 2
    except ImportError as error:  # of a module imported only where it is needed
        return _say_broken(error)
    except BrokenPipeError:
        sys.stderr.close()  # the reader has gone, so an error would reach nobody
        return 0
    except OSError as error:
        say_failed(f"{error.strerror or error} ({error.filename or 'output'}).")
        return 2
