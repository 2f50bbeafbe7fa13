"""Print what happened in a flight: read_flight.py FOLDER, or read_flight.py FILE.mcap..."""

import argparse
import math

import dfvs


def main() -> None:
    """Print verdict, states, distance to the goal second by second, and the number of views."""
    parser = argparse.ArgumentParser(description="Read a black box or a recording.")
    parser.add_argument("flight", nargs="+", help="folder of a black box, or MCAP files")
    arguments = parser.parse_args()
    try:
        source = dfvs.open_flight(*arguments.flight)
        flight = source.read()
    except dfvs.DfvsError as error:
        parser.error(str(error))

    print(f"{flight.summary.vehicle}, {flight.summary.started}: {flight.summary.verdict}")
    for change in flight.summary.states:
        print(f"{change.t_s:6.1f} s  {change.state}  {change.cause}")
    next_s = 0.0
    for t_s, error_m in flight.series.error_m:
        if t_s >= next_s and math.isfinite(error_m):
            print(f"{t_s:6.1f} s  {error_m:.2f} m from the goal")
            next_s = t_s + 1.0
    views = list(source.views())
    print(f"{len(views)} views, {sum(view.flow is not None for view in views)} with flow")


if __name__ == "__main__":
    main()
