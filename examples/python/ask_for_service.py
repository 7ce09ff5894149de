#!/usr/bin/env python3
"""A robot in a hundred lines: says that its battery runs low, and waits to be told where to dock.

    pip install eclipse-zenoh
    python examples/python/ask_for_service.py --id visitor-1 --station mds-1

A robot does not book a service. It tells the coordinator what its gauge says, how much it draws and
how far each station is; the coordinator plans, and sends a command when it is time to leave. This
one need not be configured: its battery model is one that comes with the coordinator. It ends when it
has accepted the command to dock, where a real robot would begin to drive.
"""

import argparse
import json
import queue
import sys
import time

import zenoh

from watch_schedule import session

PERIOD_S = 1.0
BATTERY = "explorer-3s1p-1320mah"


def estimate(value: float, sigma: float) -> dict:
    """A value and its standard deviation, as every uncertain number on the wire."""
    return {"value": value, "sigma": sigma}


def gauge(seq: int, now_ms: int, soc: float) -> dict:
    """What a fuel gauge says of a 14.6 Wh pack of three cells at that charge."""
    full_wh, power_w = 14.6, 4.3
    left_wh = soc * full_wh
    return {
        "schema": "tender.gauge/1",
        "at": now_ms,
        "seq": seq,
        "soc": estimate(soc, 0.01),
        "remaining_wh": estimate(left_wh, 0.15),
        "full_wh": estimate(full_wh, 0.15),
        "time_to_empty_s": estimate(left_wh / power_w * 3600, 120.0),
        "soh": estimate(1.0, 0.02),
        "voltage_v": 11.1,
        "current_a": power_w / 11.1,
        "temperature_degc": 25.0,
        "power_w": power_w,
        "cells_series": 3,
        "source": "python-example",
    }


def state(seq: int, now_ms: int, phase: str, station: str) -> dict:
    """Where the robot is in its work, and the way to the station."""
    message = {
        "schema": "tender.robot-state/1",
        "at": now_ms,
        "seq": seq,
        "phase": phase,
        "drain_w": estimate(4.3, 0.3),
        "travel": {station: {"time_s": 30.0, "energy_wh": estimate(0.05, 0.01)}},
        "mission": {"weight": 1.0},
        "battery": BATTERY,
    }
    if phase == "travelling":
        message["station"] = station
    return message


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--id", default="visitor-1")
    parser.add_argument("--site", default="site")
    parser.add_argument("--station", default="mds-1")
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447", metavar="ADDRESS")
    parser.add_argument("--soc", type=float, default=0.12, help="state of charge, 0 to 1")
    parser.add_argument("--patience", type=float, default=300.0, metavar="S")
    args = parser.parse_args()
    root = f"tender/{args.site}/v1/robot/{args.id}"
    commands: queue.SimpleQueue[dict] = queue.SimpleQueue()
    answers: dict[str, bytes] = {}

    def command(query: zenoh.Query) -> None:
        """Accepts every command once; the same id gets the same answer again."""
        asked = json.loads(query.payload.to_bytes())
        if asked["id"] not in answers:
            reply = {"schema": "tender.command-reply/1", "id": asked["id"], "at": int(time.time() * 1000), "outcome": "accepted"}
            answers[asked["id"]] = json.dumps(reply).encode()
            commands.put(asked)
        query.reply(query.key_expr, answers[asked["id"]])

    with session(args.connect) as link:
        # Both are held as long as the robot is there; the token says that it is.
        served = link.declare_queryable(f"{root}/command", command)
        alive = link.liveliness().declare_token(f"{root}/alive")
        begin, seq = time.monotonic(), 0
        while time.monotonic() - begin < args.patience:
            seq += 1
            now_ms = int(time.time() * 1000)
            link.put(f"{root}/gauge", json.dumps(gauge(seq, now_ms, args.soc)))
            link.put(f"{root}/state", json.dumps(state(seq, now_ms, "working", args.station)))
            try:
                asked = commands.get(timeout=PERIOD_S)
            except queue.Empty:
                continue
            action = asked["action"]
            print(f"{args.id} is told: {action['kind']} {json.dumps({k: v for k, v in action.items() if k != 'kind'})}")
            link.put(f"{root}/state", json.dumps(state(seq + 1, now_ms + 1, "travelling", args.station)))
            alive.undeclare()
            served.undeclare()
            return 0
        # Asked while the robot is still there: the coordinator tells of those that it hears.
        why = explained(link, args.site, args.id)
    print(f"{args.id} was not told anything within {args.patience:.0f} s: {why}", file=sys.stderr)
    return 1


def explained(link: zenoh.Session, site: str, robot: str) -> str:
    """Why the coordinator services a robot as it does."""
    for reply in link.get(f"tender/{site}/v1/coordinator/explain/{robot}", timeout=2.0):
        if reply.ok is not None:
            return "; ".join(json.loads(reply.ok.payload.to_bytes())["reasons"])
        return reply.err.payload.to_bytes().decode()
    return "no coordinator answers"


if __name__ == "__main__":
    sys.exit(main())
