#!/usr/bin/env python3
"""How well one camera tracks a ball: its direction by the picture, its distance by its size.

    one_camera.py HUETRACKD SCENE[=TARGET]...

SCENE: a folder of ../shared/data/rendered, or of ../shared/tools/scenes (scenes.py still --seed N --out SCENE); TARGET: pink or lime,
for the scenes without a huetrackd.yaml. Each camera is replayed alone. Printed per camera: share `tracking` of the sets in which half
of the ball or more is visible; error across the ray (mm) and along it (% of the distance), rms; what the pixels allow: the error
along it if the edge were known to 0.1 px; NEES (3 is honest), share inside 95 %; positions more than 10 cm and 3 sigmas off.

    one_camera.py HUETRACKD --videos [DATA]

Real videos of one uncalibrated camera (../shared/data/green_ball_in_hand, red_pendulum), taught by one click at the labelled centre of
one frame. Printed: share of the labelled frames in which the published centre projects to within 0.35 radii of the label, and in which
the published radius is right to 12 %; frames in which something is published (tracking or coasting) although the ball is not visible,
more than two frames from those in which it is. A lens of 60 degrees is assumed: it scales all distances alike. Needs Debian's python3-numpy and python3-yaml.

    one_camera.py HUETRACKD --flight VIDEO

VIDEO: balle1-vp9.avi of Debian's python3-mecavideo (its data/video), a ball that is thrown. Printed: rms deviation of the free flight from
a parabola, % of its path; in the picture, and in 3-D, where the distance is by the ball's size.

    one_camera.py HUETRACKD --last-view SCENE=BALL[,BALL]...

With all cameras: sets in which only one of several views sees half of the ball. Printed: share `tracking` and `coasting`, error along
that view's ray and NEES while `tracking`, and how many sets it takes to be `tracking` again when a second view sees it."""
import argparse
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import yaml

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "oracle"))
import figures  # noqa: E402

COLOURS = {"pink": {"radius_m": 0.04, "color": {"hue_deg": [310, 355]}}, "lime": {"radius_m": 0.04, "color": {"hue_deg": [65, 115]}}}
ROOM = {"min": [-1, -1, 0.1], "max": [1, 1, 2.1]}
EDGE_PX = 0.1  # to which a ball's radius in a picture can be known


