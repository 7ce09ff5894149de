#!/usr/bin/env python3
"""Plans many random instances by `coordinator plan` and has every plan judged by an independent checker.

  schedules.py --tools DIR --program COORDINATOR [--count 1000] [--budget-ms 50] [--seed 1]

DIR holds gen.py (makes an instance), check.py (judges a plan). Needs only the standard library.
Sizes run from nothing to a few hundred robots; every fifth instance is bent: no robots, no bays, all robots
empty, all equal, no spares, no packs, or a hotel load that the packs cannot feed. For the last two no plan
exists: the program must say so and exit with 1. Exit status 0 when every answer was right.
"""
import argparse, json, os, random, subprocess, sys, tempfile

ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
ap.add_argument("--tools", required=True)
ap.add_argument("--program", required=True)
ap.add_argument("--count", type=int, default=1000)
ap.add_argument("--budget-ms", type=int, default=50)
ap.add_argument("--seed", type=int, default=1)
a = ap.parse_args()
sys.path.insert(0, a.tools)
import check  # noqa: E402


def bend(inst, how):
    """Makes a degenerate instance; returns whether a plan can exist."""
    if how == "no robots":
        inst["robots"] = []
    elif how == "no bays":
        for s in inst["stations"]:
            s["bays"], s["ongoing"] = 0, []
    elif how == "all empty":
        for r in inst["robots"]:
            r["energy"] = inst["battery"]["floor"]
    elif how == "all equal":
        inst["robots"] = [dict(inst["robots"][0], id=r["id"]) for r in inst["robots"]]
    elif how == "no spares":
        for s in inst["stations"]:
            s["spares"] = []
    elif how == "no packs":
        inst["stations"][0]["packs"] = []
        return False
    elif how == "hungry":
        s = inst["stations"][-1]
        s["hotel"] = 1 + sum(p["remaining"] - p["reserve"] for p in s["packs"]) // inst["horizon"] + 1
        s["p_max"] += s["hotel"]
        return False
    return True


R = random.Random(a.seed)
ways = ["no robots", "no bays", "all empty", "all equal", "no spares", "no packs", "hungry"]
accepted = refused = 0
wrong = []
with tempfile.TemporaryDirectory() as folder:
    path, plan = os.path.join(folder, "inst.json"), os.path.join(folder, "sol.json")
    for n in range(a.count):
        robots = R.choice([1, 2, 5, 8, 12, 16, 25, 40, 60, 100] + ([300] if n % 20 == 0 else []))
        stations = max(1, robots // R.choice([4, 8, 12, 20]))
        args = ["--robots", robots, "--stations", stations, "--packs", R.randint(1, 6), "--seed", n,
                "--horizon", R.choice([30, 60, 90, 90, 150]), "--energy", R.choice([0, 0, 0.3, 2])]
        out = subprocess.run([sys.executable, os.path.join(a.tools, "gen.py")] + [str(x) for x in args], capture_output=True, text=True, check=True)
        inst = json.loads(out.stdout)
        how = R.choice(ways) if n % 5 == 4 else "as made"
        possible = bend(inst, how)
        json.dump(inst, open(path, "w"))
        run = subprocess.run([a.program, "plan", path, "--budget-ms", str(a.budget_ms), "--format", "json", "--output", plan],
                             capture_output=True, text=True)
        if run.returncode == 1 and (not possible or how == "as made"):
            # The generator itself sometimes makes a station that cannot feed itself: no empty plan passes then.
            empty = {"sessions": [], "pack_order": {str(s["id"]): [p["id"] for p in sorted(
                s["packs"], key=lambda p: (p["available_from"], p["reserve"] - p["remaining"]))] for s in inst["stations"]}}
            if "no plan is possible" in run.stderr and not check.check(inst, empty)["feasible"]:
                refused += 1
                continue
        if run.returncode != 0 or not possible:
            wrong.append((n, how, args, run.returncode, run.stderr[-300:]))
            continue
        sol = json.load(open(plan))
        got = check.check(inst, sol)
        bounds = all(b <= v for b, v in zip(sol["bound"], sol["objective"]))
        told = all(u["reasons"] for u in sol["unserved"]) and len(sol["unserved"]) + len(sol["sessions"]) == len(inst["robots"])
        if got["feasible"] and bounds and told:
            accepted += 1
        else:
            wrong.append((n, how, args, got["errors"][:3], bounds, told))
print(f"{a.count} instances: {accepted} plans accepted, {refused} rightly refused, {len(wrong)} wrong")
for w in wrong[:20]:
    print(" ", w)
sys.exit(1 if wrong else 0)
