"""Writes the MCAP logs beside this file, with `rosbags` (pip install rosbags), which shares no
code with the lab. They hold sensor_msgs/msg/BatteryState in ROS 2 CDR, as robots record it:

* battery.mcap: 120 s of a 3s pack, one message a second, zstd chunks. ROS counts the current
  negative while discharging; some temperatures are NaN (not measured). A second topic holds text.
* two-batteries.mcap: two battery topics, so that one has to be chosen.
* split/: battery.mcap in two files, as a recorder splits them, the second with its topics numbered
  the other way round.

The numbers are simple functions of the second, which the tests repeat.
"""

import math
import shutil
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

HERE = Path(__file__).parent
STORE = get_typestore(Stores.ROS2_HUMBLE)
BATTERY = "sensor_msgs/msg/BatteryState"
TEXT = "std_msgs/msg/String"
BEGIN_NS = 1_767_225_600_000_000_000  # 2026-01-01T00:00:00Z


def message(second: int):
    """The pack `second` seconds after the beginning: 1 A out, and 2 A from second 60 on."""
    types = STORE.types
    current = -1.0 if second < 60 else -2.0
    voltage = 12.0 - 0.005 * second
    stamp = types["builtin_interfaces/msg/Time"](sec=BEGIN_NS // 10**9 + second, nanosec=0)
    return types[BATTERY](
        header=types["std_msgs/msg/Header"](stamp=stamp, frame_id="base_link"),
        voltage=voltage,
        temperature=math.nan if second % 10 else 25.0,
        current=current,
        charge=math.nan,
        capacity=math.nan,
        design_capacity=1.32,
        percentage=0.9 - 0.001 * second,
        power_supply_status=2,
        power_supply_health=1,
        power_supply_technology=2,
        present=True,
        cell_voltage=np.array([voltage / 3] * 3, dtype=np.float32),
        cell_temperature=np.array([], dtype=np.float32),
        location="bay",
        serial_number="E-1",
    )


def write(name: str, topics: list[str], seconds: range, text_first: bool = False) -> None:
    folder = HERE / "bag.tmp"
    shutil.rmtree(folder, ignore_errors=True)
    bag = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
    bag.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with bag as writer:
        if text_first:
            text = writer.add_connection("/rosout", TEXT, typestore=STORE)
        batteries = [writer.add_connection(topic, BATTERY, typestore=STORE) for topic in topics]
        if not text_first:
            text = writer.add_connection("/rosout", TEXT, typestore=STORE)
        for second in seconds:
            at = BEGIN_NS + second * 10**9 + 7_000_000
            for battery in batteries:
                writer.write(battery, at, STORE.serialize_cdr(message(second), BATTERY))
            if second % 30 == 0:
                hello = STORE.types[TEXT](data=f"second {second}")
                writer.write(text, at, STORE.serialize_cdr(hello, TEXT))
    (made,) = folder.glob("*.mcap")
    made.replace(HERE / f"{name}.mcap")
    shutil.rmtree(folder)


write("battery", ["/battery_state"], range(121))
write("two-batteries", ["/front/battery", "/rear/battery"], range(5))
(HERE / "split").mkdir(exist_ok=True)
write("split/run_0", ["/battery_state"], range(60))
write("split/run_1", ["/battery_state"], range(60, 121), text_first=True)
