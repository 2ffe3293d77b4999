#!/usr/bin/env python3
"""Whether a camera that was knocked, or sags, is told of, and what becomes of the positions.

    trust_figures.py HUETRACKD SCENE...

SCENE: a folder of ../shared/tools/scenes (scenes.py bumped --seed N --out SCENE; still and webcams for false alarms), or of
../shared/data. Each is replayed with calibration: {watch: tell}, {watch: leave out} and {watch: mend}, without its true poses,
and with the one camera less that was not knocked. Needs Debian's python3-numpy and python3-yaml."""
import csv
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy as np
import yaml

TOLD = re.compile(r"reported at ([\d.]+) s: (\w+) (was turned by|sags: since ([\d.]+) s it has slowly turned by) ([\d.]+) degrees"
                  r"(?: and moved by ([\d.]+) mm)?(?: at ([\d.]+) s)?")
ALARM = re.compile(r"^  (?:cameras reported at|mistake from) (.*)$", re.M)


def replay(huetrackd, scene, watch, without=None):
    """Its summary, and the rows of its tracks."""
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        config = yaml.safe_load((scene / "huetrackd.yaml").read_text())
        config["rig"] = str(scene / "rig.yaml")
        config["calibration"] = {"watch": watch}
        config.pop("cameras", None)
        if without:
            rig = yaml.safe_load((scene / "rig.yaml").read_text())
            del rig["cameras"][without]
            (scratch / "rig.yaml").write_text(yaml.safe_dump(rig))
            config["rig"] = str(scratch / "rig.yaml")
        (scratch / "huetrackd.yaml").write_text(yaml.safe_dump(config))
        done = subprocess.run([huetrackd, "replay", str(scratch / "huetrackd.yaml"), str(scene), "--no-dds",
                               "--tracks", str(scratch / "tracks.csv")], check=True, capture_output=True, text=True)
        with open(scratch / "tracks.csv") as file:
            return done.stdout + done.stderr, list(csv.DictReader(file))


def costs(summary):
    """Milliseconds of processor time of the watch and of the trackers."""
    def of(stage):
        found = re.search(stage + r" [\d.]+ \(([\d.]+)\)", summary)
        return 1e3 * float(found.group(1)) if found else float("nan")
    return of("watch the calibration"), of("track")


def errors(scene, rows):
    """Times, errors in metres and NEES of what is `tracking`."""
    with open(scene / "groundtruth.csv") as file:
        truth = list(csv.DictReader(file))
    t = np.array([float(row["t"]) for row in truth])
    p = np.array([[float(row[k]) for k in "xyz"] for row in truth])
    rows = [row for row in rows if row["state"] == "tracking"]
    at = np.array([float(row["t"]) for row in rows])
    e = np.array([[float(row[k]) for k in "xyz"] for row in rows]) - np.stack([np.interp(at, t, p[:, k]) for k in range(3)], 1)
    c = np.array([[float(row[k]) for k in ("cxx", "cxy", "cxz", "cxy", "cyy", "cyz", "cxz", "cyz", "czz")] for row in rows])
    return at, np.linalg.norm(e, axis=1), np.einsum("ni,nij,nj->n", e, np.linalg.inv(c.reshape(-1, 3, 3)), e)


def rms_mm(e):
    return 1e3 * np.sqrt((e ** 2).mean()) if len(e) else float("nan")


def sagged_deg(sag, t):
    return sag["degrees"] * min(1, max(0, (t - sag["from_s"]) / (sag["to_s"] - sag["from_s"])))


def events(summary):
    return [dict(told=float(m[0]), camera=m[1], is_knock=m[2] == "was turned by", deg=float(m[4]), mm=float(m[5]) if m[5] else None)
            for m in TOLD.findall(summary)]


