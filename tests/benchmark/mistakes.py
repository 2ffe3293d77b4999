#!/usr/bin/env python3
"""Mistakes that people make with a rig, made with good recordings: are they named, and is nothing `tracking` that is not there?

    mistakes.py HUETRACKD [--seeds N] [--only WORD] [--verbose] SCENE...

SCENE: ../shared/data/rendered/occlusion, a folder of ../shared/tools/scenes, or ../shared/data/rendered/webcams, whose cameras'
times are then known. Each mistake is made with a camera (or two) and an axis that the seed draws. Printed per mistake: how often
it is named right and how often anything else is named (--strict, exit status 3, and the summary), the longest time of `tracking`
over 10 cm off, and the mean NEES of all positions and of those that are `tracking`. `none` is the recording as it is: nothing may
be named. Needs Debian's python3-numpy, python3-yaml and python3-opencv."""
import argparse
import csv
import pathlib
import re
import subprocess
import sys
import tempfile

import cv2
import numpy as np
import yaml

LIME, PINK = {"hue_deg": [65, 115]}, {"hue_deg": [310, 355]}
ROOM = {"min": [-1, -1, 0.1], "max": [1, 1, 2.1]}
OTHER_ROOMS = ("webcams", "bumped", "fast_60fps", "swarm_public")


class Case:
    """A recording with its rig and configuration, as it is: a mistake changes them."""

    def __init__(self, scene):
        self.scene = scene
        self.rig = yaml.safe_load((scene / "rig.yaml").read_text())
        self.recording = yaml.safe_load((scene / "recording.yaml").read_text())
        for camera in self.recording["cameras"].values():
            camera["frames"] = str(scene / camera["frames"])
            if "timestamps" in camera:
                camera["timestamps"] = str(scene / camera["timestamps"])
        file = scene / "huetrackd.yaml"
        self.config = yaml.safe_load(file.read_text()) if file.exists() else {
            "version": 1, "object_tracking": {"volume": ROOM}, "dds": {"enabled": False},
            "targets": {"pink": {"radius_m": 0.04, "color": dict(PINK)}, "lime": {"radius_m": 0.04, "color": dict(LIME)}}}
        if "timestamps" in self.recording["cameras"]["cam0"]:
            of = yaml.safe_load((scene / "truth.yaml").read_text())["cameras"]
            for name, camera in self.rig["cameras"].items():
                camera["timing"] = {"latency_s": of[name]["latency_s"], "latency_sigma_s": 0.0003,
                                    "readout_s": of[name]["readout_s"], "readout_sigma_s": 0.0005}
        self.names = list(self.rig["cameras"])
        self.started = 0.0

    def pick(self, rng, n=1):
        return [self.names[i] for i in rng.permutation(len(self.names))[:n]]


def turn_about_any_axis(rng, degrees):
    axis = rng.normal(size=3)
    return cv2.Rodrigues(np.deg2rad(degrees) * axis / np.linalg.norm(axis))[0]


# Each mistake changes a case and returns the patterns of sentences that name it; `scratch` is for files.

def none(case, rng, scratch):
    return []


def swap(case, rng, scratch):
    a, b = sorted(case.pick(rng, 2))
    cameras = case.recording["cameras"]
    cameras[a], cameras[b] = cameras[b], cameras[a]
    return [f"{a} and {b} look swapped"]


def turned(degrees):
    def make(case, rng, scratch):
        name, = case.pick(rng)
        turn = turn_about_any_axis(rng, degrees)
        pose = case.rig["cameras"][name]["cam_from_world"]
        pose["rotation"] = (turn @ np.array(pose["rotation"])).tolist()
        pose["translation"] = (turn @ np.array(pose["translation"])).tolist()  # about the camera's centre
        return [rf"{name} .*turned by"]
    make.__name__ = f"turned_{degrees}"
    return make


def two_off(cm, degrees):
    """Two cameras stand elsewhere than the rig says: any sentence that says so of the rig names it."""
    def make(case, rng, scratch):
        for name in case.pick(rng, 2):
            turn, way = turn_about_any_axis(rng, degrees), rng.normal(size=3)
            pose = case.rig["cameras"][name]["cam_from_world"]
            rotation, translation = np.array(pose["rotation"]), np.array(pose["translation"])
            centre = -rotation.T @ translation + 0.01 * cm * way / np.linalg.norm(way)
            rotation = turn @ rotation
            pose["rotation"], pose["translation"] = rotation.tolist(), (-rotation @ centre).tolist()
        return [r"px apart|turned by"]
    make.__name__ = f"two_off_{cm}cm"
    return make


