#!/usr/bin/python3
"""Replays some 20 short recordings and holds every figure to its band: see README.md beside this file.

    oracle.py [BUILD] [--only REGEX] [--tighten] [--jobs N]
"""
import argparse
import concurrent.futures
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
SHARED = pathlib.Path(os.environ.get("HUETRACK_SHARED", ROOT.parent / "shared"))
DATA = SHARED / "data"
CACHE = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache")) / "huetrack" / "scenes"
SKIPPED = 77

try:
    import numpy as np
    import yaml
    sys.path[:0] = [str(HERE), str(ROOT / "tests" / "benchmark")]
    import figures
    import many_figures
    import mistakes
    import one_camera
except ImportError as missing:
    print(f"oracle: skipped: {missing}. Install python3-numpy python3-scipy python3-yaml python3-opencv")
    sys.exit(SKIPPED)

ROOM = {"min": [-1, -1, 0.1], "max": [1, 1, 2.1]}
COLOURS = {"pink": {"radius_m": 0.04, "color": {"hue_deg": [310, 355]}}, "lime": {"radius_m": 0.04, "color": {"hue_deg": [65, 115]}}}


class Failed(Exception):
    """A program ended with an error."""


class NotThere(Exception):
    """A recording is not there and cannot be made."""


class Programs:
    def __init__(self, build):
        self.huetrackd = build / "service/daemon/huetrackd"
        self.calibrate = build / "calib/program/huetrack-calibrate"
        self.measured = build / "tests/oracle/measured"

        self.environment = {}  # besides the environment of this process

    def run(self, *command, accept=(0,)):
        done = subprocess.run([str(c) for c in command], capture_output=True, text=True, env=os.environ | self.environment)
        if done.returncode not in accept:
            raise Failed(f"{' '.join(map(str, command))}\n{(done.stdout + done.stderr).strip()[-600:]}")
        return done.stdout + done.stderr


# ---- recordings

def shared(name):
    folder = DATA / name
    if not folder.exists():
        raise NotThere(f"{folder} is not there")
    return folder


def made(kind, seed, *options):
    """A scene of ../shared/tools/scenes: made once, kept below ~/.cache/huetrack/scenes. The key covers the generator, too."""
    tools = SHARED / "tools" / "scenes"
    if not tools.exists():
        raise NotThere(f"{tools} is not there")
    sources = b"".join(file.read_bytes() for file in sorted(tools.glob("*.py")) + sorted(tools.glob("*.c")))
    words = [kind, "--seed", str(seed), *options]
    key = hashlib.sha256(repr(words).encode() + sources).hexdigest()[:12]
    folder = CACHE / f"{kind}_{seed}_{key}"
    if not folder.exists():
        CACHE.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=CACHE) as scratch:
            out = pathlib.Path(scratch, "scene")
            done = subprocess.run(["/usr/bin/python3", tools / "scenes.py", *words, "--jobs", "1", "--out", out], capture_output=True, text=True)
            if done.returncode:
                raise Failed(f"scenes.py {' '.join(words)}: {done.stderr.strip()[-600:]}")
            try:
                out.rename(folder)  # whole or not there
            except OSError:
                if not folder.exists():  # otherwise another case has made it in the meantime: the same bytes
                    raise
    return folder


# ---- what is measured: each case returns its figures

def replay(programs, config, recording, *arguments, accept=(0,)):
    """The tracks and what was printed."""
    with tempfile.TemporaryDirectory() as scratch:
        file, tracks = pathlib.Path(scratch, "huetrackd.yaml"), pathlib.Path(scratch, "tracks.csv")
        file.write_text(yaml.safe_dump(config, sort_keys=False))
        text = programs.run(programs.huetrackd, "replay", file, recording, "--no-dds", "--tracks", tracks, *arguments, accept=accept)
        return figures.read_csv(tracks), text


def config_of(folder, targets=None, **tracking):
    file = folder / "huetrackd.yaml"
    config = yaml.safe_load(file.read_text()) if file.exists() else {"version": 1, "targets": {t: COLOURS[t] for t in targets}}
    config.pop("cameras", None)
    config["rig"] = str(folder / "rig.yaml")
    config["object_tracking"] = {"volume": ROOM} | config.get("object_tracking", {}) | tracking
    return config


