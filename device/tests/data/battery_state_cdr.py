"""Writes the CDR messages beside this file with `rosbags` (pip install rosbags), which shares no code
with the agent: sensor_msgs/msg/BatteryState as a ROS 2 node puts it on the wire, header included.

* discharging.cdr: everything measured; ROS counts the current negative.
* charging-big-endian.cdr: the same type in big endian, without a stamp.
* voltage-only.cdr: NaN in everything that need not be measured.

Run with an argument, it prints the hash of the type instead (REP 2011), as rmw_zenoh puts it into keys.
"""

import math
import sys
from pathlib import Path

import numpy as np
from rosbags.typesys import Stores, get_typestore

HERE = Path(__file__).parent
STORE = get_typestore(Stores.ROS2_JAZZY)
BATTERY = "sensor_msgs/msg/BatteryState"
NAN = math.nan


def message(second: float = 0.0, **changes):
    types = STORE.types
    stamp = types["builtin_interfaces/msg/Time"](sec=int(second), nanosec=int(second % 1 * 1e9))
    fields = {
        "header": types["std_msgs/msg/Header"](stamp=stamp, frame_id="base_link"),
        "voltage": NAN,
        "temperature": NAN,
        "current": NAN,
        "charge": NAN,
        "capacity": NAN,
        "design_capacity": NAN,
        "percentage": NAN,
        "power_supply_status": 0,
        "power_supply_health": 0,
        "power_supply_technology": 0,
        "present": True,
        "cell_voltage": np.array([], dtype=np.float32),
        "cell_temperature": np.array([], dtype=np.float32),
        "location": "",
        "serial_number": "",
    }
    return types[BATTERY](**(fields | changes))


def cdr(second: float = 0.0, little_endian: bool = True, **changes) -> bytes:
    return bytes(STORE.serialize_cdr(message(second, **changes), BATTERY, little_endian=little_endian))


def main() -> None:
    if len(sys.argv) > 1:
        print(STORE.hash_rihs01(BATTERY))
        return
    full = {
        "voltage": 24.6,
        "temperature": 31.5,
        "current": -3.2,
        "charge": 25.0,
        "capacity": 40.0,
        "design_capacity": 42.0,
        "percentage": 0.625,
        "power_supply_status": 2,
        "power_supply_health": 1,
        "power_supply_technology": 3,
        "cell_voltage": np.array([4.1] * 6, dtype=np.float32),
        "cell_temperature": np.array([31.5, 31.0], dtype=np.float32),
        "location": "slot 1",
        "serial_number": "B-0042",
    }
    (HERE / "discharging.cdr").write_bytes(cdr(1_767_225_600.25, **full))
    charging = full | {"current": 1.5, "power_supply_status": 1}
    (HERE / "charging-big-endian.cdr").write_bytes(cdr(little_endian=False, **charging))
    (HERE / "voltage-only.cdr").write_bytes(cdr(voltage=12.1))


if __name__ == "__main__":
    main()
