#!/usr/bin/env python3
"""Least squares of resistances on the shipped Enertech discharges, independent of the Rust code.

Run from anywhere: python3 lab/tests/reference/ohmic_least_squares.py

The model is linear in its resistances, so no iteration is needed:

    V[k] = OCV(z[k]) - R(z[k]) I[k],   z[k] = 1 - sum_{i<=k} I[i] (t[i] - t[i-1]) / Q

A current holds over the interval that ends at its row. Rows without a voltage and the first row
(rest before the load) are left out; every other row weighs the same.
"""

import csv
import pathlib

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[3]
LOGS = ROOT / "scenarios/measured/enertech-lco-2280mah"
OCV = ROOT / "energy/params/enertech-lco-2280mah-ocv.csv"
CAPACITY_AH = 2.3351
KNOTS = np.array([0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0])


def load(name):
    with open(LOGS / name, newline="") as file:
        rows = list(csv.DictReader(file))
    time_s = np.array([float(row["time_s"]) for row in rows])
    current_a = np.array([float(row["current_a"]) for row in rows])
    voltage_v = np.array([float(row["voltage_v"] or "nan") for row in rows])
    drawn_ah = np.concatenate([[0.0], np.cumsum(current_a[1:] * np.diff(time_s))]) / 3600
    soc = 1.0 - drawn_ah / CAPACITY_AH
    used = ~np.isnan(voltage_v)
    used[0] = False
    return current_a[used], voltage_v[used], soc[used]


def ocv_v(soc):
    table = np.genfromtxt([line for line in open(OCV) if not line.startswith("#")], delimiter=",", skip_header=1)
    knots, volts = table.T
    low = np.clip(np.searchsorted(knots, soc, side="right") - 1, 0, len(knots) - 2)
    slope = (volts[low + 1] - volts[low]) / (knots[low + 1] - knots[low])
    return volts[low] + (soc - knots[low]) * slope


def hats(soc):
    """Weights of linear interpolation between KNOTS, held constant outside."""
    return np.stack([np.interp(soc, KNOTS, np.eye(len(KNOTS))[k]) for k in range(len(KNOTS))], axis=1)


def solve(title, columns):
    logs = {name: load(f"discharge-{name}.csv") for name in ("0p5c", "1c")}
    design = {name: columns(soc) * current_a[:, None] for name, (current_a, _, soc) in logs.items()}
    drop = {name: ocv_v(soc) - voltage_v for name, (_, voltage_v, soc) in logs.items()}
    answer, *_ = np.linalg.lstsq(np.vstack(list(design.values())), np.concatenate(list(drop.values())), rcond=None)
    print(title, "ohm:", ", ".join(f"{value:.6f}" for value in answer))
    for name in logs:
        before = np.sqrt(np.mean(drop[name] ** 2)) * 1e3
        residual = drop[name] - design[name] @ answer
        print(f"  {name}: rows {len(residual)}, RMS without resistance {before:.3f} mV, with {np.sqrt(np.mean(residual**2)) * 1e3:.3f} mV")


solve("ohmic", lambda soc: np.ones((len(soc), 1)))
solve("ohmic_soc", hats)