def late_by(seconds):
    def make(case, rng, scratch):
        return make_late(case, rng, scratch, seconds)
    make.__name__ = "late" if seconds == 0.2 else f"late_{seconds}"
    return make


def make_late(case, rng, scratch, late_s):
    name, = case.pick(rng)
    camera = case.recording["cameras"][name]
    if "timestamps" in camera:
        rows = list(csv.reader(open(camera["timestamps"])))
        rows = [rows[0]] + [[row[0], f"{float(row[1]) + late_s:.9f}", *row[2:]] for row in rows[1:]]
    else:
        n = sum(1 for _ in open(case.scene / "groundtruth.csv"))
        rows = [["frame", "t_s"]] + [[i, f"{i / camera['fps'] + late_s:.9f}"] for i in range(n)]
        for other in case.recording["cameras"].values():
            if other is not camera:
                other["timestamps"] = f"{scratch}/in_time.csv"
        with open(f"{scratch}/in_time.csv", "w") as file:
            csv.writer(file).writerows([rows[0]] + [[i, f"{i / camera['fps']:.9f}"] for i in range(n)])
        for other in case.recording["cameras"].values():
            other.pop("fps")
    camera["timestamps"] = f"{scratch}/late.csv"
    with open(camera["timestamps"], "w") as file:
        csv.writer(file).writerows(rows)
    about = "|".join(f"{late_s + off:.2f}" for off in (-0.01, 0, 0.01))
    return [rf"{name} .*({about})\d* s late"]


def focal(factor):
    """One camera's focal length is not what the rig says: another zoom. That the rig is wrong names it."""
    def make(case, rng, scratch):
        name, = case.pick(rng)
        intrinsics = case.rig["cameras"][name]["intrinsics"]
        for key in ("fx", "fy"):
            intrinsics[key] *= factor
        return [rf"px apart|{name} .*focal"]
    make.__name__ = f"focal_{factor}"
    return make


def mirrored(case, rng, scratch):
    """One camera's pictures are mirrored, as of programs for meetings."""
    name, = case.pick(rng)
    camera = case.recording["cameras"][name]
    video = f"{scratch}/mirrored.mkv"
    subprocess.run(["ffmpeg", "-v", "error", "-i", camera["frames"], "-vf", "hflip", "-c:v", "ffv1", video], check=True)
    camera["frames"] = video
    return [rf"px apart|{name} .*mirrored|another room"]


def shown_again(filters, cameras, name):
    """Some cameras (0: all) show pictures once more, with new stamps. It is no mistake in the rig: none may be named."""
    def make(case, rng, scratch):
        for camera in case.pick(rng, cameras or len(case.names)):
            video = f"{scratch}/{camera}.mkv"
            subprocess.run(["ffmpeg", "-v", "error", "-i", case.recording["cameras"][camera]["frames"], "-filter_complex", filters,
                            "-c:v", "ffv1", video], check=True)
            case.recording["cameras"][camera]["frames"] = video
        return []
    make.__name__ = name
    return make


HANG = "split[a][b];[a][b]freezeframes=first=90:last=100000:replace=89"


def opencv_hue(case, rng, scratch):
    """Advice for a target that is never or seldom tracked: it is no mistake that the tracks show."""
    for target in case.config["targets"].values():
        target["color"]["hue_deg"] = [hue / 2 for hue in target["color"]["hue_deg"]]
    return ["OpenCV.*write"]


def other_room(case, rng, scratch):
    shared = pathlib.Path(__file__).resolve().parents[3] / "shared/data/rendered"
    if not shared.exists():
        shared = pathlib.Path("/work/shared/data/rendered")
    ours = [np.array(c["cam_from_world"]["rotation"]) for c in case.rig["cameras"].values()]
    for room in rng.permutation(OTHER_ROOMS):
        other = yaml.safe_load((shared / room / "rig.yaml").read_text())
        theirs = list(other["cameras"].values())[:len(ours)]
        angles = [np.degrees(np.arccos(np.clip((np.trace(a @ np.array(b["cam_from_world"]["rotation"]).T) - 1) / 2, -1, 1)))
                  for a, b in zip(ours, theirs)]
        if min(angles) > 8:
            break
    for name, theirs in zip(case.names, theirs):
        mine = case.rig["cameras"][name]
        scale = mine["image_size"][0] / theirs["image_size"][0]
        theirs["intrinsics"] = {key: value * scale for key, value in theirs["intrinsics"].items()}
        theirs["image_size"] = mine["image_size"]
        if "timing" in mine:
            theirs["timing"] = mine["timing"]
        case.rig["cameras"][name] = theirs
    return ["another room"]


