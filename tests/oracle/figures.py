"""Figures of merit of a track against the truth. Metres, seconds, pixels.

A position counts where its state is `tracking`. NEES is the mean of e' C^-1 e over them: 3 for an honest covariance in 3-D.
"""
import csv
import pathlib

import numpy as np
import yaml

CHI2_3_95 = 7.815  # 95 % of the chi-square distribution with 3 degrees of freedom
FAR_M = 0.10       # a position farther off than this is another object


def read_csv(path):
    with open(path) as file:
        return list(csv.DictReader(file))


def column(rows, *names):
    return np.array([[float(row[name]) for name in names] for row in rows]).reshape(len(rows), len(names))


class Truth:
    """Where one ball was, and how many cameras saw a share of it."""

    def __init__(self, folder, ball, least_visible):
        folder = pathlib.Path(folder)
        rows = read_csv(folder / "groundtruth.csv")
        rows = [row for row in rows if row.get("ball", ball) == ball] or rows
        self.t = column(rows, "t")[:, 0]
        self.p = column(rows, "x", "y", "z")
        self.views = {}  # camera -> (times, seen)
        for name in [k[4:] for k in rows[0] if k.startswith("vis_")]:
            self.views[name] = (self.t, column(rows, "vis_" + name)[:, 0] >= least_visible)
        if not self.views and (folder / "frames.csv").exists():
            frames = [row for row in read_csv(folder / "frames.csv") if row.get("ball", ball) == ball]
            for name in sorted({row["camera"] for row in frames}):
                mine = [row for row in frames if row["camera"] == name]
                self.views[name] = (column(mine, "stamp_s")[:, 0], column(mine, "visible")[:, 0] >= least_visible)

    def at(self, t):
        return np.stack([np.interp(t, self.t, self.p[:, k]) for k in range(3)], axis=1)

    def seen_by(self, t):
        """How many cameras see it at each time; all of two where the truth does not say."""
        if not self.views:
            return np.full(len(t), 2)
        count = np.zeros(len(t), int)
        for times, seen in self.views.values():
            order = np.argsort(times)
            times, seen = times[order], seen[order]
            next_ = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
            nearest = np.where(t - times[next_ - 1] < times[next_] - t, next_ - 1, next_)
            count += seen[nearest]
        return count


def best_shift(t, p, truth):
    """The one constant that the stamps are late by, seconds: no picture can show it (webcam_figures.py)."""
    def squared(shift):
        return ((p - truth.at(t - shift)) ** 2).sum()
    shift = min(np.arange(-0.08, 0.08, 0.001), key=squared)
    return min(np.arange(shift - 0.001, shift + 0.001, 0.00005), key=squared)


def track_figures(tracks, folder, targets, least_visible=0.5, free_shift=False):
    """tracks: rows of `huetrackd replay --tracks`. targets: target of the configuration -> ball of the truth."""
    errors, nees, visible, tracked, shifts = [], [], 0, 0, []
    for target, ball in targets.items():
        truth = Truth(folder, ball, least_visible)
        rows = [row for row in tracks if row["target"] == target]
        t = column(rows, "t")[:, 0]
        is_tracking = np.array([row["state"] == "tracking" for row in rows], bool)
        is_visible = (truth.seen_by(t) >= 2) & (t >= truth.t[0]) & (t <= truth.t[-1])
        visible += is_visible.sum()
        tracked += (is_visible & is_tracking).sum()
        rows = [row for row, yes in zip(rows, is_tracking) if yes]
        if not rows:
            continue
        t, p = column(rows, "t")[:, 0], column(rows, "x", "y", "z")
        c = column(rows, "cxx", "cxy", "cxz", "cyy", "cyz", "czz")[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)
        shift = best_shift(t, p, truth) if free_shift else 0.0
        shifts.append(shift)
        e = p - truth.at(t - shift)
        errors.append(np.linalg.norm(e, axis=1))
        nees.append(np.einsum("ni,ni->n", e, np.linalg.solve(c, e[..., None])[..., 0]))
    out = {"tracking_pct": 100 * tracked / max(1, visible)}
    if errors:
        errors, nees = np.concatenate(errors), np.concatenate(nees)
        out |= {"rms_mm": 1e3 * np.sqrt((errors ** 2).mean()), "nees": nees.mean(),
                "inside95_pct": 100 * (nees < CHI2_3_95).mean(), "far": int((errors > FAR_M).sum())}
        if free_shift:
            out["shift_ms"] = 1e3 * max(shifts, key=abs)
    return out


def rotation_of(q):
    x, y, z, w = q / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def read_tum(path):
    rows = [line.split() for line in open(path) if line.strip() and not line.startswith("#")]
    return np.array(rows, float).reshape(-1, 8)


