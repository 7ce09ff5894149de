#!/usr/bin/env python3
"""Follows the schedule of a running coordinator, from Python.

    pip install eclipse-zenoh
    python examples/python/watch_schedule.py --site site --connect tcp/127.0.0.1:7447

Prints the schedule as it stands and each new one. `--count N` ends after N of them.
The messages are described in proto/WIRE.md; an example of each lies in proto/golden/.
"""

import argparse
import datetime
import json
import queue
import sys

import zenoh


def session(connect: str) -> zenoh.Session:
    """A client session that asks nobody on the network but the coordinator or router."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([connect]))
    config.insert_json5("scouting/multicast/enabled", "false")
    try:
        return zenoh.open(config)
    except zenoh.ZError:
        sys.exit(f"nobody listens at {connect}: is a coordinator or a router running there?")


def clock(unix_ms: int) -> str:
    return datetime.datetime.fromtimestamp(unix_ms / 1000, datetime.timezone.utc).strftime("%H:%M")


def show(schedule: dict) -> None:
    print(f"plan {schedule['plan']} of {clock(schedule['at'])} UTC by {schedule['policy']}")
    for service in schedule["services"]:
        energy = service["pack_energy_wh"]
        place = f"{service['station']} {service.get('bay', '')}".strip()
        print(
            f"  {service['robot']:<12} {service['status']:<10} {service['mode']:<8} {place}, "
            f"{clock(service['start'])} to {clock(service['end'])}, {energy['value']:.1f} ± {energy['sigma']:.1f} Wh"
        )
    for left in schedule["unserved"]:
        print(f"  {left['robot']:<12} left out: {'; '.join(left['reasons'])}")
    sys.stdout.flush()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--site", default="site")
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447", metavar="ADDRESS")
    parser.add_argument("--count", type=int, default=0, metavar="N", help="end after so many schedules")
    args = parser.parse_args()
    key = f"tender/{args.site}/v1/coordinator/schedule"
    schedules: queue.SimpleQueue[dict] = queue.SimpleQueue()
    with session(args.connect) as link:
        # Held as long as it is to be called.
        subscriber = link.declare_subscriber(key, lambda sample: schedules.put(json.loads(sample.payload.to_bytes())))
        # The one in force comes as an answer, later ones by themselves.
        for reply in link.get(key, timeout=5.0):
            if reply.ok is not None:
                schedules.put(json.loads(reply.ok.payload.to_bytes()))
        shown = 0
        while args.count == 0 or shown < args.count:
            show(schedules.get())
            shown += 1
        subscriber.undeclare()
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(0)