def shared_colour(case, rng, scratch):
    """The range is widened until it takes in what covers a good part of a camera's picture."""
    name, = case.pick(rng)
    video = cv2.VideoCapture(case.recording["cameras"][name]["frames"])
    rgb = video.read()[1][:, :, ::-1].astype(float) / 255
    intensity = rgb.mean(axis=2)
    saturation = 1 - rgb.min(axis=2) / np.maximum(intensity, 1e-6)
    hue = cv2.cvtColor((rgb * 255).astype(np.uint8), cv2.COLOR_RGB2HSV_FULL)[:, :, 0] * 360 / 256
    for target in case.config["targets"].values():
        color = target["color"]
        low, high = color["hue_deg"]
        color.pop("saturation", None), color.pop("intensity", None)
        for wider in range(0, 180, 5):
            for least in (0.3, 0.2, 0.12, 0.08):
                inside = ((hue - (low - wider)) % 360 <= high - low + 2 * wider) & (saturation > least) & (intensity > 0.1)
                if inside.mean() > 0.12:
                    break
            else:
                continue
            break
        color.update(hue_deg=[(low - wider) % 360, min(high + wider, low - wider + 359) % 360],
                     saturation=[least, 1], intensity=[0.1, 1])
    return [r"covers \d+ % of"]


def radius(factor):
    def make(case, rng, scratch):
        for target in case.config["targets"].values():
            target["radius_m"] *= factor
        return ["correct radius_m"]
    make.__name__ = f"radius_{factor}"
    return make


MISTAKES = [none, swap, turned(0.5), turned(1), turned(2), turned(5), two_off(3, 1), two_off(5, 2), two_off(10, 4), late_by(0.2), late_by(0.1),
            focal(1.1), focal(0.9), mirrored, shown_again(HANG, 0, "all_hang"), shown_again(HANG, 1, "one_hangs"),
            shown_again("shuffleframes=0 0", 0, "all_twice"), shown_again("shuffleframes=0 0", 1, "one_twice"),
            opencv_hue, other_room, shared_colour, radius(1.3), radius(1.4), radius(0.7)]


def track_figures(tracks, truth_file, targets):
    """longest [s] of tracking over 10 cm off, squared errors in sigmas (all, tracking), errors of tracking [m], sets"""
    truth = list(csv.DictReader(open(truth_file)))
    longest, nees, nees_tracking, errors, sets = 0.0, [], [], [], 0
    for target in targets:
        mine = [row for row in truth if row.get("ball", target) == target]
        truth_t = np.array([float(row["t"]) for row in mine])
        truth_p = np.array([[float(row[k]) for k in "xyz"] for row in mine])
        since = last = None
        for row in csv.DictReader(open(tracks)):
            if row["target"] != target:
                continue
            sets += 1
            t = float(row["t"])
            if row["state"] not in ("tracking", "coasting") or not truth_t[0] <= t <= truth_t[-1]:
                since = None
                continue
            error = np.array([float(row[k]) for k in "xyz"]) - [np.interp(t, truth_t, truth_p[:, k]) for k in range(3)]
            c = [float(row[k]) for k in ("cxx", "cxy", "cxz", "cyy", "cyz", "czz")]
            covariance = np.array([[c[0], c[1], c[2]], [c[1], c[3], c[4]], [c[2], c[4], c[5]]])
            squared = error @ np.linalg.solve(covariance, error)
            nees.append(squared)
            if row["state"] == "tracking":
                nees_tracking.append(squared)
                errors.append(np.linalg.norm(error))
            if row["state"] == "tracking" and np.linalg.norm(error) > 0.1:
                since = t if since is None else since
                longest = max(longest, t - since)
            else:
                since = None
    return longest, nees, nees_tracking, errors, sets


def named_mistakes(summary):
    return [line[10:] for line in summary.splitlines() if line.startswith("  mistake ")]