def pose_figures(poses, truth, frames):
    """poses, truth: TUM files of camera-to-world poses; frames: how many the recording has."""
    found, true = read_tum(poses), read_tum(truth)
    if not len(found):
        return {"tracking_pct": 0.0}
    nearest = np.abs(found[:, :1] - true[None, :, 0]).argmin(axis=1)
    off = np.linalg.norm(found[:, 1:4] - true[nearest, 1:4], axis=1)
    angle = [np.degrees(np.arccos(np.clip((np.trace(rotation_of(a).T @ rotation_of(b)) - 1) / 2, -1, 1)))
             for a, b in zip(found[:, 4:], true[nearest, 4:])]
    return {"rms_mm": 1e3 * np.sqrt((off ** 2).mean()), "rms_deg": float(np.sqrt(np.square(angle).mean())),
            "tracking_pct": 100 * len(found) / frames, "far": int((off > FAR_M).sum())}


def rig_figures(found, true, low=(-1, -1, 0.1), high=(1, 1, 2.1)):
    """How far a rig's poses and lenses put the points of a volume that two of its cameras or more see: they are projected by the true
    cameras, triangulated by the found ones (least squares over the rays), and aligned rigidly. {"volume_mm": rms}"""
    found, true = (yaml.safe_load(open(path))["cameras"] for path in (found, true))
    grid = np.stack(np.meshgrid(*[np.linspace(a, b, 9) for a, b in zip(low, high)]), -1).reshape(-1, 3)
    rays = []  # (centre, directions, is in the picture) in the found world
    for name in found:
        rotation, translation = pose_of(true[name])
        p = grid @ rotation.T + translation
        pixel = distorted(p[:, :2] / p[:, 2:], true[name])
        is_seen = (p[:, 2] > 0) & np.all((pixel >= 0) & (pixel < true[name]["image_size"]), axis=1)
        rotation, translation = pose_of(found[name])
        directions = np.column_stack([undistorted(pixel, found[name]), np.ones(len(grid))]) @ rotation
        rays.append((-rotation.T @ translation, directions, is_seen))
    points, grid_seen = [], []
    for k in range(len(grid)):
        a, b, views = np.zeros((3, 3)), np.zeros(3), 0
        for centre, directions, is_seen in rays:
            if is_seen[k]:
                d = directions[k] / np.linalg.norm(directions[k])
                across = np.eye(3) - np.outer(d, d)
                a, b, views = a + across, b + across @ centre, views + 1
        if views >= 2:
            points.append(np.linalg.solve(a, b))
            grid_seen.append(grid[k])
    grid = np.array(grid_seen)
    points = np.array(points)
    middle, middle_true = points.mean(axis=0), grid.mean(axis=0)
    u, _, v = np.linalg.svd((points - middle).T @ (grid - middle_true))
    turn = v.T @ np.diag([1, 1, np.sign(np.linalg.det(v.T @ u.T))]) @ u.T
    off = (points - middle) @ turn.T + middle_true - grid
    return {"volume_mm": 1e3 * np.sqrt((off ** 2).sum(axis=1).mean())}


def pose_of(camera):
    pose = camera["cam_from_world"]
    rotation = rotation_of(np.array(pose["quaternion_xyzw"])) if "quaternion_xyzw" in pose else np.array(pose["rotation"], float)
    return rotation, np.array(pose["translation"], float)


def warp(xy, camera):
    """Where the lens puts points of the plane z = 1: OpenCV's radial-tangential model (5 or 8 numbers) or its fisheye."""
    d = np.array(list(camera.get("distortion", [])) + [0.0] * 8, float)[:8]
    x, y = xy.T
    r2 = x * x + y * y
    if camera["model"] == "fisheye_kb":
        r = np.sqrt(r2) + 1e-12
        theta = np.arctan(r)
        g = theta * (1 + d[0] * theta ** 2 + d[1] * theta ** 4 + d[2] * theta ** 6 + d[3] * theta ** 8) / r
        return xy * g[:, None]
    if camera["model"] != "pinhole_radtan":
        raise ValueError(f"the oracle knows no lens model {camera['model']}")
    g = (1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]))) / (1 + r2 * (d[5] + r2 * (d[6] + r2 * d[7])))
    return np.stack([x * g + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x), y * g + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y], 1)


def linear_part(camera):
    i = camera["intrinsics"]
    return np.array([i["fx"], i["fy"]]), np.array([i["cx"], i["cy"]])


def distorted(xy, camera):
    f, c = linear_part(camera)
    return warp(xy, camera) * f + c


def undistorted(pixel, camera):
    f, c = linear_part(camera)
    aim = (pixel - c) / f
    xy = aim.copy()
    for _ in range(30):  # a contraction for ordinary lenses: off by less than 1e-9 then
        xy = xy + aim - warp(xy, camera)
    return xy