def objects(folder, targets=("ball",), least_visible=0.5, free_shift=False, timing=False, watch=None, **tracking):
    def case(programs):
        scene = folder()
        config = config_of(scene, targets, **tracking)
        if watch:
            config["calibration"] = {"watch": watch}
        with tempfile.TemporaryDirectory() as scratch:
            if timing:
                with_timing(scene, config, pathlib.Path(scratch, "rig.yaml"))
            tracks, text = replay(programs, config, scene)
        balls = {name: name for name in config["targets"]}
        out = figures.track_figures(tracks, scene, balls, least_visible, free_shift)
        return out | faults(scene, text)
    return case


def with_timing(scene, config, file):
    """The true latencies and readouts go into the rig, as `huetrack-calibrate time` would write them."""
    rig, truth = yaml.safe_load((scene / "rig.yaml").read_text()), yaml.safe_load((scene / "truth.yaml").read_text())["cameras"]
    for name, camera in rig["cameras"].items():
        camera["timing"] = {"latency_s": truth[name]["latency_s"], "latency_sigma_s": 0.0003,
                            "readout_s": truth[name]["readout_s"], "readout_sigma_s": 0.0005}
    file.write_text(yaml.safe_dump(rig))
    config["rig"] = str(file)


def faults(scene, text):
    """What the summary reports of cameras, against truth.yaml: the knocked camera is right, any but it and the sagging one wrong."""
    reported = set(mistakes.reported_cameras(text))
    truth = yaml.safe_load((scene / "truth.yaml").read_text()) if (scene / "truth.yaml").exists() else {}
    moved = {truth[k]["camera"] for k in ("knock", "sag") if k in truth}
    named = [line for line in mistakes.named_mistakes(text)]
    out = {"false_alarms": len(reported - moved) + len(named)}
    if moved:
        out["right"] = len(reported & moved)
    return out


def one(folder, camera, target="ball"):
    """One camera of a recording alone."""
    def case(programs):
        scene = folder()
        rows, ball, radius_m, rig = one_camera.replayed(programs.huetrackd, scene, target, [camera])
        out = one_camera.measured(rows, figures.Truth(scene, ball, 0.5), rig, radius_m)
        return {name: out[name] for name in ("tracking_pct", "far", "across_mm", "along_pct", "nees", "inside95_pct") if name in out}
    return case


def many(folder, count):
    def case(programs):
        scene = folder()
        config = config_of(scene)
        for target in config["targets"].values():
            target["count"] = count
        with tempfile.TemporaryDirectory() as scratch:
            file, tracks = pathlib.Path(scratch, "huetrackd.yaml"), pathlib.Path(scratch, "tracks.csv")
            file.write_text(yaml.safe_dump(config, sort_keys=False))
            programs.run(programs.huetrackd, "replay", file, scene, "--no-dds", "--quiet", "--tracks", tracks)
            truth = many_figures.Truth(str(scene))
            f = many_figures.figures(truth, many_figures.read_tracks(tracks, truth)[0], first=9 if count == 3 else 0)
        return {"rms_mm": f["rms_mm"], "tracking_pct": 100 * f["cover"], "far": f["fp"], "mota": f["mota"], "idf1": f["idf1"]}
    return case


def real(programs):
    """Two real webcams and a red square, no truth: the share `tracking`, and how smooth the path is (rms of what a position is off
    the mean of its neighbours, after a quadratic through five)."""
    scene = shared("red_square_stereo")
    config = {"version": 1, "rig": str(scene / "rig.yaml"),
              "targets": {"red": {"radius_m": 0.0085, "color": {"hue_deg": [340, 358], "saturation": [0.6, 1], "intensity": [0.08, 0.4]},
                                  "camera_colors": {"cam2": {"hue_deg": [335, 356], "saturation": [0.22, 0.6], "intensity": [0.25, 0.6]}}}},
              "object_tracking": {"volume": {"min": [-0.3, -0.2, -1.2], "max": [0.4, 0.5, -0.3]}, "pixel_noise_px": 1.4}}
    tracks, _ = replay(programs, config, scene)
    rows = [row for row in tracks if row["state"] == "tracking"]
    t, p = figures.column(rows, "t")[:, 0], figures.column(rows, "x", "y", "z")
    off = []
    for k in range(2, len(t) - 2):
        near = slice(k - 2, k + 3)
        if t[k + 2] - t[k - 2] < 0.6:
            fit = np.polyfit(t[near] - t[k], p[near], 2)
            off.append(np.linalg.norm(p[k] - fit[-1]))
    return {"tracking_pct": 100 * len(rows) / len(tracks), "rough_mm": 1e3 * float(np.sqrt(np.mean(np.square(off))))}