def bumped(huetrackd, scene, truth, bars):
    knock, sag = truth["knock"], truth.get("sag")
    shift_mm = 1e3 * np.linalg.norm(knock["shift_m"])
    for watch in ("tell", "leave out", "mend"):
        summary, rows = replay(huetrackd, scene, watch)
        told = events(summary)
        right = [e for e in told if e["is_knock"] and e["camera"] == knock["camera"]]
        wrong = [e for e in told if e["camera"] not in (knock["camera"], (sag or {}).get("camera"))]
        false_knock = [e for e in told if e["is_knock"] and e["camera"] != knock["camera"]]
        sags = [e for e in told if not e["is_knock"] and sag and e["camera"] == sag["camera"]]
        at, e, nees = errors(scene, rows)
        late = at >= knock["at_s"] + 3
        text = f"{scene.name[:10]:10} {watch:9} "
        if right:
            k = right[0]
            text += f"{k['camera']} after {k['told'] - knock['at_s']:5.2f} s {k['deg'] - knock['degrees']:+6.2f} deg "
            text += f"{k['mm'] - shift_mm:+5.1f} mm" if k["mm"] is not None else "  ?     "
        else:
            text += "NOT TOLD                     "
        text += f" | sag told at {sagged_deg(sag, sags[0]['told']):.2f} of {sag['degrees']:.2f} deg" if sags else " | sag not told           "
        watch_ms, track_ms = costs(summary)
        text += f" | before {rms_mm(e[at < knock['at_s']]):5.1f} mm, 3 s after {rms_mm(e[late]):5.1f} mm, NEES {nees.mean():6.1f}, {nees[late].mean():6.1f}"
        text += f", tracking {100 * len(at) / len(rows):5.1f} % | watch {watch_ms:.0f} of {track_ms:.0f} ms"
        if wrong or false_knock:
            text += " | BLAMED: " + ", ".join(sorted({x["camera"] for x in wrong + false_knock}))
        print(text, flush=True)
        named = right and right[0]["told"] - knock["at_s"] <= 2 and not wrong and not false_knock
        exact = named and abs(right[0]["deg"] - knock["degrees"]) <= 0.1 and right[0]["mm"] is not None and abs(right[0]["mm"] - shift_mm) <= 5
        bars.setdefault(watch, []).append((bool(named), bool(exact), bool(wrong or false_knock), rms_mm(e[late])))
    spare = next(c for c in truth_cameras(scene) if c not in (knock["camera"],))
    summary, _ = replay(huetrackd, scene, "tell", without=spare)
    named = [e["camera"] for e in events(summary) if e["is_knock"]]
    print(f"{scene.name[:10]:10} two cameras, without {spare}: {'knock laid to ' + ', '.join(named) if named else 'NOT TOLD'}", flush=True)
    bars.setdefault("two cameras", []).append((named == [knock["camera"]], True, False, 0))


def truth_cameras(scene):
    return list(yaml.safe_load((scene / "rig.yaml").read_text())["cameras"])


def main():
    huetrackd, bars, alarms, quiet = sys.argv[1], {}, 0, 0
    for scene in [pathlib.Path(name).resolve() for name in sys.argv[2:]]:
        truth = yaml.safe_load((scene / "truth.yaml").read_text()) if (scene / "truth.yaml").exists() else {}
        if "knock" in truth:
            bumped(huetrackd, scene, truth, bars)
            continue
        summary, _ = replay(huetrackd, scene, "tell")
        found = ALARM.findall(summary)
        watch_ms, track_ms = costs(summary)
        alarms, quiet = alarms + len(found), quiet + 1
        print(f"{scene.name[:10]:10} {'FALSE ALARM ' + '; '.join(found) if found else 'no alarm'}, watch {watch_ms:.0f} of {track_ms:.0f} ms", flush=True)
    for watch, all_of in bars.items():
        print(f"{watch}: {sum(b[0] for b in all_of)} of {len(all_of)} named right and in time, {sum(b[1] for b in all_of)} with angle and "
              f"shift, {sum(b[2] for b in all_of)} with another one blamed, worst rms from 3 s after {max(b[3] for b in all_of):.1f} mm")
    print(f"{alarms} false alarms in {quiet} recordings")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main()
