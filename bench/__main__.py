"""``python -m bench [-m] [experiment=NAME] [key=value ...]``: run an experiment, print its table, write its report.

Exit status 0: at least one row is ok; 1: none is, and one line on stderr says why; 2: bad input, one line.
"""

import sys

from bench.mergers.servers import Preload, find_server


def main() -> None:
    """Run the command line."""
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
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(0)


if __name__ == "__main__":
    main()
