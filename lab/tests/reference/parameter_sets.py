#!/usr/bin/env python3
"""Makes the OCV tables of the fitted parameter sets, and an independent least-squares check of them.

    python3 parameter_sets.py DATA [--tables DIRECTORY] [--logs DIRECTORY] [SET ...]

DATA holds the measured logs, one folder per set. For each set, OCV at the knots and the linear
parameters (R0 or R over SoC, RC resistances, hysteresis) are solved together by numpy least squares
on the rows of all its fit logs; time constants, Arrhenius temperature and the like are searched on
a grid. Residual RMS is printed stage by stage, each stage with one more effect, and for logs that
were kept out. With --tables the OCV of the last stage is written as `soc,voltage_v`; with --logs every
log is written under our names and signs, its facts beside it, voltages below the least SoC that
counts left out: what `lab fit` was given.

The program under test (`lab fit`) then gets the table and finds the other parameters by itself.
Charge is integrated with the current of a row over the interval that ends there. Needs numpy only.
"""

import argparse
import itertools
import pathlib

import numpy as np

LFP_OFFSET_A = 0.0078
R_KNOTS = np.array([0.0, 0.05, 0.1, 0.2, 0.4, 0.7, 1.0])
FINE = np.unique(np.concatenate([[0.0, 0.0025, 0.005, 0.0075], np.arange(1, 10) / 100, np.arange(5, 45) / 50, np.arange(90, 101) / 100]))


def hat(x, knots, extend=False):
    """Linear interpolation as a matrix; outside the knots held, or continued."""
    if not extend:
        x = np.clip(x, knots[0], knots[-1])
    low = np.clip(np.searchsorted(knots, x, side="right") - 1, 0, len(knots) - 2)
    share = (x - knots[low]) / (knots[low + 1] - knots[low])
    matrix = np.zeros((len(x), len(knots)))
    rows = np.arange(len(x))
    matrix[rows, low] = 1 - share
    matrix[rows, low + 1] += share
    return matrix


class Log:
    def __init__(self, path, capacity_ah, soc, current_offset_a=0.0, degc=25.0):
        data = np.genfromtxt(path, delimiter=",", names=True)
        self.time_s, self.ambient_degc, self.soc_initial = data["time_s"], degc, soc
        self.name = path.stem
        self.current_a = data["current_a"] + current_offset_a
        self.voltage_v = data["voltage_v"]
        column = next((name for name in ("temperature_c", "temperature_degc") if name in data.dtype.names), None)
        self.degc = data[column] if column else np.full(len(data), degc)
        self.ambient = data["ambient_c"] if "ambient_c" in data.dtype.names else np.full(len(data), degc)
        self.measured_degc = column is not None
        self.dt_s = np.diff(data["time_s"], prepend=data["time_s"][0])
        self.soc = soc - np.cumsum(self.current_a * self.dt_s) / 3600 / capacity_ah
        self.used = np.isfinite(self.voltage_v) & (np.arange(len(data)) > 0)
        self.capacity_ah = capacity_ah

    def write(self, folder, above):
        folder.mkdir(parents=True, exist_ok=True)
        rows = ["time_s,current_a,voltage_v,ambient_degc" + (",temperature_degc" if self.measured_degc else "")]
        for row in range(len(self.soc)):
            voltage = f"{self.voltage_v[row]:.5f}" if self.used[row] and self.soc[row] >= above else ""
            text = f"{self.time_s[row]:.3f},{self.current_a[row]:.5f},{voltage},{self.ambient[row]:.3f}"
            rows.append(text + (f",{self.degc[row]:.3f}" if self.measured_degc else ""))
        (folder / f"{self.name}.csv").write_text("\n".join(rows) + "\n")
        (folder / f"{self.name}.toml").write_text(f"schema = 1\nsoc_initial = {self.soc_initial}\n")

    def relaxed(self, target, keep):
        """Follows `target`, keeping the share `keep` of the distance in each step."""
        answer, state = np.empty(len(target)), 0.0
        for row in range(len(target)):
            state = target[row] + (state - target[row]) * keep[row]
            answer[row] = state
        return answer

    def hysteresis_state(self, gamma):
        answer, state = np.empty(len(self.current_a)), 0.0  # as a run of ours begins
        moved = np.abs(self.current_a) * self.dt_s / 3600 / self.capacity_ah
        for row, keep in enumerate(np.exp(-gamma * moved)):
            state = state * keep - (1 - keep) * np.sign(self.current_a[row])
            answer[row] = state
        return answer

    def columns(self, stage):
        """Columns of OCV and of each parameter that the stage names."""
        kelvin = self.degc + 273.15
        factor = np.exp(stage.get("arrhenius_k", 0.0) * (1 / kelvin - 1 / 298.15))
        matrices = [hat(self.soc, stage["knots"], extend=True)]
        series_a = (self.current_a * factor)[:, None]
        if stage.get("r") == "soc":
            matrices.append(-hat(self.soc, R_KNOTS) * series_a)
        elif stage.get("r") == "constant":
            matrices.append(-series_a)
        for tau_s in stage.get("tau_s", ()):
            matrices.append(-self.relaxed(self.current_a, np.exp(-self.dt_s / tau_s))[:, None])
        if "gamma" in stage:
            state = self.hysteresis_state(stage["gamma"])[:, None]
            matrices.append(hat(self.soc, R_KNOTS) * state if stage.get("m") == "soc" else state)
        return np.hstack(matrices)


