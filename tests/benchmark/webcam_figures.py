#!/usr/bin/env python3
"""How well webcams are tracked whose rows are exposed one after the other and whose stamps are late.

    webcam_figures.py HUETRACKD SCENE...

SCENE: a folder of ../shared/tools/scenes (scenes.py webcams --seed N --out SCENE), or ../shared/data/rendered/webcams. Each is
replayed twice: with the true latencies and readouts in the rig ("rig"), and with nothing known of them ("nothing"). Errors are
against the truth at each sample's own time, after the one constant shift of time that suits best, as no picture can tell it.
Needs Debian's python3-numpy and python3-yaml."""
import csv
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import yaml


def column(rows, *names):
    return np.array([[float(row[name]) for name in names] for row in rows])


def figures(track_file, truth_file):
    with open(truth_file) as file:
        truth = [row for row in csv.DictReader(file)]
    with open(track_file) as file:
        sets = [row for row in csv.DictReader(file)]
    first = next(i for i, row in enumerate(sets) if row["state"] == "tracking")
    track = [row for row in sets if row["state"] == "tracking"]
    truth_t, truth_p = column(truth, "t")[:, 0], column(truth, "x", "y", "z")
    t, p = column(track, "t")[:, 0], column(track, "x", "y", "z")
    c = column(track, "cxx", "cxy", "cxz", "cyy", "cyz", "czz")
    covariance = c[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3)

    def at(times):
        return np.stack([np.interp(times, truth_t, truth_p[:, k]) for k in range(3)], axis=1)

    def rms(shift):
        return np.sqrt(((p - at(t - shift)) ** 2).sum(axis=1).mean())

    shift = min(np.arange(-0.08, 0.08, 0.001), key=rms)
    shift = min(np.arange(shift - 0.001, shift + 0.001, 0.00005), key=rms)
    error = p - at(t - shift)
    size = np.linalg.norm(error, axis=1)
    speed = np.linalg.norm(at(t - shift + 1e-3) - at(t - shift - 1e-3), axis=1) / 2e-3
    moving_since = t[np.argmax(speed > 0.3)]
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)

    def mm(which):
        return 1e3 * np.sqrt((size[which] ** 2).mean()) if which.any() else float("nan")

    return [mm(size >= 0), mm(speed > 2), mm(t > moving_since + 5), 1e3 * size.max(), nees.mean(), 100 * (nees < 7.815).mean(),
            100 * len(track) / (len(sets) - first), 1e3 * shift]


def main():
    huetrackd, scenes = sys.argv[1], [pathlib.Path(name).resolve() for name in sys.argv[2:]]
    print("scene, known      rms  >2m/s  after 5 s   max [mm]   NEES  in 95 %  tracking %  shift [ms]")
    for scene in scenes:
        truth = yaml.safe_load((scene / "truth.yaml").read_text())
        for known in ("rig", "nothing"):
            with tempfile.TemporaryDirectory() as scratch:
                rig = yaml.safe_load((scene / "rig.yaml").read_text())
                for name, camera in rig["cameras"].items():
                    if known == "rig":
                        of = truth["cameras"][name]
                        camera["timing"] = {"latency_s": of["latency_s"], "latency_sigma_s": 0.0003,
                                            "readout_s": of["readout_s"], "readout_sigma_s": 0.0005}
                config = yaml.safe_load((scene / "huetrackd.yaml").read_text())
                config["rig"] = scratch + "/rig.yaml"
                pathlib.Path(config["rig"]).write_text(yaml.safe_dump(rig))
                pathlib.Path(scratch, "huetrackd.yaml").write_text(yaml.safe_dump(config))
                subprocess.run([huetrackd, "replay", scratch + "/huetrackd.yaml", str(scene), "--no-dds", "--quiet",
                                "--tracks", scratch + "/tracks.csv"], check=True, stderr=subprocess.DEVNULL)
                f = figures(scratch + "/tracks.csv", scene / "groundtruth.csv")
            print(f"{scene.name[:10]:10} {known:8}" + "{:6.1f} {:6.1f} {:10.1f} {:10.1f} {:6.2f} {:8.1f} {:11.1f} {:11.2f}".format(*f),
                  flush=True)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main()
