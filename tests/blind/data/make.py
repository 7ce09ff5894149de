#!/usr/bin/env python3
"""Logs of electrochemical cells, made once: truths of quite another kind than the catalogue's.

Single-particle models with electrolyte and a lumped temperature (PyBaMM, BSD-3-Clause), two published
parameter sets. Each cell gives an OCV table from the same set, and six logs without noise: four to
train on, two held out. The benchmark adds a gauge's noise when it reads them.

    pip install pybamm && python make.py
"""

import numpy as np
import pybamm

DT_S = 10
# name, parameter set, ambient temperature of a log, °C
CELLS = {"chen2020": "Chen2020", "ai2020": "Ai2020"}
WARM, COLD, MILD = 25.0, 8.0, 16.0


def drive(seed, seconds, mean, swing):
    """Steps of 10 to 90 s about a mean rate; one in eight brakes."""
    random = np.random.default_rng(seed)
    rates = []
    while len(rates) * DT_S < seconds:
        rate = mean + swing * random.uniform(-1, 1)
        if random.random() < 0.125:
            rate = -0.4 * mean
        rates += [rate] * random.integers(1, 10)
    return rates[: seconds // DT_S]


def hold(rate, seconds):
    return [rate] * (seconds // DT_S)


def pulses(rates, seconds, rest):
    return [rate for r in rates for rate in hold(r, seconds) + hold(0, rest)]


# name, start SoC, ambient, rates in 1/h (discharge positive)
LOGS = [
    ("train-1", 0.95, WARM, hold(0, 60) + pulses([0.5, 1, -0.5, 1, 0.3], 400, 200) + hold(0, 3700) + pulses([1, 0.7], 300, 300)),
    ("train-2", 0.9, COLD, hold(0, 60) + drive(1, 4200, 0.4, 0.5) + hold(0, 3600)),
    ("train-3", 0.2, WARM, hold(0, 60) + hold(-0.5, 4500) + hold(0, 1800) + hold(0.8, 1200)),
    ("train-4", 0.55, COLD, hold(0, 60) + pulses([0.5, 0.7, -0.4, 0.5], 400, 300) + hold(0, 3600) + hold(-0.3, 900)),
    ("holdout-1", 0.85, MILD, hold(0, 60) + drive(2, 4200, 0.4, 0.5) + hold(0, 1800)),
    ("holdout-2", 0.35, WARM, hold(0, 60) + hold(-0.4, 2400) + hold(0, 1200) + pulses([0.8, 0.4], 500, 400)),
]


def capacity_and_ocv(values):
    x_0, x_100, y_100, y_0 = pybamm.lithium_ion.get_min_max_stoichiometries(values)
    param = pybamm.LithiumIonParameters()
    soc = np.concatenate([[0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.075], np.linspace(0.1, 1, 73)])
    reference = values["Reference temperature [K]"]
    symbol = lambda electrode, sto: values.evaluate(electrode.prim.U(pybamm.Scalar(sto), pybamm.Scalar(reference)))
    ocv = [np.squeeze(symbol(param.p, y_0 + z * (y_100 - y_0)) - symbol(param.n, x_0 + z * (x_100 - x_0))) for z in soc]
    capacity = float(np.squeeze(values.evaluate(param.n.Q_init))) * (x_100 - x_0)
    return capacity, soc, np.array(ocv, dtype=float)


def write(path, header, rows):
    with open(path, "w", encoding="utf-8") as file:
        file.write(header + "\n")
        file.writelines(",".join(row) + "\n" for row in rows)


def main():
    for cell, name in CELLS.items():
        values = pybamm.ParameterValues(name)
        capacity, soc, ocv = capacity_and_ocv(values)
        write(f"{cell}-ocv.csv", "soc,voltage_v", [(f"{z:.4f}", f"{v:.5f}") for z, v in zip(soc, ocv)])
        print(cell, f"capacity {capacity:.4f} Ah, OCV {ocv[0]:.3f} to {ocv[-1]:.3f} V")
        for log, start, ambient, rates in LOGS:
            current = np.array(rates) * capacity
            time = np.arange(len(current) + 1) * float(DT_S)
            own = pybamm.ParameterValues(name)
            own["Ambient temperature [K]"] = own["Initial temperature [K]"] = ambient + 273.15
            # A step over a tenth of a second at the start of each interval: solvers dislike jumps.
            knots = np.concatenate([[0.0]] + [[t + 0.1, t + DT_S] for t in time[:-1]])
            steps = np.concatenate([[current[0]]] + [[i, i] for i in current])
            own["Current function [A]"] = pybamm.Interpolant(knots, steps, pybamm.t)
            model = pybamm.lithium_ion.SPMe({"thermal": "lumped"})
            simulation = pybamm.Simulation(model, parameter_values=own, solver=pybamm.IDAKLUSolver(atol=1e-6, rtol=1e-6))
            solution = simulation.solve(time, initial_soc=start)
            volts = solution["Voltage [V]"](time)
            kelvin = solution["Volume-averaged cell temperature [K]"](time)
            rows = [
                (f"{t:.0f}", f"{i:.4f}", f"{v:.5f}", f"{k - 273.15:.3f}")
                for t, i, v, k in zip(time, np.concatenate([[0.0], current]), volts, kelvin)
            ]
            write(f"{cell}-{log}.csv", "time_s,current_a,voltage_v,temperature_degc", rows)
            print(" ", log, len(rows), f"{volts.min():.3f} to {volts.max():.3f} V, {kelvin.min() - 273.15:.1f} to {kelvin.max() - 273.15:.1f} degC")


main()
