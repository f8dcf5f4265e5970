"""``python -m bench [-m] [experiment=NAME] [key=value ...]``: run an experiment, print its table, write its report.

Exit status 0: at least one row is ok; 1: none is, and one line on stderr says why; 2: bad input, one line; 130: stopped
by Ctrl-C, at once: what is finished is kept, and the same command goes on from there.
"""

import contextlib
import os
import signal
import sys

from bench.mergers.servers import Preload, find_server


def main() -> None:
    """Run the command line."""
    before = signal.signal(signal.SIGINT, _stop)
    try:
        find_server(Preload.METHODS)  # it imports what calls need while this program imports the rest
        from bench.command import run_command  # noqa: PLC0415  # large: the server starts first

        answer = run_command(sys.argv[1:])
        if answer.text:
            print(answer.text)
        if answer.fault:
            print(f"bench: {answer.fault}", file=sys.stderr)
            sys.exit(1)
    except (ValueError, OSError) as error:
        print(f"bench: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)
    finally:
        signal.signal(signal.SIGINT, before)
    sys.exit(0)


def _stop(*_: object) -> None:
    """End without waiting for the methods that run, as a kill would: the servers end them and clean up."""
    with contextlib.suppress(OSError):
        os.write(2, b"\nbench: stopped; what is finished is kept, the same command goes on from there\n")
    os._exit(130)


if __name__ == "__main__":
    main()