def reported_cameras(summary):
    """The cameras that the summary reports as moved or sagging."""
    return re.findall(r"^  cameras reported at [\d.]+ s: (\w+) (?:was turned|sags)", summary, re.M)


def verdict(patterns, named):
    """Whether all patterns are named, and what else is blamed."""
    is_right = bool(patterns) and all(any(re.search(p, s) for s in named) for p in patterns)
    blames = [s for s in named if not patterns or "cannot be determined" not in s]
    return is_right, [s for s in blames if not any(re.search(p, s) for p in patterns)]


def counted(make, named, advice):
    """What counts as named. Of OpenCV's hue the advice; that the range as written covers other things as well is true."""
    return [s for s in named if " covers " not in s] + advice if make is opencv_hue else named


def run(huetrackd, case, scratch):
    case.config["rig"] = f"{scratch}/rig.yaml"
    for name, content in (("rig", case.rig), ("recording", case.recording), ("huetrackd", case.config)):
        pathlib.Path(scratch, name + ".yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    done = subprocess.run([huetrackd, "replay", f"{scratch}/huetrackd.yaml", scratch, "--no-dds", "--strict", "--tracks",
                           f"{scratch}/tracks.csv"], capture_output=True, text=True)
    if done.returncode not in (0, 3):
        sys.exit(done.stdout + done.stderr)
    named = named_mistakes(done.stdout)
    advice = [line[10:] for line in done.stdout.splitlines() if line.startswith("  search  ")]
    trouble = re.search(r"^  cameras reported .*(turned|sags|zoom|focus|seen)", done.stdout, re.M)
    may_be_lost = re.search(r"^  light .*the colour has (moved|become)", done.stdout, re.M)
    is_named = named or trouble
    if done.returncode == 0 and is_named or done.returncode == 3 and not (is_named or may_be_lost or advice):
        sys.exit(f"exit status {done.returncode}, named: {named}")
    if done.returncode == 3 and not is_named:  # by the advice alone
        return advice, advice
    return named, advice


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("huetrackd")
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--only", default="")
    parser.add_argument("--verbose", action="store_true")
    a = parser.parse_args()
    print("mistake          runs  named  others  longest wrong [s]  NEES   of tracking: NEES  worst  rms [mm]  % of sets")
    for mistake in MISTAKES:
        if not re.search(a.only, mistake.__name__):
            continue
        runs = right = others = 0
        longest, all_nees, all_tracking, all_errors, all_sets = 0.0, [], [], [], 0
        worst = 0.0
        for scene in a.scenes:
            for seed in range(1 if mistake in (none, opencv_hue) or "radius" in mistake.__name__ else a.seeds):
                with tempfile.TemporaryDirectory() as scratch:
                    case = Case(scene.resolve())
                    patterns = mistake(case, np.random.default_rng([seed, sum(map(ord, mistake.__name__))]), scratch)
                    named, advice = run(a.huetrackd, case, scratch)
                    named = counted(mistake, named, advice)
                    seconds, nees, tracking, errors, sets = track_figures(f"{scratch}/tracks.csv", scene / "groundtruth.csv",
                                                                          case.config["targets"])
                is_right, wrong = verdict(patterns, named)
                runs, right, others = runs + 1, right + is_right, others + bool(wrong)
                longest = max(longest, seconds)
                all_nees += nees
                all_tracking += tracking
                all_errors += errors
                all_sets += sets
                if tracking:
                    worst = max(worst, np.mean(tracking))
                if a.verbose:
                    print(f"  {scene.name} {seed} {patterns}: {'named' if is_right else 'NOT named'}; {seconds:.2f} s, NEES "
                          f"{np.mean(nees) if nees else 0:.1f}, of tracking {np.mean(tracking) if tracking else 0:.1f} in "
                          f"{100 * len(tracking) / sets:.0f} %, {1e3 * np.sqrt(np.mean(np.square(errors))) if errors else 0:.1f} mm")
                    for sentence in named:
                        print("     ", sentence)
        print(f"{mistake.__name__:15} {runs:5} {right:6} {others:7} {longest:18.2f} {np.mean(all_nees) if all_nees else 0:5.1f} "
              f"{np.mean(all_tracking) if all_tracking else 0:18.1f} {worst:6.1f} "
              f"{1e3 * np.sqrt(np.mean(np.square(all_errors))) if all_errors else 0:9.1f} {100 * len(all_errors) / all_sets:10.1f}",
              flush=True)


if __name__ == "__main__":
    main()