def rms_mv(residual):
    return 1e3 * float(np.sqrt(np.mean(np.square(residual))))


def solve(stage, logs, above=-1.0):
    fixed_ohm = stage.get("fixed_ohm", 0.0)
    parts = [(log.columns(stage), log.voltage_v + fixed_ohm * log.current_a, log.used & (log.soc >= above)) for log in logs]
    matrix = np.vstack([columns[used] for columns, _, used in parts])
    volts = np.concatenate([target[used] for _, target, used in parts])
    answer = np.linalg.lstsq(matrix, volts, rcond=None)[0]
    return answer, rms_mv(volts - matrix @ answer), [rms_mv(t[used] - c[used] @ answer) for c, t, used in parts]


def search(stage, logs, above):
    """The best of the grid over every entry of the stage that is a list."""
    listed = {name: values for name, values in stage.items() if isinstance(values, list)}
    tried = [{**stage, **dict(zip(listed, values))} for values in itertools.product(*listed.values())]
    return min(tried, key=lambda stage: solve(stage, logs, above)[1])


def sets(data):
    """Name, fit logs, kept-out logs, stages, least SoC that counts, provenance."""
    folder = pathlib.Path(__file__).resolve().parents[3] / "scenarios/measured/enertech-lco-2280mah"
    enertech = [Log(folder / f"discharge-{rate}.csv", 2.3351, 1.0) for rate in ("0p1c", "0p5c", "1c")]
    yield (
        "enertech-lco-2280mah-full",
        enertech,
        [],
        [{}, {"r": "constant"}, {"r": "soc"}, {"r": "soc", "tau_s": [(t,) for t in (20, 50, 100, 200, 400)]}],
        -1.0,
        ["Open-circuit voltage of one Enertech LiCoO2/graphite pouch cell (2.28 Ah) at 25 degC, from its measured",
         "0.1C, 0.5C and 1C discharges (shipped in scenarios/measured/enertech-lco-2280mah, BSD-3-Clause): Rieger 2016,",
         "used by Ai et al. 2020, doi 10.1149/2.0122001JES. soc = 1 - charge drawn / 2.3351 Ah."],
    )

    folder = data / "a123_lfp_26650_2p3ah_plett"
    # The dynamic log is of 1 s samples of a faster profile: its current column misses 23 mAh that the
    # cycler's own counters have, and at its end the cell is empty (1.9 V) with 2 % unaccounted for.
    slow = [Log(folder / "ocv_p25_s1.csv", 2.0617, 1.0), Log(folder / "ocv_p25_s3.csv", 2.0617, 0.0)]
    dynamic = [Log(folder / "dyn_p25_s1.csv", 2.0617, 1.0, LFP_OFFSET_A)]
    # C/30 both ways cannot tell R0 from hysteresis: R0 comes from the dynamic log.
    yield (
        "a123-lfp-26650-2p3ah",
        slow,
        dynamic,
        [{}, {"fixed_ohm": 0.012}, {"fixed_ohm": 0.012, "gamma": [20.0, 50.0, 100.0]}, {"fixed_ohm": 0.012, "gamma": [20.0, 50.0, 100.0], "m": "soc"}],
        0.02,
        ["Open-circuit voltage of one A123 26650 LiFePO4 cell at 25 degC: middle between its measured C/30 discharge",
         "and C/30 charge. G. Plett, logs p25 s1 and s3 of github batterysim/esctoolbox-python (MIT).",
         "soc 0..1 = 2.0617 Ah, the mean of what the two logs moved between 2.0 V and 3.6 V."],
    )

    folder = data / "samsung_inr18650_30q_3ah"
    rates = [Log(folder / f"discharge_s001_{rate}.csv", 2.9696, 1.0) for rate in ("c10", "1c", "2c", "3c", "4c")]
    pulses = [Log(folder / f"hppc_dnn01_1c_{degc}c.csv", 2.9696, 1.0, degc=degc) for degc in (20, 40)]
    kelvins = [float(k) for k in range(0, 3001, 500)]
    yield (
        "samsung-inr18650-30q-3ah",
        rates,
        pulses,
        [{}, {"r": "constant"}, {"r": "soc"}, {"r": "soc", "arrhenius_k": kelvins},
         {"r": "soc", "arrhenius_k": kelvins, "tau_s": [(t,) for t in (30, 60, 120)]}],
        -1.0,
        ["Open-circuit voltage of one Samsung INR18650-30Q cell (NCA/graphite, 3 Ah), from the measured discharges of specimen s001",
         "at C/10 and 1C-4C: ARTS-Laboratory, dataset-electrothermal-deformation-characterization-for-samsung-30Q-cell",
         "(CC BY-SA 4.0; derived numbers, with this attribution). soc = 1 - charge drawn / 2.9696 Ah, drawn at C/10 to 2.5 V."],
    )

    folder = data / "melasta_lipo_hv_pouch_3p7ah"
    yield (
        "melasta-lipo-3p7ah",
        [Log(folder / "hppc_25c_90kpa.csv", 3.828, 0.28433)],
        [],
        [{}, {"r": "constant"}, {"r": "constant", "tau_s": [(10,), (50,), (200,)]}, {"r": "soc", "tau_s": [(a, b) for a in (6, 10, 16) for b in (100, 200, 300, 400)]}],
        0.02,
        ["Open-circuit voltage of one Melasta high-voltage LiPo pouch cell (3.7 Ah, 4.35 V) at 25 degC and 90 kPa, from its measured",
         "C/2 cycle and HPPC test: github katielukow/PressureFitted_ECM (MIT).",
         "soc 0..1 = 3.828 Ah, the mean of a C/2 discharge to 3.0 V and the charge to 4.35 V after it."],
    )

    folder = data / "nissan_leaf_pouch_33ah"
    yield (
        "nissan-leaf-33ah",
        [Log(folder / "hppc_25c.csv", 30.508, 0.01315)],
        [Log(folder / "discharge_1c.csv", 30.508, 0.008), Log(folder / "discharge_2c.csv", 30.508, 1.0)],
        [{}, {"r": "constant"}, {"r": "constant", "tau_s": [(50,), (100,), (200,)]}, {"r": "soc", "tau_s": [(a, b) for a in (30, 50, 70) for b in (600, 1200, 1900)]}],
        0.02,
        ["Open-circuit voltage of one Nissan Leaf laminate cell (LMO/LNO, 33 Ah) at 25 degC, from its measured HPPC test:",
         "github batterysim/nissan-leaf-data (MIT), doi 10.5281/zenodo.2580327.",
         "soc 0..1 = 30.508 Ah, between 3.0 V at 10 A and 4.2 V."],
    )