def mistake(make):
    def case(programs):
        scene = shared("rendered/occlusion")
        with tempfile.TemporaryDirectory() as scratch:
            made_of = mistakes.Case(scene)
            patterns = make(made_of, np.random.default_rng([0, sum(map(ord, make.__name__))]), scratch)
            named, advice = mistakes.run(str(programs.huetrackd), made_of, scratch)
            named = mistakes.counted(make, named, advice)
            longest, nees, tracking, errors, sets = mistakes.track_figures(f"{scratch}/tracks.csv", scene / "groundtruth.csv",
                                                                           made_of.config["targets"])
        is_right, wrong = mistakes.verdict(patterns, named)
        out = {"right": int(is_right)} if patterns else {}
        out |= {"false_alarms": len(wrong), "tracking_pct": 100 * len(errors) / sets, "far": int(sum(e > figures.FAR_M for e in errors))}
        if nees:
            out["nees"] = float(np.mean(nees))
        if errors:
            out["rms_mm"] = 1e3 * float(np.sqrt(np.mean(np.square(errors))))
        return out
    return case


def camera(folder, start, method="huetrack"):
    def case(programs):
        scene = folder()
        config = {"version": 1, "rig": str(scene / "rig.yaml"),
                  "camera_tracking": {"camera": "cam0", "method": method, "start": {k: str(scene / v) for k, v in start.items()}}}
        with tempfile.TemporaryDirectory() as scratch:
            file, poses = pathlib.Path(scratch, "huetrackd.yaml"), pathlib.Path(scratch, "poses.txt")
            file.write_text(yaml.safe_dump(config))
            programs.run(programs.huetrackd, "replay", file, scene, "--no-dds", "--quiet", "--poses", poses)
            truth = scene / "groundtruth.txt"
            return figures.pose_figures(poses, truth, len(figures.read_tum(truth)))
    return case


def shutter(readout_ms):
    """Our camera tracker on a desk that is rendered in memory; the readout is learnt."""
    def case(programs):
        if not programs.measured.exists():
            raise NotThere(f"{programs.measured} is not built")
        words = programs.run(programs.measured, "shutter", readout_ms).split()
        return {name: float(value) for name, value in zip(words[::2], words[1::2])}
    return case


def calibration(programs):
    scene = shared("rendered/chessboard")
    with tempfile.TemporaryDirectory() as scratch:
        rig = pathlib.Path(scratch, "rig.yaml")
        programs.run(programs.calibrate, "extrinsics", "--quiet", "--board", scene / "board.yaml", scene, "--rig", rig, accept=(0, 2))
        return figures.rig_figures(rig, scene / "rig.yaml")


def wave(programs):
    scene = shared("rendered/webcams_wave")
    with tempfile.TemporaryDirectory() as scratch:
        rig, config = pathlib.Path(scratch, "rig.yaml"), pathlib.Path(scratch, "huetrackd.yaml")
        changed = yaml.safe_load((scene / "huetrackd.yaml").read_text())
        changed["rig"] = str(scene / "rig_off.yaml")
        config.write_text(yaml.safe_dump(changed))
        centres = [-r.T @ t for r, t in (figures.pose_of(c) for c in yaml.safe_load((scene / "rig.yaml").read_text())["cameras"].values())]
        programs.run(programs.calibrate, "wave", scene, "--config", config, "--target", "ball", "--camera-distance", "cam0", "cam1",
                     f"{np.linalg.norm(centres[0] - centres[1]):.4f}", "--rig", rig, accept=(0, 2))
        timing, truth = yaml.safe_load(rig.read_text())["cameras"], yaml.safe_load((scene / "truth.yaml").read_text())["cameras"]
        latency = np.array([timing[c]["timing"]["latency_s"] - truth[c]["latency_s"] for c in truth])
        return figures.rig_figures(rig, scene / "rig.yaml") | {"timing_ms": 1e3 * float(np.abs(latency - latency[0]).max())}