def replayed(huetrackd, scene, target, cameras):
    """Rows of the track, and the configuration's target. cameras: those that are used."""
    file = scene / "huetrackd.yaml"
    config = yaml.safe_load(file.read_text()) if file.exists() else {"version": 1, "targets": {target: COLOURS[target]}}
    config.pop("cameras", None)
    config["object_tracking"] = {"volume": ROOM} | config.get("object_tracking", {})
    recording, rig = (yaml.safe_load((scene / name).read_text()) for name in ("recording.yaml", "rig.yaml"))
    for part in (recording, rig):
        part["cameras"] = {name: camera for name, camera in part["cameras"].items() if name in cameras}
        part.pop("uncertainty", None)
    # No picture can show by how much the only camera's stamps are late: the rig has it, as `huetrack-calibrate time` writes it.
    if (scene / "truth.yaml").exists():
        for name, true in yaml.safe_load((scene / "truth.yaml").read_text()).get("cameras", {}).items():
            if name in rig["cameras"] and "latency_s" in true:
                rig["cameras"][name]["timing"] = {"latency_s": true["latency_s"], "latency_sigma_s": 0.0003,
                                                  "readout_s": true.get("readout_s", 0), "readout_sigma_s": 0.0005}
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        for part in scene.iterdir():
            if part.name not in ("recording.yaml", "rig.yaml"):
                (scratch / part.name).symlink_to(part)
        (scratch / "recording.yaml").write_text(yaml.safe_dump(recording, sort_keys=False))
        (scratch / "rig.yaml").write_text(yaml.safe_dump(rig, sort_keys=False))
        config["rig"] = str(scratch / "rig.yaml")
        (scratch / "one.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
        done = subprocess.run([huetrackd, "replay", scratch / "one.yaml", scratch, "--no-dds", "--quiet", "--tracks", scratch / "tracks.csv"],
                              capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{scene}: {done.stderr.strip()[-600:]}")
        rows = figures.read_csv(scratch / "tracks.csv")
    name = next(iter(config["targets"]))
    return [row for row in rows if row["target"] == name], name, config["targets"][name]["radius_m"], rig["cameras"]


def measured(rows, truth, cameras, radius_m):
    """Figures as in the head of this file. cameras: the only one."""
    t = figures.column(rows, "t")[:, 0]
    is_tracking = np.array([row["state"] == "tracking" for row in rows], bool)
    name = next(iter(cameras))
    if truth.views:
        truth.views = {name: truth.views[name]}
    is_visible = (truth.seen_by(t) >= 1) & (t >= truth.t[0]) & (t <= truth.t[-1])
    which = is_visible & is_tracking
    out = {"sets": int(is_visible.sum()), "tracking_pct": 100 * which.sum() / max(1, is_visible.sum())}
    all_rows = [row for row, yes in zip(rows, is_tracking) if yes]
    if not all_rows:
        return out
    p = figures.column(all_rows, "x", "y", "z")
    at = truth.at(figures.column(all_rows, "t")[:, 0])
    c = figures.column(all_rows, "cxx", "cxy", "cxz", "cyy", "cyz", "czz")[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
    e = p - at
    nees = np.einsum("ni,ni->n", e, np.linalg.solve(c, e[..., None])[..., 0])
    out["far"] = int(((np.linalg.norm(e, axis=1) > figures.FAR_M) & (nees > 14.2)).sum())  # chi-square, 3 dof, 3 sigmas
    mine = which[is_tracking]
    if not mine.any():
        return out
    rotation, translation = figures.pose_of(cameras[name])
    ray = at[mine] + rotation.T @ translation
    distance = np.linalg.norm(ray, axis=1)
    along = np.einsum("ni,ni->n", e[mine], ray / distance[:, None])
    across2 = (e[mine] ** 2).sum(axis=1) - along ** 2
    focal = np.mean(figures.linear_part(cameras[name])[0])
    return out | {"across_mm": 1e3 * np.sqrt(across2.mean()), "along_pct": 100 * np.sqrt(((along / distance) ** 2).mean()),
                  "along_mm": 1e3 * np.sqrt((along ** 2).mean()), "along_bias_pct": 100 * (along / distance).mean(),
                  "bound_pct": 100 * np.sqrt(((EDGE_PX * distance / (focal * radius_m)) ** 2).mean()),
                  "nees": nees[mine].mean(), "inside95_pct": 100 * (nees[mine] < figures.CHI2_3_95).mean()}


def flight(huetrackd, file, click=(40, 127, 53), frames=(30, 125), size=(320, 240)):
    tracks, failed = tracked_video(huetrackd, file, size, click)
    if failed:
        sys.exit(failed)
    rows = [row for row in tracks[frames[0]:frames[1]] if row["state"] == "tracking"]
    t, p = figures.column(rows, "t")[:, 0], figures.column(rows, "x", "y", "z")
    for name, path in (("picture, px", focal_of(size) * p[:, :2] / p[:, 2:]), ("3-D, m", p)):
        powers = np.vander(t - t.mean(), 3)
        parabola = powers @ np.linalg.lstsq(powers, path, rcond=None)[0]
        length = np.linalg.norm(np.diff(parabola, axis=0), axis=1).sum()
        off = np.sqrt(((path - parabola) ** 2).sum(axis=1).mean())
        print(f"{name:12} {len(rows)} of {frames[1] - frames[0]} frames, rms {off:.4g} of a path of {length:.4g}: {100 * off / length:.2f} %")


def last_view(huetrackd, scene, balls):
    file = scene / "huetrackd.yaml"
    config = yaml.safe_load(file.read_text()) if file.exists() else {"version": 1, "targets": {ball: COLOURS[ball] for ball in balls}}
    config.pop("cameras", None)
    config["object_tracking"] = {"volume": ROOM} | config.get("object_tracking", {})
    config["rig"] = str(scene / "rig.yaml")
    cameras = yaml.safe_load((scene / "rig.yaml").read_text())["cameras"]
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        (scratch / "all.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
        subprocess.run([huetrackd, "replay", scratch / "all.yaml", scene, "--no-dds", "--quiet", "--tracks", scratch / "tracks.csv"],
                       check=True, capture_output=True)
        rows = figures.read_csv(scratch / "tracks.csv")
    for ball in balls or config["targets"]:
        truth = figures.Truth(scene, ball, 0.5)
        mine = [row for row in rows if row["target"] == ball]
        t = figures.column(mine, "t")[:, 0]
        views, state = truth.seen_by(t), np.array([row["state"] for row in mine])
        is_alone = (views == 1) & (t >= truth.t[0]) & (t <= truth.t[-1])
        along, nees = [], []
        for i in np.flatnonzero(is_alone & (state == "tracking")):
            name = next(c for c, (at, seen) in truth.views.items() if seen[np.abs(at - t[i]).argmin()])
            rotation, translation = figures.pose_of(cameras[name])
            true = truth.at(t[i:i + 1])[0]
            ray, off = true + rotation.T @ translation, figures.column(mine[i:i + 1], "x", "y", "z")[0] - true
            c = figures.column(mine[i:i + 1], "cxx", "cxy", "cxz", "cyy", "cyz", "czz")[0][[0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(3, 3)
            along.append(off @ ray / np.linalg.norm(ray))
            nees.append(off @ np.linalg.solve(c, off))
        back, since = [], None
        for before, now, s in zip(views, views[1:], state[1:]):
            since = 0 if before < 2 <= now else None if now < 2 or since is None else since + 1
            if since is not None and s == "tracking":
                back.append(since)
                since = None
        share = [100 * (is_alone & (state == s)).sum() / max(1, is_alone.sum()) for s in ("tracking", "coasting")]
        print(f"{scene.name} {ball}: {is_alone.sum()} sets with one view, tracking {share[0]:.0f} %, coasting {share[1]:.0f} %" +
              (f"; along {1e3 * np.sqrt(np.square(along).mean()):.1f} mm rms, NEES {np.mean(nees):.1f}" if along else "") +
              f"; back after {np.mean(back) if back else float('nan'):.1f} sets ({len(back)} times)")


RADIUS_M = 0.035  # of the ball in a video, which no one has measured


def focal_of(size):
    return float(size[0] / 2 / np.tan(np.radians(30)))


def tracked_video(huetrackd, file, size, click):
    """click: frame, u, v. Rows of the track, and why there are none."""
    focal = focal_of(size)
    camera = {"image_size": list(size), "model": "pinhole_radtan", "intrinsics": {"fx": focal, "fy": focal, "cx": size[0] / 2, "cy": size[1] / 2},
              "distortion": [0, 0, 0, 0, 0], "cam_from_world": {"rotation": np.eye(3).tolist(), "translation": [0, 0, 0]}}
    config = {"version": 1, "rig": "rig.yaml", "targets": {"ball": {"radius_m": RADIUS_M}},
              "object_tracking": {"volume": {"min": [-3, -3, 0.2], "max": [3, 3, 6]}}}
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        (scratch / "rig.yaml").write_text(yaml.safe_dump({"version": 1, "cameras": {"cam0": camera}}))
        (scratch / "one.yaml").write_text(yaml.safe_dump(config))
        for command in (["teach", scratch / "one.yaml", f"cam0={file}", "--at", f"cam0,{click[0]},{click[1]:.0f},{click[2]:.0f}"],
                        ["replay", scratch / "one.yaml", f"cam0={file}", "--no-dds", "--quiet", "--tracks", scratch / "tracks.csv"]):
            done = subprocess.run([huetrackd, *command], capture_output=True, text=True)
            if done.returncode:
                return [], (done.stdout + done.stderr).strip()[-300:]
        return figures.read_csv(scratch / "tracks.csv"), None


def video(huetrackd, file, labels, visible, size, click):
    """labels: {frame: (u, v, radius)}; visible: frames that show the ball."""
    rows, failed = tracked_video(huetrackd, file, size, (click, *labels[click][:2]))
    if failed:
        return {"failed": failed}
    focal = focal_of(size)
    near = right_size = 0
    for frame, (u, v, radius_px) in labels.items():
        if frame >= len(rows) or rows[frame]["state"] != "tracking":
            continue
        p = np.array([float(rows[frame][k]) for k in "xyz"])
        at = focal * p[:2] / p[2] + np.array(size) / 2
        near += np.linalg.norm(at - [u, v]) < 0.35 * radius_px
        # The mean radius of a ball's image in perspective, which grows off the axis.
        published_px = focal * RADIUS_M * np.linalg.norm(p) ** 0.5 / p[2] ** 1.5
        right_size += abs(np.log(published_px / radius_px)) < np.log(1.12)
    is_near_visible = {f + d for f in visible for d in range(-2, 3)}
    wrong = sum(row["state"] in ("tracking", "coasting") for f, row in enumerate(rows) if f not in is_near_visible)
    return {"labels": len(labels), "centre_pct": 100 * near / len(labels), "radius_pct": 100 * right_size / len(labels),
            "tracking_pct": 100 * sum(rows[f]["state"] == "tracking" for f in visible if f < len(rows)) / len(visible), "not_there": wrong}


def videos(huetrackd, data):
    found = []
    for name, size in (("ball2", (640, 480)), ("ball3", (1280, 720))):
        folder = data / "green_ball_in_hand"
        labels = {int(r["frame"]): (float(r["cx"]), float(r["cy"]), float(r["r"])) for r in figures.read_csv(folder / f"labels_refined_{name}.csv")}
        visible = [int(r["frame"]) for r in figures.read_csv(folder / f"labels_{name}.csv") if r["cx"]]
        found.append((folder / f"{name}.mp4", labels, visible, size))
    folder = data / "red_pendulum"
    rows = [r for r in figures.read_csv(folder / "labels.csv") if r["cx"]]
    labels = {int(r["frame"]): (float(r["cx"]), float(r["cy"]), float(np.sqrt(float(r["area"]) / np.pi))) for r in rows}
    found.append((folder / "ball.mp4", labels, list(labels), (360, 640)))
    print(f"{'video, clicked frame':28}" + "".join(f"{c:>15}" for c in ("labels", "centre_pct", "radius_pct", "tracking_pct", "not_there")))
    for file, labels, visible, size in found:
        for click in sorted(labels)[len(labels) // 10::len(labels) // 4]:
            out = video(huetrackd, file, labels, visible, size, click)
            print(f"{file.parent.name[:12] + ' ' + file.stem + ' ' + str(click):28}" + "".join(f"{x:15.4g}" if isinstance(x, (int, float)) else f"  {x}" for x in out.values()), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("huetrackd", type=pathlib.Path)
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--videos", nargs="?", type=pathlib.Path, const=pathlib.Path(__file__).resolve().parents[2] / "../shared/data")
    parser.add_argument("--flight", type=pathlib.Path)
    parser.add_argument("--last-view", action="store_true")
    options = parser.parse_intermixed_args()
    if options.flight:
        return flight(options.huetrackd.resolve(), options.flight.resolve())
    if options.last_view:
        for word in options.scenes:
            folder, _, balls = word.partition("=")
            last_view(options.huetrackd.resolve(), pathlib.Path(folder).resolve(), balls.split(",") if balls else [])
        return None
    if options.videos:
        return videos(options.huetrackd.resolve(), options.videos.resolve())
    columns = ["sets", "tracking_pct", "across_mm", "along_mm", "along_pct", "along_bias_pct", "bound_pct", "nees", "inside95_pct", "far"]
    print(f"{'scene, camera':28}" + "".join(f"{c:>15}" for c in columns))
    for word in options.scenes:
        folder, _, target = word.partition("=")
        scene = pathlib.Path(folder).resolve()
        names = list(yaml.safe_load((scene / "rig.yaml").read_text())["cameras"])
        for camera in names:
            rows, ball, radius_m, rig = replayed(options.huetrackd.resolve(), scene, target or "pink", [camera])
            truth = figures.Truth(scene, ball, 0.5)
            out = measured(rows, truth, rig, radius_m)
            print(f"{scene.name + ' ' + camera:28}" + "".join(f"{out[c]:15.4g}" if c in out else f"{'':15}" for c in columns), flush=True)


if __name__ == "__main__":
    main()