def thin(soc, voltage_v, tolerance_v=4e-4):
    """Leaves out knots that a straight line between their neighbours replaces within the tolerance."""
    kept = list(range(len(soc)))
    while True:
        costs = []
        for place in range(1, len(kept) - 1):
            inner = slice(kept[place - 1], kept[place + 1] + 1)
            ends = [kept[place - 1], kept[place + 1]]
            costs.append(np.max(np.abs(np.interp(soc[inner], soc[ends], voltage_v[ends]) - voltage_v[inner])))
        if not costs or min(costs) > tolerance_v:
            return soc[kept], voltage_v[kept]
        del kept[1 + int(np.argmin(costs))]


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("sets", nargs="*")
    arguments.add_argument("--tables", type=pathlib.Path)
    arguments.add_argument("--logs", type=pathlib.Path)
    arguments = arguments.parse_args()
    for name, logs, kept_out, stages, above, provenance in sets(arguments.data):
        if arguments.sets and name not in arguments.sets:
            continue
        print(f"{name}: fit on {', '.join(log.name for log in logs)}; rows from SoC {max(above, 0):g} up")
        for stage in stages:
            stage = search({"knots": FINE, **stage}, logs, above)
            answer, rms, by_log = solve(stage, logs, above)
            words = ", ".join(f"{key} {value}" for key, value in stage.items() if key != "knots") or "OCV"
            print(f"  {rms:7.2f} mV  {words}; by log {', '.join(f'{x:.1f}' for x in by_log)}")
            print(f"             {np.array2string(answer[len(FINE):], precision=5, max_line_width=150)}")
        for log in kept_out:
            used = log.used & (log.soc >= 0.1)
            residual = log.voltage_v + stage.get("fixed_ohm", 0.0) * log.current_a - log.columns(stage) @ answer
            print(f"  {rms_mv(residual[used]):7.2f} mV  kept out: {log.name}, SoC above 0.1")
        for log in logs + kept_out if arguments.logs else []:
            log.write(arguments.logs / name, above)
        if arguments.tables:
            # OCV of all rows, for the part below `above` too; our hysteresis has one M over SoC.
            stage = search({"knots": FINE, **[stage for stage in stages if "m" not in stage][-1]}, logs, above)
            rms, answer = solve(stage, logs, above)[1], solve(stage, logs)[0]
            soc, voltage_v = thin(FINE, np.maximum.accumulate(answer[: len(FINE)]))
            rows = "".join(f"{s:.4g},{v:.5f}\n" for s, v in zip(soc, voltage_v))
            notes = [*provenance, "Solved by least squares together with the cell's resistances (lab/tests/reference/parameter_sets.py, 2026-11-21),",
                     f"residual {rms:.1f} mV RMS, thinned to {len(soc)} points within 0.4 mV."]
            path = arguments.tables / f"{name}-ocv.csv"
            path.write_text("".join(f"# {line}\n" for line in notes) + "soc,voltage_v\n" + rows)
            print(f"  written to {path}")


if __name__ == "__main__":
    main()