HAND = ("--step", "--what", "hand", "--processing", "none", "--seconds", "4")
CASES = {
    "demo": objects(lambda: ROOT / "configs/demo/recording", ("lime",)),
    "two_cams": objects(lambda: shared("rendered/two_cams"), ("lime",)),
    "two_cams_paper": objects(lambda: shared("rendered/two_cams"), ("lime",), observation="paper"),
    "occlusion": objects(lambda: shared("rendered/occlusion"), ("pink", "lime")),
    "fast_60fps": objects(lambda: shared("rendered/fast_60fps"), ("pink",)),
    "bounces_60fps": objects(lambda: made("still", 3, "--bounces", "--fps", "60", "--seconds", "2.5")),
    "webcams": objects(lambda: shared("rendered/webcams"), free_shift=True),
    "webcams_timing": objects(lambda: shared("rendered/webcams"), timing=True),
    "webcams_wave": objects(lambda: shared("rendered/webcams_wave"), free_shift=True),
    "wood": objects(lambda: made("still", 5, "--hue", "27", "--seconds", "4")),
    "hand_webcams": objects(lambda: shared("rendered/hand"), least_visible=0.2, free_shift=True),
    "hand_dark": objects(lambda: made("hand", 21, "--skin", "5", "--ball", "pink", *HAND), least_visible=0.2),
    "hand_light": objects(lambda: made("hand", 22, "--skin", "0", "--ball", "pink", *HAND), least_visible=0.2),
    "juggling": many(lambda: shared("rendered/juggling"), 3),
    "swarm": many(lambda: shared("rendered/swarm_public"), "up to 16"),
    "bumped_tell": objects(lambda: shared("rendered/bumped"), watch="tell"),
    "bumped_leave_out": objects(lambda: shared("rendered/bumped"), watch="leave out"),
    "bumped_mend": objects(lambda: shared("rendered/bumped"), watch="mend"),
    "one_camera": one(lambda: shared("rendered/two_cams"), "cam0", "lime"),
    "one_camera_webcam": one(lambda: shared("rendered/webcams"), "cam1"),
    "red_square": real,
    "desk": camera(lambda: shared("rendered/desk"), {"rectangle": "rectangle.csv"}),
    "leds": camera(lambda: shared("rendered/leds"), {"leds": "led_positions.csv", "led_schedule": "led_frames.csv"}),
    "desk_global_shutter": shutter(0),
    "desk_rolling_shutter": shutter(30),
    "chessboard": calibration,
    "wave": wave,
} | {"mistake " + make.__name__: mistake(make) for make in mistakes.MISTAKES}

# What the sensitivity sweep (tests/benchmark/sensitivity.py) runs: what the constants of a module are for, some 5 s on one core each.
SWEEP = {
    "service/object_tracking": ("two_cams", "occlusion", "webcams", "wood", "hand_dark"),
    "service/object_tracking/objects": ("occlusion", "wood", "juggling", "swarm", "mistake shared_colour"),
    "service/object_tracking/trackers": ("occlusion", "fast_60fps", "webcams", "juggling", "hand_dark"),
    "service/outline": ("two_cams", "fast_60fps", "webcams", "hand_dark"),
    "service/room_watch": ("bumped_tell", "bumped_leave_out", "bumped_mend"),
    "service/view_watch": tuple(f"mistake {name}" for name in ("none", "swap", "turned_1", "turned_5", "two_off_5cm", "late", "focal_1.1", "radius_1.3")),
    "service/pipeline": ("bumped_tell", "bumped_leave_out", "bumped_mend", "mistake turned_2"),
}


# ---- bands

def is_better(kind, value, than):
    if kind["better"] == "lower":
        return value < than
    if kind["better"] == "higher":
        return value > than
    return abs(np.log(max(value, 1e-9) / kind["better"])) < abs(np.log(max(than, 1e-9) / kind["better"]))


def limit(kind, best):
    """The end of the band on the bad side; for a figure with a target value, the factor by which it may differ from that."""
    margin = max(kind.get("share", 0) * abs(best), kind.get("least", 0))
    if kind["better"] == "lower":
        return best + margin
    if kind["better"] == "higher":
        return best - margin
    return np.exp(abs(np.log(max(best, 1e-9) / kind["better"])) + kind["log"])


def is_within(kind, value, best):
    end = limit(kind, best)
    if kind["better"] == "lower":
        return value <= end + 1e-9
    if kind["better"] == "higher":
        return value >= end - 1e-9
    return abs(np.log(max(value, 1e-9) / kind["better"])) <= np.log(end) + 1e-9


def shown(value):
    return f"{value:.0f}" if isinstance(value, int) or abs(value) >= 1000 else f"{value:.3g}" if abs(value) < 100 else f"{value:.1f}"


def measure(programs, name):
    start = time.monotonic()
    try:
        return name, {k: v if isinstance(v, int) else round(float(v), 4) for k, v in CASES[name](programs).items()}, "", time.monotonic() - start
    except NotThere as reason:
        return name, None, str(reason), 0
    except Exception as reason:  # whatever it is, the other cases run, and this one fails with it
        return name, {}, f"{type(reason).__name__}: {reason}", time.monotonic() - start


def table(results, kinds, bands):
    columns = [c for c in kinds if any(c in (f or {}) for _, f, *_ in results)]
    print(f"{'case':24}" + "".join(f"{c:>13}" for c in columns) + "      s")
    for name, measured, reason, seconds in results:
        if measured is None:
            print(f"{name:24} skipped: {reason}")
            continue
        cells = []
        for c in columns:
            mark = ""
            if c in measured and c in bands.get(name, {}):
                best = bands[name][c]
                mark = " !" if not is_within(kinds[c], measured[c], best) else " +" if is_better(kinds[c], measured[c], best) else ""
            cells.append(f"{shown(measured[c]) + mark if c in measured else '':>13}")
        print(f"{name:24}" + "".join(cells) + f" {seconds:6.1f}")


def judge(results, kinds, bands):
    """Sentences: what is out of its band, and what is better than the best of before."""
    out, better = [], []
    for name, measured, reason, _ in results:
        if measured == {}:
            out.append(f"{name}: {reason}")
        for figure in bands.get(name, {}) if measured else ():
            if figure not in measured:
                out.append(f"{name}: {figure} is missing (best {bands[name][figure]})")
        for figure, value in (measured or {}).items():
            if figure not in bands.get(name, {}):
                out.append(f"{name}: {figure} {shown(value)} has no band yet: run.sh --tighten writes it")
                continue
            best, kind = bands[name][figure], kinds[figure]
            if not is_within(kind, value, best):
                out.append(f"{name}: {figure} {shown(value)} is out of its band (best {shown(best)}, limit {shown(limit(kind, best))}): {kind['why']}")
            elif is_better(kind, value, best) and abs(value - best) > 0.001 * abs(best):
                better.append(f"{name}: {figure} {shown(value)} is a new best (was {shown(best)})")
    return out, better


def tighten(file, results, kinds, bands):
    """Writes each new best, and the figures that have no band yet. The head of the file, to the line `cases:`, stays."""
    for name, measured, *_ in results:
        for figure, value in (measured or {}).items():
            mine = bands.setdefault(name, {})
            if figure not in mine or is_better(kinds[figure], value, mine[figure]):
                mine[figure] = value
    head = file.read_text().split("\ncases:\n")[0]
    lines = [f"  {name}: {{{', '.join(f'{k}: {v}' for k, v in of.items())}}}" for name, of in bands.items()]
    file.write_text(head + "\ncases:\n" + "\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", nargs="?", default=ROOT / "build/release", type=pathlib.Path)
    parser.add_argument("--only", default="", help="cases whose name matches this regular expression")
    parser.add_argument("--tighten", action="store_true", help="write new bests, and figures without a band, to oracle.yaml")
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    programs = Programs(options.build.resolve())
    if not programs.huetrackd.exists():
        sys.exit(f"oracle: {programs.huetrackd} is not there: build it first, or give the build folder")
    file = HERE / "oracle.yaml"
    content = yaml.safe_load(file.read_text())
    kinds, bands = content["figures"], content["cases"] or {}
    names = [name for name in CASES if re.search(options.only, name)]
    if not names:
        sys.exit(f"oracle: no case matches --only {options.only}")
    start = time.monotonic()
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        results = list(pool.map(lambda name: measure(programs, name), names))
    table(results, kinds, bands)
    if not options.only and programs.measured.exists():  # alone, at the end: it measures time, and decides nothing
        try:
            print(programs.run(programs.measured, "update").strip())
        except Failed as reason:
            print(reason)
    out, better = judge(results, kinds, bands)
    for sentence in better:
        print("+ " + sentence)
    for sentence in out:
        print("! " + sentence)
    ran = [r for r in results if r[1] is not None]
    print(f"oracle: {len(ran)} of {len(results)} cases in {time.monotonic() - start:.0f} s, {len(out)} figures out of their bands, {len(better)} new")
    if options.tighten:
        tighten(file, results, kinds, bands)
    if not ran:
        return SKIPPED
    return 1 if out else 0


if __name__ == "__main__":
    sys.exit(main())
